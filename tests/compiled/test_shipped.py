"""Kernels that are shipped or compiled in advance, what is said when compiling, and processes that need the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.registry import cpu_target

from atra.compiled import store
from atra.compiled.instruction_sets import VARIABLE, instruction_sets_here
from tests.compiled.test_kernel_cache import TWO_KINDS, imported, with_another_bit
from tests.folders import ROOT


@pytest.fixture
def two_kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of a kernel and a callback, compiled to be shipped; what is kept elsewhere is kept in `kept`."""
    store._warn.cache_clear()
    path = tmp_path / "two_kinds.py"
    path.write_text(TWO_KINDS)
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "kept"))
    with monkeypatch.context() as shipping:
        shipping.setenv(store.INTO_VARIABLE, str(tmp_path / "shipped"))
        assert imported(path).answers() == (21, 42)
    assert not list((tmp_path / "kept").rglob("*.nbc"))
    monkeypatch.setattr(store, "SHIPPED", tmp_path / "shipped")
    return path


def test_shipped_kernels_are_run_wherever_the_library_lies_and_nothing_is_kept(two_kinds: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    again = imported(two_kinds.rename(elsewhere / two_kinds.name))
    assert again.answers() == (21, 42)
    assert again.read_from_disk() == (1, 1)
    assert not list((tmp_path / "kept").rglob("*.nbc"))


def test_kernels_are_compiled_for_an_instruction_set_whatever_folder_they_are_kept_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "two_kinds.py").write_text(TWO_KINDS)
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "kept"))
    imported(tmp_path / "two_kinds.py").answers()
    _, processor, features = cpu_target.target_context.codegen().magic_tuple()
    if instruction_sets_here():  # a set, so that what one processor keeps serves others
        assert (processor[:8], features) in {("x86-64-v", ""), ("sandybri", "")}
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    numba.core.config.reload_config()
    again = imported(tmp_path / "two_kinds.py")
    assert (again.answers(), again.read_from_disk()) == ((21, 42), (1, 1))


@pytest.mark.parametrize("harm", ["another text", "a damaged file", "another version of Numba", "no folder"])
def test_shipped_kernels_that_do_not_fit_are_compiled_and_kept(
    harm: str, two_kinds: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shipped = sorted((tmp_path / "shipped").rglob("*.nbc"))
    assert len(shipped) == 2
    if harm == "another text":
        two_kinds.write_text(TWO_KINDS + "\n# changed\n", encoding="utf-8")
    elif harm == "a damaged file":
        for path in shipped:
            path.write_bytes(with_another_bit(path.read_bytes()))
    elif harm == "another version of Numba":
        monkeypatch.setattr(numba, "__version__", "0.0.1")
    else:
        monkeypatch.setattr(store, "SHIPPED", tmp_path / "nothing here")
    before = [path.read_bytes() for path in shipped]
    first, second = imported(two_kinds), imported(two_kinds)
    assert first.answers() == second.answers() == (21, 42)
    assert (first.read_from_disk(), second.read_from_disk()) == ((0, 0), (1, 1))
    assert [path.read_bytes() for path in shipped] == before  # which may belong to all users of the machine


COUNTED = """
import numba.core.event as event
from atra.compiled.store import kernel

class Compilations(event.Listener):
    def on_start(self, one): print("compiled", flush=True)
    def on_end(self, one): pass

@kernel
def total(n):
    found = 0
    for k in range(n):
        found += k % 3
    return found

def run():
    input()
    with event.install_listener("numba:compile", Compilations()):
        assert total(10) == 9
"""


def test_of_processes_that_need_the_same_kernel_at_once_one_compiles_it(tmp_path: Path) -> None:
    (tmp_path / "counted.py").write_text(COUNTED, encoding="utf-8")
    run = f"import sys; sys.path[:0] = {[str(tmp_path), str(ROOT)]}; import counted; counted.run()"
    processes = [
        subprocess.Popen([sys.executable, "-c", run], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    for process in processes:
        process.stdin.write("\n")  # type: ignore[union-attr]
        process.stdin.flush()  # type: ignore[union-attr]
    told = [process.communicate()[0] for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert "".join(told).count("compiled") == 1


@pytest.mark.slow
def test_machines_with_other_processors_may_share_the_folder_that_kernels_are_kept_in(tmp_path: Path) -> None:
    path = tmp_path / "two_kinds.py"
    path.write_text(TWO_KINDS)
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import two_kinds as it"
    code += "; print(it.answers(), it.read_from_disk())"
    for known, from_disk in ((False, "(0, 0)"), (True, "(1, 1)")):
        for name in instruction_sets_here():
            variables = {"PYTHONPATH": str(ROOT), "NUMBA_CACHE_DIR": str(tmp_path / "shared"), VARIABLE: name}
            command = [sys.executable, "-c", code]
            done = subprocess.run(command, env=os.environ | variables, capture_output=True, text=True, check=True)
            assert done.stdout == f"(21, 42) {from_disk}\n", (name, known)


@pytest.mark.parametrize("quiet", [False, True])
def test_compiling_is_told_once_unless_it_is_to_be_quiet(
    quiet: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(store.QUIET_VARIABLE, "1" if quiet else "0")
    store._say_compiling.cache_clear()
    path = tmp_path / "two_kinds.py"
    path.write_text(TWO_KINDS)
    for _ in range(2):  # compiled, then kept
        imported(path).answers()
    assert capsys.readouterr().err == ("" if quiet else "atra: compiling kernels for this machine, once\n")


SHIPPED_IMAGE = """
import sys
from pathlib import Path
from atra.compiled import store
store.SHIPPED = Path(sys.argv[1])
import numba.core.event as event
compiled = []
class Compilations(event.Listener):
    def on_start(self, one): compiled.append(one)
    def on_end(self, one): pass
event.register("numba:compile", Compilations())
import numpy, atra
from tests.meshes import cornell_box, cornell_camera
with atra.RasterTracer(cornell_box(), cornell_camera(64, 48)) as tracer:
    hits = tracer.trace()
numpy.savez(sys.argv[2], depth=hits.depth, prim_id=hits.prim_id)
print(len(compiled))
"""


@pytest.mark.slow
def test_shipped_kernels_give_the_image_of_freshly_compiled_ones_and_nothing_is_compiled(tmp_path: Path) -> None:
    def run(*command: str, **environment: str) -> str:
        variables = {"PATH": "", "HOME": str(tmp_path / "home"), "PYTHONPATH": str(ROOT), **environment}
        variables["NUMBA_CACHE_DIR"] = str(tmp_path / "kept")
        done = subprocess.run([sys.executable, *command], env=variables, capture_output=True, text=True, check=True)
        return done.stdout

    shipped = store.SHIPPED  # CI has compiled them, for a wheel
    if not shipped.is_dir():
        shipped = tmp_path / "shipped"
        command = "from atra.command.main import main; raise SystemExit(main())"
        run("-c", command, "compile", **{store.INTO_VARIABLE: str(shipped)})
    script = tmp_path / "image.py"
    script.write_text(SHIPPED_IMAGE)
    assert run(str(script), str(shipped), str(tmp_path / "shipped.npz")) == "0\n"
    assert not list((tmp_path / "kept").rglob("*.nbc"))
    assert run(str(script), str(tmp_path / "none"), str(tmp_path / "compiled.npz")) != "0\n"
    assert list((tmp_path / "kept").rglob("*.nbc"))
    with np.load(tmp_path / "shipped.npz") as one, np.load(tmp_path / "compiled.npz") as other:
        assert np.isfinite(one["depth"]).any()
        for name in ("depth", "prim_id"):
            np.testing.assert_array_equal(one[name], other[name])
