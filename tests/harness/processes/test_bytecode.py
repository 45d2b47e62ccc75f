"""Workers of a sweep keep bytecode in a folder of its results; where they cannot, they are slower and nothing else."""

import os
import shutil
import subprocess
import sys
from collections import namedtuple

import pytest

from experiments.harness.processes import bytecode
from experiments.harness.processes.bytecode import bytecode_folder
from experiments.harness.processes.launching import project_environment, run_worker
from tests.harness.processes.test_launch import worker
from tests.harness.processes.test_outcome import GOOD, POINT

VARIABLES = ("PYTHONDONTWRITEBYTECODE", "PYTHONPYCACHEPREFIX")

WORKER = worker(
    f"import tabnanny; told = json.loads({GOOD.to_json()!r})\n"
    f"told['results'] |= {{name: os.environ.get(name) for name in {VARIABLES}}}\n"
    "json.dump(told, open(job['result_path'], 'w'))"
)
"""A worker that imports a module, and tells of its environment."""


@pytest.fixture(autouse=True)
def as_in_an_image(monkeypatch):
    """Nothing has bytecode beside its source, and Python is to write none."""
    monkeypatch.setattr(bytecode, "_is_beside_sources", lambda: False)
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.delenv("PYTHONPYCACHEPREFIX", raising=False)


def told_by_worker(results):
    outcome = run_worker(POINT, WORKER, results)
    assert (outcome.status, outcome.error) == ("ok", None)
    return [outcome.results[name] for name in VARIABLES]


def kept(results):
    """Bytecode of the module that the worker imports."""
    return list((results / ".bytecode").rglob("tabnanny*.pyc"))


def test_workers_of_a_sweep_keep_bytecode_in_its_results_whatever_the_environment_says(tmp_path):
    with bytecode_folder(tmp_path):
        assert told_by_worker(tmp_path) == ["", str(tmp_path / ".bytecode")]
        (first,) = kept(tmp_path)
        written = first.stat().st_mtime_ns
        assert told_by_worker(tmp_path) == ["", str(tmp_path / ".bytecode")]
        assert first.stat().st_mtime_ns == written
    assert list(tmp_path.iterdir()) == []
    assert told_by_worker(tmp_path) == ["1", None]


def test_workers_find_the_folder_wherever_they_are_started(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    results = tmp_path.relative_to(tmp_path)
    with bytecode_folder(results):
        assert told_by_worker(results) == ["", str(tmp_path / ".bytecode")]


def test_bytecode_beside_the_sources_is_left_in_use(tmp_path, monkeypatch):
    monkeypatch.setattr(bytecode, "_is_beside_sources", lambda: True)
    with bytecode_folder(tmp_path):
        assert told_by_worker(tmp_path) == ["1", None]


def test_bytecode_that_came_with_the_results_is_never_run(tmp_path):
    with bytecode_folder(tmp_path):
        told_by_worker(tmp_path)
        shutil.copytree(tmp_path / ".bytecode", tmp_path / "given")
    (tmp_path / "given").rename(tmp_path / ".bytecode")
    assert kept(tmp_path)
    with bytecode_folder(tmp_path):
        assert kept(tmp_path) == []


def test_a_folder_that_cannot_be_made_or_a_full_disk_leaves_workers_as_they_are(tmp_path, monkeypatch):
    nowhere = tmp_path / "nowhere"
    with bytecode_folder(nowhere):
        assert told_by_worker(nowhere) == ["1", None]
    full = namedtuple("Usage", "total used free")(1 << 40, (1 << 40) - 4096, 4096)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: full)
    with bytecode_folder(tmp_path):
        assert told_by_worker(tmp_path) == ["1", None]


@pytest.mark.parametrize("name", ["tabnanny", ""], ids=["of_a_module", "of_all"])
def test_bytecode_that_a_full_disk_cut_short_is_made_anew_and_the_point_is_measured(name, tmp_path):
    with bytecode_folder(tmp_path):
        told_by_worker(tmp_path)
        for path in (tmp_path / ".bytecode").rglob(f"{name}*.pyc"):
            os.truncate(path, path.stat().st_size * 3 // 4)
        assert told_by_worker(tmp_path) == ["1", None]


def test_a_worker_that_fails_for_another_reason_is_not_run_again(tmp_path):
    runs = tmp_path / "runs"
    with bytecode_folder(tmp_path):
        outcome = run_worker(POINT, worker(f"open({str(runs)!r}, 'a').write('1'); sys.exit(3)"), tmp_path)
    assert (outcome.status, runs.read_text(encoding="utf-8")) == ("failed", "1")


@pytest.mark.parametrize(("writes", "beside"), [("1", [False, False]), ("", [True, True])])
def test_whether_bytecode_lies_beside_the_sources_is_seen_by_what_is_imported(writes, beside, tmp_path):
    environment = project_environment() | {
        "PYTHONDONTWRITEBYTECODE": writes,
        "PYTHONPYCACHEPREFIX": str(tmp_path),  # all that Python has, there, is what these processes write
    }
    code = "from experiments.harness.processes import bytecode; print(bytecode._is_beside_sources())"
    for expected in beside:
        ran = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
        assert ran.stdout.strip() == str(expected)


def test_bytecode_older_than_its_source_is_none(tmp_path):
    source, cached = tmp_path / "a.py", tmp_path / "a.pyc"
    for path, time_s in ((source, 2000), (cached, 1000)):
        path.write_bytes(b"")
        os.utime(path, (time_s, time_s))
    assert not bytecode._is_compiled(str(source), str(cached))
    os.utime(cached, (2000, 2000))
    assert bytecode._is_compiled(str(source), str(cached))
