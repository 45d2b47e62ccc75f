"""The Embree room: finding the library, struct layouts, lifetimes."""

import ctypes
import os
import platform
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement

import atra
from atra.embree import layout, library
from atra.embree.filters_kernels import memory_monitor
from atra.embree.scene import EmbreeScene
from atra.embree.self_check import FILTER_FUNCTION
from atra.embree.workspace import Workspace
from atra.geometry.ray_space import padded_vertices
from tests.meshes import cornell_box

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("place", [
    "embreex.libs/libembree4-4aef3270.so.4", "embreex/.dylibs/libembree4.4.dylib", "embreex/embree4.dll",
    "embreex.libs/embree4-0123abcd.dll",
])  # fmt: skip
def test_the_library_is_found_where_each_system_has_it(tmp_path, place):
    package = tmp_path / "embreex"
    package.mkdir()
    (tmp_path / place).parent.mkdir(exist_ok=True)
    (tmp_path / place).touch()
    assert list(library._candidates(package)) == [tmp_path / place]


def test_a_file_that_is_no_library_is_refused_saying_what_to_install(tmp_path):
    (tmp_path / "libembree4.so").write_text("not a library")
    script = (
        "import atra.embree.library as l, atra\n"
        "try: l.load_library()\n"
        "except atra.EmbreeError as e: print(e)\n"
    )  # fmt: skip
    environment = {**os.environ, library.OVERRIDE_VARIABLE: str(tmp_path / "libembree4.so")}
    said = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True)
    assert "not a usable libembree4" in said.stdout
    assert "pip install" in said.stdout


@pytest.mark.parametrize(("system", "machine", "python", "implementation", "problem"), [
    ("linux", "x86_64", (3, 11), "CPython", None), ("linux", "x86_64", (3, 15), "CPython", None),
    ("linux", "x86_64", (3, 16), "CPython", "Python 3.16"), ("linux", "x86_64", (3, 11), "PyPy", "PyPy"),
    ("linux", "aarch64", (3, 14), "CPython", "Linux on aarch64"), ("darwin", "arm64", (3, 14), "CPython", None),
    ("darwin", "x86_64", (3, 11), "CPython", None), ("win32", "AMD64", (3, 14), "CPython", None),
    ("win32", "ARM64", (3, 14), "CPython", "Windows on ARM64"),
    ("freebsd14", "amd64", (3, 14), "CPython", "FreeBSD on amd64"),
])  # fmt: skip
def test_without_a_wheel_installing_leaves_embreex_out_and_the_first_run_says_why(
    system, machine, python, implementation, problem, monkeypatch
):
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (embreex,) = (Requirement(one) for one in pyproject["project"]["dependencies"] if one.startswith("embreex"))
    installed = embreex.marker.evaluate({
        "platform_python_implementation": implementation, "platform_machine": machine, "sys_platform": system,
        "python_version": ".".join(map(str, python)), "extra": "",
    })  # fmt: skip
    assert installed == (problem is None)
    monkeypatch.delenv(library.OVERRIDE_VARIABLE, raising=False)
    monkeypatch.setattr(library.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(sys, "version_info", (*python, 0))
    monkeypatch.setattr(platform, "system", lambda: "FreeBSD")
    monkeypatch.setattr(platform, "machine", lambda: machine)
    monkeypatch.setattr(platform, "python_implementation", lambda: implementation)
    with pytest.raises(atra.EmbreeError) as raised:
        library._locate()
    if problem is None:
        assert "install it with `pip install 'embreex" in str(raised.value)
    else:
        assert f"embreex has no wheel for {problem}; set ATRA_EMBREE to a libembree4 of version 4.4" in str(
            raised.value
        )
        assert "pip" not in str(raised.value)


def test_an_override_is_a_file_in_the_working_folder_or_refused(tmp_path, monkeypatch):
    (tmp_path / "own.so").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(library.OVERRIDE_VARIABLE, "own.so")
    assert str(library._locate()) == str(tmp_path / "own.so")  # the loader looks elsewhere for a bare name
    monkeypatch.setenv(library.OVERRIDE_VARIABLE, "nowhere/libembree4.so")
    with pytest.raises(atra.EmbreeError, match=r"nowhere/libembree4\.so"):
        library._locate()


@pytest.mark.parametrize("width", [1, 4, 8, 16])
def test_query_memory_is_aligned_for_the_widest_packet_and_coherent_as_it_is_set(width):
    vertices = padded_vertices(5)
    assert vertices.base.nbytes == vertices.nbytes + 16  # Embree reads as far past the last vertex
    own = Workspace(width, coherent=True)
    arguments = layout.IntersectArguments.from_address(own.packet.arguments_address)
    assert arguments.flags == layout.FLAG_COHERENT
    own.set_coherent(False)
    assert arguments.flags == 0
    for memory in own.packet[:5]:
        assert memory.ctypes.data % layout.PACKET_ALIGNMENT_BYTES == 0
    assert own.packet.arguments_address % layout.PACKET_ALIGNMENT_BYTES == 0


def test_embree_reports_a_bad_call_by_name():
    faces = np.zeros((1, 3), np.uint32)
    # Embree wants vertices on 4-byte boundaries.
    unaligned = np.ndarray((1, 3), np.float32, buffer=bytearray(64), offset=1)
    with pytest.raises(atra.EmbreeError, match="rtcSetSharedGeometryBuffer"):
        EmbreeScene(unaligned, faces)


def test_a_closed_scene_has_no_address_and_closing_twice_is_harmless():
    mesh = cornell_box()
    with EmbreeScene(mesh.vertices, mesh.faces, monitor_address=memory_monitor()) as scene:
        assert scene.address
        assert scene.embree_bytes > 1000
    scene.close()
    assert scene.closed
    assert scene.embree_bytes == 0
    with pytest.raises(atra.ClosedError, match="closed"):
        _ = scene.address


REAL = ctypes.CDLL(str(library._locate()))


class FakeLibrary:
    """The real library, but for the functions given; `open` counts devices and scenes made and not yet released."""

    def __init__(self, **replaced):
        self.open = 0
        for name, (result, arguments) in library._SIGNATURES.items():
            function = getattr(REAL, name)
            function.restype, function.argtypes = result, arguments
            setattr(self, name, replaced.get(name) or self._counted(name, function))

    def _counted(self, name, function):
        step = {"rtcNew": 1, "rtcRel": -1}.get(name[:6], 0)

        def call(*arguments):
            self.open += step
            return function(*arguments)

        return call


def load(fake, monkeypatch):
    """`load_library` with `fake` in place of the library, not cached."""
    monkeypatch.setattr(library.ctypes, "CDLL", lambda path: fake)
    return library.load_library.__wrapped__()


def with_version(number):
    def device_property(device, which):
        return number if which == layout.DEVICE_VERSION else REAL.rtcGetDeviceProperty(device, which)

    return FakeLibrary(rtcGetDeviceProperty=device_property)


def with_words(width, *, swapped=(), changed=()):
    """A library that returns rays of `width` with two words of every lane swapped, or one changed."""

    def intersect(*arguments):
        getattr(REAL, f"rtcIntersect{width}")(*arguments)
        words = np.ctypeslib.as_array((ctypes.c_uint32 * (21 * width)).from_address(arguments[-2])).reshape(21, width)
        if swapped:
            words[list(swapped)] = words[list(swapped[::-1])]
        for word in changed:
            words[word, -1] ^= 0x00400000

    return FakeLibrary(**{f"rtcIntersect{width}": intersect})


def with_filter_arguments(**changes):
    """A library that gives filters other arguments: each of `changes` makes one of the real ones."""
    kept = []

    def set_filter(geometry, address):
        original = FILTER_FUNCTION(address)

        def call(arguments_address):
            arguments = layout.FilterArguments.from_buffer_copy(
                ctypes.string_at(arguments_address, ctypes.sizeof(layout.FilterArguments))
            )
            for name, change in changes.items():
                setattr(arguments, name, change(arguments))
            original(ctypes.addressof(arguments))

        kept.append(FILTER_FUNCTION(call))
        REAL.rtcSetGeometryIntersectFilterFunction(geometry, ctypes.cast(kept[-1], ctypes.c_void_p).value)

    return FakeLibrary(rtcSetGeometryIntersectFilterFunction=set_filter)


@pytest.mark.core
def test_a_library_that_answers_as_expected_is_taken_and_nothing_of_the_check_remains(monkeypatch):
    fake = FakeLibrary()
    assert load(fake, monkeypatch).native_packet_widths == library.load_library().native_packet_widths
    assert fake.open == 0
    assert load(with_version(40501), monkeypatch).version == (4, 5, 1)  # a later one with the same structs


@pytest.mark.parametrize(("number", "name"), [(30000, "3.0.0"), (40399, "4.3.99"), (50000, "5.0.0")])
def test_a_library_of_another_version_is_refused_before_it_is_used_and_let_go(number, name, monkeypatch):
    fake = with_version(number)
    used = []
    for function in ("rtcNewScene", "rtcNewGeometry", "rtcIntersect1"):
        setattr(fake, function, lambda *arguments: used.append(arguments))
    with pytest.raises(
        atra.EmbreeError, match=f"is Embree {name}, expected at least 4.4.0 and below 5.0.0; install it with `pip"
    ):
        load(fake, monkeypatch)
    assert fake.open == 0
    assert not used


@pytest.mark.parametrize(("replaced", "message"), [
    ({"rtcGetDeviceProperty": lambda device, which: (
        0 if which == layout.DEVICE_FILTER_FUNCTION else REAL.rtcGetDeviceProperty(device, which)
    )}, "built without filter functions"),
    ({"rtcNewDevice": lambda _: None, "rtcGetDeviceError": lambda _: 5}, "cannot create a device: unsupported CPU"),
    ({"rtcSetGeometryIntersectFilterFunction": lambda *_: None}, "calls of the filter"),
    ({"rtcAttachGeometryByID": None}, "rtcAttachGeometryByID"),
])  # fmt: skip
def test_a_library_that_lacks_something_is_refused_naming_it(replaced, message, monkeypatch):
    fake = FakeLibrary(**replaced)
    for name in [name for name, function in replaced.items() if function is None]:
        delattr(fake, name)
    with pytest.raises(atra.EmbreeError, match=message):
        load(fake, monkeypatch)


RAY_FIELDS = ["org_x", "org_y", "org_z", "tnear", "dir_x", "dir_y", "dir_z", "time", "tfar", "mask", "id", "flags"]
HIT_FIELDS = ["Ng_x", "Ng_y", "Ng_z", "u", "v", "prim_id", "geom_id", "inst_id"]


@pytest.mark.parametrize("width", {1, library.load_library().native_packet_widths[-1]})
@pytest.mark.parametrize(("word", "field"), list(enumerate(RAY_FIELDS + HIT_FIELDS)))
def test_a_field_that_reads_back_wrong_is_named(width, word, field, monkeypatch):
    # The last lane of a packet is switched off: its ray must not have changed, its hit is not looked at.
    if width > 1 and field in HIT_FIELDS and field not in ("prim_id", "geom_id"):
        fake = with_words(width, swapped=(word, 8))  # with tfar, which is then the first to be found wrong
        field = "tfar"
    else:
        fake = with_words(width, changed=(word,))
    with pytest.raises(atra.EmbreeError, match=rf"cannot be used: {field} of the (ray|packet) .* for {width} rays"):
        load(fake, monkeypatch)


@pytest.mark.core
@pytest.mark.parametrize(("words", "field"), [
    ((12, 13), "Ng_x"), ((13, 14), "Ng_y"), ((15, 16), "u"), ((14, 16), "Ng_z"), ((17, 18), "prim_id"),
    ((18, 19), "geom_id"), ((19, 20), "inst_id"), ((3, 8), "tnear"), ((0, 4), "org_x"),
])  # fmt: skip
def test_two_fields_that_changed_places_are_found_out(words, field, monkeypatch):
    for width in library.load_library().native_packet_widths:
        with pytest.raises(atra.EmbreeError, match=rf"cannot be used: {field} of the (ray|packet) .* for {width} rays"):
            load(with_words(width, swapped=words), monkeypatch)


@pytest.mark.core
@pytest.mark.parametrize(("changes", "message"), [
    ({"ray_count": lambda given: 0}, "N of what the filter is given"),
    ({"ray_count": lambda given: given.ray_count + 16}, "N of what the filter is given"),
    ({"user_data": lambda given: given.valid}, "geometryUserPtr of what the filter is given"),
    ({"context": lambda given: given.ray}, "context of what the filter is given"),
    ({"valid": lambda given: given.ray}, "valid of all calls of the filter"),
    ({"ray": lambda given: given.ray + 4}, "tfar of what the filter is given"),
    ({"hit": lambda given: given.hit - 4}, "prim_id of what the filter is given"),
])  # fmt: skip
def test_a_filter_that_is_given_something_else_is_found_out(changes, message, monkeypatch):
    fake = with_filter_arguments(**changes)
    with pytest.raises(atra.EmbreeError, match=message):
        load(fake, monkeypatch)
    assert fake.open == 0


def with_occluded(width, word, value):
    """A library whose rtcOccluded answers for packets of `width` have another value of a word."""

    def occluded(*arguments):
        getattr(REAL, f"rtcOccluded{width}")(*arguments)
        words = np.ctypeslib.as_array((ctypes.c_float * (12 * width)).from_address(arguments[-2])).reshape(12, width)
        words[word] = value

    return FakeLibrary(**{f"rtcOccluded{width}": occluded})


@pytest.mark.core
@pytest.mark.parametrize("width", library.load_library().native_packet_widths)
def test_an_occlusion_that_is_answered_otherwise_is_found_out(width, monkeypatch):
    nobody, everybody = (layout.RAY_TFAR, 1.0, "tfar < 0"), (layout.RAY_TFAR, -np.inf, "tfar < 0")
    for word, value, field in (nobody, everybody, (layout.RAY_MASK, 0.0, "mask")):
        if width == 1 and value == -np.inf:  # the only ray is occluded
            continue
        fake = with_occluded(width, word, value)
        with pytest.raises(atra.EmbreeError, match=rf"{field} of what rtcOccluded{width} returns .* for {width} rays"):
            load(fake, monkeypatch)
        assert fake.open == 0
