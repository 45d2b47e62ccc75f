"""Compiled kernels where a real file system refuses them: mounted read-only, or full.

The mounts are made in a namespace of the process's own (`unshare`), so nothing else sees them."""

import os
import shlex
import shutil
import subprocess
import sys

import pytest

from tests.folders import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.uncovered]

TRACE = """
import atra, numpy
mesh = atra.Mesh(numpy.float32([[-1, -1, 0], [1, -1, 0], [0, 1, 0]]), numpy.uint32([[0, 1, 2]]))
with atra.PixelTracer(mesh, atra.Camera((0, 0, 3), (0, 0, 0), width=8, height=8)) as tracer:
    print(tracer.trace().prim_id[4, 4], atra.__file__)
"""


@pytest.fixture(scope="module", autouse=True)
def may_mount():
    mount = ["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"]
    if shutil.which("unshare") is None or subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("needs a system that lets this process mount folders of its own")


@pytest.fixture
def packages(tmp_path):
    """A folder with the package `atra` as pip would install it, no kernel compiled."""
    shutil.copytree(
        ROOT / "atra", tmp_path / "packages" / "atra", ignore=shutil.ignore_patterns("__pycache__", "shipped")
    )
    return tmp_path / "packages"


def traced(mounts, packages, **variables):
    """Mount, then trace with the package of that folder; returns what the process printed and told of trouble."""
    command = f"{mounts} && exec {shlex.quote(sys.executable)} -c {shlex.quote(TRACE)}"
    environment = {"PATH": os.environ["PATH"], "PYTHONDONTWRITEBYTECODE": "1", **variables}
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", command], cwd=packages, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["0", str(packages / "atra" / "__init__.py")]  # not the clone
    return done.stderr


def read_only(folder):
    quoted = shlex.quote(str(folder))
    return f"mount --bind {quoted} {quoted} && mount -o remount,ro,bind {quoted}"


def test_with_read_only_packages_kernels_are_kept_in_the_home_directory(packages, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    assert "cannot be kept" not in traced(read_only(packages), packages, HOME=str(home))
    assert list(home.rglob("*.nbc"))


def test_with_nothing_that_can_be_written_to_the_image_is_right_and_the_reason_is_told_once(packages, tmp_path):
    said = traced(read_only(tmp_path), packages, HOME=str(tmp_path / "home"))
    assert said.count("cannot be kept (no folder for it can be written to)") == 1
    assert "NUMBA_CACHE_DIR" in said


def test_on_a_full_disk_the_image_is_right_and_the_reason_is_told_once_for_each_folder(packages, tmp_path):
    full = tmp_path / "full"
    full.mkdir()
    mounts = f"mount -t tmpfs -o size=16k none {shlex.quote(str(full))}"
    said = traced(mounts, packages, NUMBA_CACHE_DIR=str(full))
    reasons = [line for line in said.splitlines() if "cannot be kept" in line and "No space left on device" in line]
    assert len(reasons) == len(set(reasons)) >= 1
