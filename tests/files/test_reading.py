"""The bound on what reading a file may cost: small files that claim much end in an error before anything is read."""

import json
import os
import signal
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import atra
from atra.errors import InputError
from atra.files import reading
from atra.files.reading import LEAST_BYTES, MEMORY_PER_BYTE, VARIABLE, Allowance, parse_json
from atra.light import PanoramaSky
from tests.files.test_hostile_meshes import gltf
from tests.light.test_sky_files import exr_of, openexr

ROOT = Path(__file__).resolve().parents[2]


def black_exr(folder):
    """2,000 x 88,000 black pixels: the one chunk of 16 lines of a small EXR, as often as needed."""
    small = exr_of(np.zeros((16, 2000, 3), np.float16))
    head = small.index(b"\0\0", small.index(b"screenWindowWidth") + 30)  # the last attribute, and the header's end
    chunk = small[-(len(small) - int.from_bytes(table_of(small)[:8], "little")) :]
    start, count = len(small) - len(chunk) - 8, 5500
    assert start > head
    window = struct.pack("<4i", 0, 0, 1999, 15)
    top = small[:start].replace(window, struct.pack("<4i", 0, 0, 1999, 16 * count - 1))
    places = (start + 8 * count + number * len(chunk) for number in range(count))
    table = b"".join(struct.pack("<Q", place) for place in places)
    body = b"".join(struct.pack("<i", 16 * number) + chunk[4:] for number in range(count))
    path = folder / "black.exr"
    path.write_bytes(top + table + body)
    return path


def table_of(content):
    """The table of the places of chunks, of an EXR with one, which stands right before it."""
    place = next(at for at in range(len(content) - 8, 8, -1) if content[at : at + 8] == struct.pack("<Q", at + 8))
    return content[place:]


def black_hdr(folder):
    """34 MB of the longest runs: 16,377 x 32,767 pixels."""
    runs = b"".join(bytes([128 + min(127, 32767 - at), 0]) for at in range(0, 32767, 127))
    path = folder / "black.hdr"
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16377 +X 32767\n"
    path.write_bytes(head + 16377 * (bytes([2, 2, 127, 255]) + 4 * runs))
    return path


def empty_primitives(folder):
    empty = {"bufferView": 0, "componentType": 5126, "count": 0, "type": "VEC3"}
    one = {**empty, "count": 3}
    meshes = [
        {"primitives": [{"attributes": {"POSITION": 0}}] * 300_000},
        {"primitives": [{"attributes": {"POSITION": 1}}]},
    ]
    return gltf(folder, [{"mesh": 0}, {"mesh": 1}], [0, 1], accessors=[empty, one], meshes=meshes)


READ = """
import json, os, signal, sys
from pathlib import Path
import OpenEXR
from atra.errors import InputError
from tests import fuzzing
from tests.files import headers
loaders = {".exr": headers.PanoramaSky.load, ".hdr": headers.PanoramaSky.load, ".gltf": headers.load_mesh}
fuzzing.bound_memory(2**30)
for path in map(Path, sys.argv[1:]):
    signal.alarm(fuzzing.TIME_S)
    try:
        loaders.get(path.suffix, headers.load_face_sources)(path)
    except InputError as error:
        fuzzing.check_refusal(error)
        print(error)
"""


@pytest.mark.slow
@openexr
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="bounds the memory of a process as Linux does it")
def test_small_files_that_claim_much_are_refused_by_their_claim_within_a_gibibyte(tmp_path):
    made = [black_exr(tmp_path), black_hdr(tmp_path), tmp_path / "faces.off", tmp_path / "corners.off"]
    for path, faces, corners in ((made[2], 10**9, 3), (made[3], 1, 10**9)):
        text = f"OFF\n3 {faces} 0\n0 0 0\n1 0 0\n0 1 0\n{corners} 0 1 2\n"
        path.write_text(text, encoding="utf-8")
    made.append(empty_primitives(tmp_path))
    assert made[0].stat().st_size < 2**21
    done = subprocess.run(
        [sys.executable, "-c", READ, *map(str, made)], cwd=ROOT, capture_output=True, text=True, timeout=200
    )
    told = done.stdout.splitlines()
    assert (len(told), done.stderr) == (5, "")
    for line, expected in zip(told, (
        "it claims 528,000,000 numbers, which take about 9.8 GiB to read; its", "it claims 32,767 x 16,377 pixels",
        "it promises 3 vertices and 1,000,000,000 faces, but has only 45 bytes; it seems cut short",
        "line 6, '1000000000 0 1 2', is no number of corners, and as many indices",
        "parts and more, which take about",
    ), strict=True):  # fmt: skip
        assert expected in line
    assert all("If you trust the file, raise memory_per_byte" in line for line in told if "claims" in line)


@pytest.mark.parametrize(
    ("read", "name"), [(atra.load_mesh, "a.off"), (atra.load_face_sources, "a.off"), (PanoramaSky.load, "a.hdr")]
)
def test_the_bound_is_an_option_of_every_reader_and_an_environment_variable(read, name, tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LEAST_BYTES", 0)
    path = tmp_path / name
    path.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", encoding="utf-8")
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
    path = gltf(tmp_path, [{"mesh": 0}], [0], buffers=[{"byteLength": 36, "uri": "points.bin"}])
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    (tmp_path / "points.bin").write_bytes(points)
    with pytest.raises(InputError, match=f"its {path.stat().st_size + 36:,} bytes are allowed"):
        atra.load_mesh(path, memory_per_byte=1.0)
    (tmp_path / "points.bin").write_bytes(points + bytes(20_000))
    assert atra.load_mesh(path, memory_per_byte=1.0).triangle_count == 1


@pytest.mark.parametrize("text", ["[" * 101 + "]" * 101, '{"a":' * 101 + "1" + "}" * 101, "[" * 10**5, '{"a":[' * 990])
def test_json_nested_deeper_than_a_hundred_levels_is_refused(text, tmp_path):
    with pytest.raises(InputError, match=r"nested too deeply, expected at most 100 levels|is no JSON"):
        parse_json(text)
    for name, read in (
        ("deep.gltf", atra.load_mesh),
        ("deep.gltf", atra.load_face_sources),
        ("t.json", atra.read_transforms),
    ):
        (tmp_path / name).write_text(text, encoding="utf-8")
        with pytest.raises(InputError, match=rf"{name}.*(nested too deeply|is no JSON)"):
            read(tmp_path / name)
    assert parse_json("[" * 100 + "]" * 100)


def test_no_other_file_is_read_for_a_gltf_that_is_nested_too_deeply_for_its_reader(tmp_path):
    healthy = gltf(tmp_path, [{"mesh": 0}], [0])
    tree = json.loads(healthy.read_text())
    healthy.rename(tmp_path / "model.gltf")  # the name trimesh falls back to
    tree["asset"]["extras"] = None
    text = json.dumps(tree).replace("null", "[" * 985 + "]" * 985)
    (tmp_path / "deep.gltf").write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="nested too deeply"):
        atra.load_mesh(tmp_path / "deep.gltf")


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="bounds the memory of a process as Linux does it")
@pytest.mark.slow
@pytest.mark.uncovered
def test_files_with_random_headers_are_used_or_refused_within_a_gibibyte(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.files.headers", "200"], cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=3000,
    )  # fmt: skip
    now = tmp_path / "now.txt"
    reading_now = now.read_text() if now.exists() else "nothing yet"
    if done.returncode < 0:
        pytest.fail(f"ended by {signal.Signals(-done.returncode).name} while reading {reading_now}")
    assert done.returncode == 0, f"while reading {reading_now}: {done.stderr[-3000:]}"
    told = json.loads(done.stdout.splitlines()[-1])
    assert len(told) == 6
    for name, counts in told.items():
        assert counts["used"], f"every {name} was refused at the door, which proves nothing"
        assert counts["refused"]


@pytest.mark.parametrize(("name", "text", "claimed"), [
    ("n.gltf", '{"nodes":[' + 5000 * "{}," + "{}]}", "5,001 nodes"),
    ("t.json", '{"frames":[' + 5000 * "{}," + "{}]}", "5,000 frames and more"),
    ("images.txt", 5000 * "0 0 0 0 0 0 0 0 0 a\n\n", "0 images and more"),
])  # fmt: skip
def test_files_of_many_tiny_things_are_refused_by_their_number(name, text, claimed, tmp_path, monkeypatch):
    monkeypatch.setattr(reading, "LEAST_BYTES", 0)
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 8 8 8 8 4 4\n", encoding="utf-8")
    read = {
        "images.txt": lambda: atra.read_colmap(tmp_path, broken={}, memory_per_byte=20),
        "t.json": lambda: atra.read_transforms(path, broken={}, memory_per_byte=1000),
    }.get(name, lambda: atra.load_mesh(path))
    with pytest.raises(InputError, match=f"{name}.* it claims {claimed}, .*memory_per_byte is"):
        read()
