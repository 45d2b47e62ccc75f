"""The bound on what reading a file may cost: small files that claim much end in an error before anything is read."""

import numpy as np
import pytest

import atra
from atra.errors import InputError
from atra.files import reading
from atra.files.reading import LEAST_BYTES, MEMORY_PER_BYTE, VARIABLE, Allowance, parse_json
from atra.light import PanoramaSky
from tests.files.samples import CORNERS, TRIANGLES, gltf, written

OFF = "OFF\n3 {} 0\n0 0 0\n1 0 0\n0 1 0\n{} 0 1 2\n"
EMPTY = {"bufferView": 0, "componentType": 5126, "count": 0, "type": "VEC3"}
PRIMITIVES = [{"attributes": {"POSITION": 0}}] * 300_000


@pytest.mark.parametrize(("name", "content", "message"), [
    ("faces.off", OFF.format(10**9, 3), "promises 3 vertices and 1,000,000,000 faces, but has 4 lines"),
    ("corners.off", OFF.format(1, 10**9), "line 6, '1000000000 0 1 2', is no number of corners, and as many indices"),
    ("empty.gltf", gltf([{"mesh": 0}], accessors=[EMPTY], meshes=[{"primitives": PRIMITIVES}]),
     "it claims [0-9,]+ parts and more, which take .*If you trust the file, raise memory_per_byte"),
    ("n.gltf", gltf([{}] * 300_000, scenes=[]), "it claims 300,000 nodes, .*memory_per_byte is"),
])  # fmt: skip
def test_a_small_mesh_file_that_claims_much_is_refused_by_its_claim(name, content, message, tmp_path):
    with pytest.raises(InputError, match=message):
        atra.load_mesh(written(tmp_path, name, content))


@pytest.mark.parametrize(
    ("read", "name"), [(atra.load_mesh, "a.off"), (atra.load_face_sources, "a.off"), (PanoramaSky.load, "a.hdr")]
)
def test_the_bound_is_an_option_of_every_reader_and_an_environment_variable(read, name, tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LEAST_BYTES", 0)
    path = written(tmp_path, name, OFF.format(1, 3))
    if path.suffix == ".hdr":
        path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n" + bytes(8))
    read(path)
    with pytest.raises(InputError, match=r"memory_per_byte is 0\.5"):
        read(path, memory_per_byte=0.5)
    monkeypatch.setenv(VARIABLE, "0.25")
    with pytest.raises(InputError, match=r"memory_per_byte is 0\.25"):
        read(path)
    read(path, memory_per_byte=float("inf"))
    monkeypatch.setenv(VARIABLE, "much")
    with pytest.raises(InputError, match=rf"{VARIABLE} is 'much', expected a number above 0"):
        read(path)


@pytest.mark.parametrize("wrong", [0, -1.0, float("nan"), "x", [1]])
def test_a_bound_that_is_none_is_refused(wrong):
    with pytest.raises(InputError, match=r"memory_per_byte is .*, expected a number above 0"):
        Allowance(10, wrong)


def test_what_is_allowed_grows_with_the_file_and_never_beyond_the_free_memory(monkeypatch):
    Allowance(1).check("this", LEAST_BYTES)
    Allowance(10**7).check("this", int(10**7 * MEMORY_PER_BYTE))
    with pytest.raises(InputError, match=r"claims this, which take about 128 MiB to read; its 1 bytes are allowed 128"):
        Allowance(1).check("this", LEAST_BYTES + 1)
    monkeypatch.setattr(reading.psutil, "virtual_memory", lambda: type("", (), {"available": 1000})())
    with pytest.raises(InputError, match=r"claims this, .* but the machine has only 1000 bytes free"):
        Allowance(10**7, float("inf")).check("this", 1001)


def test_the_files_that_a_gltf_names_count_as_part_of_it(tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LEAST_BYTES", 0)
    path = written(tmp_path, "box.gltf", gltf([{"mesh": 0}], buffers=[{"byteLength": 168, "uri": "points.bin"}]))
    points = np.array(CORNERS, "<f4").tobytes() + np.array(TRIANGLES, "<u2").tobytes()
    (tmp_path / "points.bin").write_bytes(points)
    with pytest.raises(InputError, match=f"its {path.stat().st_size + 168:,} bytes are allowed"):
        atra.load_mesh(path, memory_per_byte=1.0)
    (tmp_path / "points.bin").write_bytes(points + bytes(30_000))
    assert atra.load_mesh(path, memory_per_byte=1.0).triangle_count == 12


@pytest.mark.parametrize("text", ["[" * 101 + "]" * 101, '{"a":' * 101 + "1" + "}" * 101, "[" * 10**5, '{"a":[' * 990])
def test_json_nested_deeper_than_a_hundred_levels_is_refused(text, tmp_path):
    with pytest.raises(InputError, match=r"nested too deeply, expected at most 100 levels|is no JSON"):
        parse_json(text)
    for name, read in (("deep.gltf", atra.load_mesh), ("t.json", atra.read_transforms)):
        with pytest.raises(InputError, match=rf"{name}.*(nested too deeply|is no JSON)"):
            read(written(tmp_path, name, text))
    assert parse_json("[" * 100 + "]" * 100)


@pytest.mark.parametrize(("name", "text", "claimed"), [
    ("t.json", '{"frames":[' + 5000 * "{}," + "{}]}", "5,000 frames and more"),
    ("images.txt", 5000 * "0 0 0 0 0 0 0 0 0 a\n\n", "0 images and more"),
])  # fmt: skip
def test_files_of_many_tiny_cameras_are_refused_by_their_number(name, text, claimed, tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LEAST_BYTES", 0)
    path = written(tmp_path, name, text)
    written(tmp_path, "cameras.txt", "1 PINHOLE 8 8 8 8 4 4\n")
    read, path, bound = (atra.read_transforms, path, 1000) if name == "t.json" else (atra.read_colmap, tmp_path, 20)
    with pytest.raises(InputError, match=f"{name}.* it claims {claimed}, .*memory_per_byte is"):
        read(path, broken={}, memory_per_byte=bound)
