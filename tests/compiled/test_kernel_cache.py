"""What Numba keeps on disk is run again only while nothing that it was made of has changed; it need not keep any."""

import errno
import importlib.machinery
import importlib.util
import inspect
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import numba
import pytest

import atra
from atra.all_hits.taking_kernels import LAYERS
from atra.compiled import intrinsics, store, vectors
from atra.embree import layout
from atra.exact import edges_kernels, surface_kernels
from atra.light.pictures import lighting_kernels
from atra.packets import loop_kernels
from atra.raster import drawing, spans
from atra.raster.all_hits import undecided_kernels
from atra.raster.all_hits.drawing_kernels import gathering_kernel
from atra.rays import embree_kernels
from atra.rays.tree import nearest_kernels
from experiments.methods import tiles_kernels

KERNELS = {
    **{
        f"{info.name}.{name}": value
        for info in walk_packages(atra.__path__, "atra.")
        if info.name.endswith("_kernels")
        for name, value in vars(import_module(info.name)).items()
        if getattr(value, "targetoptions", {}).get("nogil")
    },
    "surface_kernel": surface_kernels.surface_kernel(surface_kernels.WEIGHTS),
    "packet_kernel": loop_kernels.packet_kernel(4, 2),
    "tile_kernel": tiles_kernels.tile_kernel(4, 2),
    "embree_kernel": embree_kernels.embree_kernel(4, False),
    "nearest_kernel": nearest_kernels.nearest_kernel(False),
    "lighting_kernel": lighting_kernels.lighting_kernel(4),
    "drawing_kernel": drawing.drawing_kernel(4, False),
    "gathering_kernel": gathering_kernel(4, False, LAYERS),
    "settling_kernel": undecided_kernels.settling_kernel(LAYERS),
}
"""All kernels of the library's modules of kernels, and one of each that is made on demand."""


@pytest.fixture(autouse=True)
def beside_the_source(monkeypatch):
    """Code is kept beside its source, whatever folder this run of the tests keeps its own in."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", "")
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)


@pytest.mark.parametrize("name", KERNELS)
def test_a_kernel_is_kept_under_the_stamp_of_its_sources_and_closes_over_constants_alone(name):
    path = Path(inspect.getfile(KERNELS[name].py_func))
    assert store.source_stamp(path) == KERNELS[name]._cache._cache_file._source_stamp
    closed = [cell.cell_contents for cell in KERNELS[name].py_func.__closure__ or ()]
    assert all(isinstance(value, bool | int | float | str) for value in closed)  # compiled code has no lasting name
    assert len(KERNELS) > 50


def test_kernels_make_pointers_by_the_one_function_that_says_null_is_valid():
    machine = Path(str(intrinsics.__file__))
    library = Path(str(atra.__file__)).parent
    assert [path for path in library.rglob("*.py") if "inttoptr" in path.read_text(encoding="utf-8")] == [machine]
    assert machine.read_text(encoding="utf-8").count("inttoptr") == 1


def test_a_function_that_kernels_call_is_compiled_without_wrappers_and_python_can_call_it_before_and_after():
    called = store.njit(lambda number: number + 1)
    calls = numba.njit(lambda number: 2 * called(number))
    assert (called(3), calls(3), called(3), called(3.5)) == (4, 8, 4, 4.5)
    (compiled,) = called.overloads.values()
    names = {function.name for function in compiled.library.get_defined_functions()}
    assert compiled.fndesc.llvm_func_name in names
    assert names.isdisjoint({compiled.fndesc.llvm_cpython_wrapper_name, compiled.fndesc.llvm_cfunc_wrapper_name})


def test_the_sources_of_a_kernel_are_all_files_of_the_library_and_of_its_own_package_that_it_imports(tmp_path):
    def file(module):
        return Path(str(module.__file__))

    found = store.sources(file(drawing))
    assert found > {file(module) for module in (drawing, spans, edges_kernels, vectors)}
    assert file(loop_kernels) not in found
    inner = tmp_path / "mine" / "inner"
    inner.mkdir(parents=True)
    for folder in (inner.parent, inner):
        (folder / "__init__.py").write_text("")
    kernels, parts = inner / "kernels.py", inner.parent / "parts.py"
    kernels.write_text("import numpy\nfrom mine.parts import half\n")
    parts.write_text("from atra.embree.layout import MISS\n")
    assert store.sources(kernels) >= {kernels, parts, Path(str(layout.__file__))}
    assert all(one.is_relative_to(tmp_path) or "atra" in one.parts for one in store.sources(kernels))


@pytest.mark.parametrize(
    "text",
    [
        "from atra.room import layout",
        "from atra.room import other, layout as places",
        "from atra.room import (\n    other,\n    layout,\n)",
        "from atra.room.layout import SIZE",
        "import atra.room.layout",
        "def later():\n    from atra.room import layout",
    ],
)
def test_a_module_counts_among_the_sources_however_it_is_imported(text, tmp_path, monkeypatch):
    room = tmp_path / "atra" / "room"
    room.mkdir(parents=True)
    for name in ("__init__", "layout", "other"):
        (room / f"{name}.py").write_text("")
    (room / "kernels.py").write_text(text)
    monkeypatch.setattr(store, "_PACKAGE", tmp_path / "atra")
    assert room / "layout.py" in store.sources(room / "kernels.py")


class SourceAlone(importlib.machinery.SourceFileLoader):
    """Keeps no bytecode: Python would take it for that of another text, as long, written within the same second."""

    def set_data(self, *_, **__):
        pass


def imported(path):
    """The file as a new module, as another process would import it."""
    loader = SourceAlone(path.stem, str(path))
    spec = importlib.util.spec_from_loader(path.stem, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # Numba imports it by name when it reads from disk
    loader.exec_module(module)
    return module


def test_kept_code_is_run_again_until_another_file_that_it_is_made_of_changes(tmp_path, monkeypatch):
    path = tmp_path / "made_of_two_files.py"
    stamps = iter((1, 1, 2))
    monkeypatch.setattr(store, "source_stamp", lambda path: next(stamps))
    path.write_text(
        "from numba import njit\n"
        "from atra.compiled.store import kernel\n"
        "def make(constant):  # stands for what is inlined from another file\n"
        "    global helper\n"
        "    helper = njit(inline='always')(eval(f'lambda: {constant}'))\n"
        "@kernel\n"
        "def answer():\n"
        "    return helper()\n"
    )

    def answer(constant):
        module = imported(path)
        module.make(constant)
        return int(module.answer())

    assert answer(1) == 1
    assert answer(2) == 1  # Numba sees the same file: this is what the stamp is for
    assert answer(2) == 2


TWO_KINDS = """
import ctypes
from numba import types
from atra.compiled.store import callback, kernel

@kernel
def half(x):
    return x // 2

@callback(types.int64(types.int64))
def twice(x):
    return 2 * x

def answers():
    return half(42), ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(twice.address)(21)

def read_from_disk():
    return sum(half.stats.cache_hits.values()), twice.cache_hits
"""


@pytest.fixture
def two_kinds(tmp_path):
    """A module of a kernel and a callback."""
    store._warn.cache_clear()
    path = tmp_path / "two_kinds.py"
    path.write_text(TWO_KINDS)
    return path


def test_kept_code_is_run_again_when_its_file_is_written_anew_and_not_when_its_text_changes(two_kinds):
    assert imported(two_kinds).answers() == (21, 42)
    os.utime(two_kinds, (1e9, 1e9))
    again = imported(two_kinds)
    assert again.answers() == (21, 42)
    assert again.read_from_disk() == (1, 1)
    two_kinds.write_text(TWO_KINDS.replace("x // 2", "x // 3"), encoding="utf-8")
    os.utime(two_kinds, (1e9, 1e9))
    assert imported(two_kinds).answers() == (14, 42)


def with_another_bit(whole):
    middle = len(whole) // 2
    return whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]


@pytest.mark.parametrize("damaged", [with_another_bit, lambda whole: whole[: len(whole) // 2], lambda _: b"\xff" * 99])
@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
def test_damaged_files_are_compiled_anew_and_replaced(suffix, damaged, two_kinds):
    assert imported(two_kinds).answers() == (21, 42)
    kept = [path for path in two_kinds.parent.rglob("*") if path.suffix == suffix]
    assert len(kept) == 2
    for path in kept:
        path.write_bytes(damaged(path.read_bytes()))
    again = imported(two_kinds)
    assert again.answers() == (21, 42)
    if (suffix, damaged) != (".nbi", with_another_bit):  # a bit that says nothing about the code may be another one
        assert again.read_from_disk() == (0, 0)
    last = imported(two_kinds)
    assert last.answers() == (21, 42)
    assert last.read_from_disk() == (1, 1)


CALLING = """
from atra.compiled.store import kernel

@kernel
def inner(number):
    return number + 1

@kernel
def outer(number):
    return inner(number) + 1
"""


@pytest.mark.parametrize("is_kept", [False, True])
def test_a_kernel_that_calls_another_is_refused(is_kept, tmp_path):
    """A kernel that is kept on disk leaves only the names of its symbols to code that would call it."""
    path = tmp_path / "calling.py"
    path.write_text(CALLING)
    if is_kept:
        assert imported(path).inner(1) == 2
    with pytest.raises(TypeError, match="compiled code calls a kernel; make what kernels call with njit"):
        imported(path).outer(1)


TWO_VARIANTS = """
from atra.compiled.store import kernel

def make(number):
    @kernel
    def answer():
        return number + FACTOR * 10
    return answer

def answers():
    return make(1)(), make(2)()
"""


def test_two_processes_that_keep_code_under_one_name_do_not_get_each_others(tmp_path):
    """What such a race leaves: files in each other's place, or one of an older source."""
    path = tmp_path / "two_variants.py"
    path.write_text(TWO_VARIANTS + "\nFACTOR = 1")
    assert imported(path).answers() == (11, 12)
    first, second = sorted(tmp_path.rglob("*.nbc"))
    older = first.read_bytes()
    first.write_bytes(second.read_bytes())
    second.write_bytes(older)
    assert imported(path).answers() == (11, 12)
    path.write_text(TWO_VARIANTS + "\nFACTOR = 2")
    assert imported(path).answers() == (21, 22)
    first.write_bytes(older)
    assert imported(path).answers() == (21, 22)


@pytest.mark.parametrize("reason", ["no folder", "No space left on device"])
def test_what_cannot_be_kept_is_told_once_and_compiled_anew(reason, two_kinds, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as hindered:
        if reason == "no folder":
            (two_kinds.parent / "__pycache__").write_text("a file, not a folder")
            for name in ("XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
                hindered.setenv(name, str(two_kinds / "no folder"))
            hindered.setattr(numba.config, "CACHE_DIR", "")
        else:
            hindered.setattr(os, "replace", full)
        with pytest.warns(UserWarning, match=rf"cannot be kept \(.*{reason}") as caught:
            assert imported(two_kinds).answers() == (21, 42)
    assert len(caught) == 1
    if reason == "No space left on device":
        imported(two_kinds).answers()
        again = imported(two_kinds)
        assert again.answers() == (21, 42)
        assert again.read_from_disk() == (1, 1)


OF_PARTS = """
import numpy as np
from numba import njit
from atra.compiled.store import kernel
from atra.compiled.intrinsics import float_at

@njit
def farthest(slopes, box):  # of the corners of a box of two times four numbers, along several ways
    for way in range(0, 15, 3):
        total = 0.0
        for axis in range(3):
            slope = slopes[way + axis]
            total += slope * float_at(box + 4 * axis + (16 if slope > 0.0 else 0))
        if total < 0.0:
            return way
    return 15

@kernel
def farthest_of_each(slopes, box, found):
    for k in range(len(found)):
        found[k] = farthest(slopes[k], box)

random = np.random.default_rng(0)
slopes, box = random.normal(size=(999, 15)), np.float32([1, -2, -3, 0, 2, 1, -0.5, 0])
found = np.empty(999, np.int64)
farthest_of_each(slopes, box.ctypes.data, found)
ways = slopes.reshape(-1, 5, 3)
totals = (ways * np.where(ways > 0, box[4:7], box[:3])).sum(axis=2)
expected = np.where((totals < 0).any(axis=1), 3 * (totals < 0).argmax(axis=1), 15)
print(sum(farthest_of_each.stats.cache_hits.values()), (found == expected).all(), set(found.tolist()))
"""


def test_a_process_that_compiles_a_kernel_calls_the_code_that_it_keeps(tmp_path):
    """A function called by a kernel is optimised once more there, and a part of an address is then no null pointer. Of
    functions with one name the first is called; copies in a kernel share none with what they are copies of."""
    path = tmp_path / "of_parts.py"
    path.write_text(OF_PARTS)
    run = f"import sys; sys.path[:0] = {[str(tmp_path), str(Path(store.__file__).parents[2])]}; import of_parts"
    for kept in ("0", "1"):
        told = subprocess.run([sys.executable, "-c", run], capture_output=True, text=True, check=True).stdout
        hits, is_right, found = told.split(maxsplit=2)
        assert (hits, is_right, len(found.split(",")) > 3) == (kept, "True", True)
    path.write_text(f"{OF_PARTS}# compiled here")
    module = imported(path)
    names = [
        {function.name for function in compiled.library.get_defined_functions()}
        for one in (module.farthest, module.farthest_of_each)
        for compiled in one.overloads.values()
    ]
    assert any("8farthest" in name for name in names[1])
    assert not {name for name in names[0] & names[1] if "NRT" not in name}
