"""The Embree room: finding the library, struct layouts, lifetimes."""

import os
import subprocess
import sys

import numpy as np
import pytest

import atra
from atra.embree import layout, library
from atra.embree.scene import EmbreeScene, padded_vertices
from atra.embree.workspace import Workspace
from atra.kernels.callbacks import memory_monitor
from tests.meshes import cornell_box


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


def test_an_override_that_is_no_file_is_refused(monkeypatch):
    monkeypatch.setenv(library.OVERRIDE_VARIABLE, "nowhere/libembree4.so")
    with pytest.raises(atra.EmbreeError, match=r"nowhere/libembree4\.so"):
        library._locate()


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


@pytest.mark.parametrize("number", [30000, 40303, 50000])
def test_another_version_is_refused_naming_it_and_what_to_install(number):
    with pytest.raises(atra.EmbreeError, match=r"pip install"):
        library._check_version("libembree4.so", number)


def test_the_version_in_the_wheel_is_accepted():
    assert library._check_version("libembree4.so", 40400) == (4, 4, 0)
    assert library.embree_version().startswith("4.")


@pytest.mark.parametrize(("width", "size_bytes"), [(1, 96), (4, 336), (8, 672), (16, 1344)])
def test_packets_have_the_size_of_the_c_structs(width, size_bytes):
    assert layout.packet_words(width) * 4 == size_bytes


def test_the_context_begins_as_embrees_does_and_the_arguments_have_its_size():
    assert layout.RayQueryContext.depth_address.offset == 8
    assert layout.ARGUMENTS_BYTES == 32


@pytest.mark.parametrize("width", [1, 4, 8, 16])
def test_query_memory_is_aligned_for_the_widest_packet(width):
    own = Workspace(width, coherent=True)
    for memory in (own.packet, own.all_lanes, own.valid, own.context):
        assert memory.ctypes.data % layout.PACKET_ALIGNMENT_BYTES == 0
    assert own.arguments_address % layout.PACKET_ALIGNMENT_BYTES == 0


def test_vertices_can_be_read_sixteen_bytes_past_the_last():
    vertices = padded_vertices(5)
    assert vertices.base.nbytes == vertices.nbytes + 16


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
    with pytest.raises(atra.EmbreeError, match="closed"):
        _ = scene.address
