"""Random headers for every format of mesh and sky, read in a process whose memory is bounded.

`python -m tests.files.headers COUNT` reads COUNT random files of each format in the working folder, which should be
empty. `now.txt` in it names the format and the file being read, should this process die. Prints, as JSON, how many
files of each format were used and refused; ends with a traceback at the first that fares otherwise.
"""

from __future__ import annotations

import json
import signal
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from atra.errors import InputError
from atra.files.meshes.face_sources import load_face_sources
from atra.files.meshes.loading import load_mesh
from atra.light import PanoramaSky
from tests import fuzzing

MEMORY_BYTES = 2**30
"""What reading one file may add to the process."""

_LARGE = [2**k + d for k in (8, 15, 16, 24, 31, 32, 40, 63, 64) for d in (-1, 0)] + [10**6, 10**9, 10**18]
NUMBERS = st.one_of(st.integers(-2, 9), st.sampled_from(_LARGE), st.integers(0, 2**30))


def mostly(draw: st.DrawFn, usual: Any, other: st.SearchStrategy[Any]) -> Any:
    """What a healthy file has, in seven cases of eight."""
    return usual if draw(st.integers(0, 7)) else draw(other)


BODIES = st.one_of(st.binary(max_size=200), st.just(bytes(4000)), st.just(b"0 0 1\n" * 300))


@st.composite
def offs(draw: st.DrawFn) -> bytes:
    """Counts, and rows of which some keep them."""
    rows = draw(st.lists(st.tuples(st.just(3), st.just(0), st.just(1), st.just(2)), min_size=1, max_size=3))
    rows = [(mostly(draw, row[0], NUMBERS), *row[1:]) for row in rows]
    counts = b"%d %d 0" % (mostly(draw, 3, NUMBERS), mostly(draw, len(rows), NUMBERS))
    head = draw(st.sampled_from([b"OFF\n", b"COFF\n", b"OFF ", b"# 9\nOFF\n"]))
    return head + counts + b"\n0 0 0\n1 0 0\n0 1 0\n" + b"".join(b"%d %d %d %d\n" % row for row in rows)


@st.composite
def plys(draw: st.DrawFn) -> bytes:
    """Elements and properties of any number and type."""
    kind = draw(st.sampled_from(["ascii", "ascii", "binary_little_endian", "binary_big_endian"]))
    types = st.sampled_from(["char", "uchar", "short", "int", "uint", "float", "double", "float128"])
    axes = ["x", "y", "z"]
    lines = ["ply", f"format {kind} 1.0"]
    for name in mostly(draw, ["vertex", "face"], st.lists(st.sampled_from(["vertex", "face", "edge", "thing"]))):
        lines.append(f"element {name} {mostly(draw, {'vertex': 3, 'face': 1}.get(name, 0), NUMBERS)}")
        fields = mostly(draw, axes if name == "vertex" else ["vertex_indices"], st.lists(st.sampled_from(axes)))
        for field in fields:
            is_list = mostly(draw, name != "vertex", st.booleans())
            count, value = mostly(draw, "uchar", types), mostly(draw, "int" if is_list else "float", types)
            lines.append(f"property list {count} {value} {field}" if is_list else f"property {value} {field}")
    order = ">" if "big" in kind else "<"
    corners = mostly(draw, 3, NUMBERS)
    binary = struct.pack(f"{order}9fB3i", 0, 0, 0, 1, 0, 0, 0, 1, 0, corners & 255, 0, 1, 2)
    body = b"0 0 0\n1 0 0\n0 1 0\n%d 0 1 2\n" % corners if kind == "ascii" else binary
    return "\n".join([*lines, "end_header\n"]).encode() + mostly(draw, body, BODIES)


@st.composite
def objs(draw: st.DrawFn) -> bytes:
    """Faces with indices of every kind."""
    faces = draw(st.lists(st.lists(st.integers(1, 3), min_size=3, max_size=6), max_size=6))
    written = [
        " ".join(str(mostly(draw, one, NUMBERS)) + mostly(draw, "", st.just("/7")) for one in face) for face in faces
    ]
    return ("v 0 0 1\nv 1 0 0\nv 0 1 0\n" + "".join(f"f {face}\n" for face in written)).encode()


@st.composite
def gltfs(draw: st.DrawFn) -> bytes:
    """Counts, sizes and offsets of any size; meshes placed, and buffers named, again and again."""
    few = st.integers(0, 2)
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
        {"bufferView": 0, "componentType": 5125, "count": 3, "type": "SCALAR"},
    ]
    for accessor in accessors:
        accessor["count"] = mostly(draw, 3, NUMBERS)
        accessor["type"] = mostly(draw, accessor["type"], st.sampled_from(["SCALAR", "VEC3", "MAT4"]))
        accessor["byteOffset"] = mostly(draw, 0, NUMBERS)
    primitives = [{"attributes": {"POSITION": 0}, **({"indices": 1} if draw(st.booleans()) else {})}]
    primitives += draw(
        st.lists(st.fixed_dictionaries({"attributes": st.just({"POSITION": 0})}, optional={"mode": few}))
    )
    repeated = mostly(draw, 1, st.sampled_from([50, 5000, 20_000]))
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": mostly(draw, 60, NUMBERS), "uri": "data:;base64," + "AAAA" * 20}],
        "bufferViews": [{"buffer": mostly(draw, 0, few), "byteLength": mostly(draw, 60, NUMBERS)}]
        * mostly(draw, 1, st.just(10_000)),
        "accessors": accessors,
        "meshes": [{"primitives": primitives * repeated}],
        "nodes": [{"mesh": 0}] * repeated,
        "scenes": [{"nodes": list(range(repeated))}],
    }
    return json.dumps(tree).encode()


@st.composite
def hdrs(draw: st.DrawFn) -> bytes:
    """Sizes of any number, and rows that begin as they must."""
    height, width = mostly(draw, 3, NUMBERS), mostly(draw, 40, NUMBERS)
    size = mostly(draw, b"-Y %d +X %d\n", st.just(b"+X %d -Y %d\n")) % (height, width)
    row = bytes([2, 2, width >> 8 & 255, width & 255]) + bytes([128 + 40, 0]) * mostly(draw, 4, st.integers(0, 400))
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size + row * mostly(draw, 3, st.integers(0, 300))


@st.composite
def exrs(draw: st.DrawFn) -> bytes:
    """Every attribute that an image needs, with windows, channels, tiles and counts of any size."""
    word = NUMBERS.map(lambda number: struct.pack("<I", number & 0xFFFFFFFF))
    one, four = struct.pack("<I", 1), st.lists(word, min_size=4, max_size=4).map(b"".join)
    window = struct.pack("<4I", 0, 0, 3, 1)
    channels = b"".join(
        name
        + b"\0"
        + mostly(draw, struct.pack("<I", 2), word)
        + bytes(4)
        + mostly(draw, 2 * one, st.tuples(word, word).map(b"".join))
        for name in mostly(draw, [b"B", b"G", b"R"], st.lists(st.sampled_from([b"A", b"B", b"G", b"R"]), max_size=5))
    )
    attributes = {
        b"channels": (b"chlist", channels + b"\0"),
        b"compression": (b"compression", bytes([mostly(draw, 0, st.integers(0, 11))])),
        b"dataWindow": (b"box2i", mostly(draw, window, four)), b"displayWindow": (b"box2i", mostly(draw, window, four)),
        b"lineOrder": (b"lineOrder", bytes([mostly(draw, 0, st.integers(0, 3))])),
        b"pixelAspectRatio": (b"float", mostly(draw, struct.pack("<f", 1), word)),
        b"screenWindowCenter": (b"v2f", bytes(8)), b"screenWindowWidth": (b"float", struct.pack("<f", 1)),
    }  # fmt: skip
    flags = mostly(draw, 0, st.sampled_from([0x200, 0x800, 0x1000]))
    if flags:
        sides = mostly(draw, struct.pack("<II", 4, 2), st.tuples(word, word).map(b"".join))
        attributes[b"tiles"] = (b"tiledesc", sides + bytes([mostly(draw, 0, st.integers(0, 18))]))
        attributes[b"type"] = (b"string", draw(st.sampled_from([b"scanlineimage", b"tiledimage", b"deepscanline"])))
        attributes[b"chunkCount"] = (b"int", mostly(draw, struct.pack("<I", 2), word))
    if draw(st.booleans()):
        attributes[b"name"] = (b"string", b"x" * draw(st.integers(0, 40)))
    head = struct.pack("<II", 20000630, 2 | flags)
    for name, (kind, value) in attributes.items():
        size = draw(word) if draw(st.integers(0, 40)) == 40 else struct.pack("<I", len(value))
        head += name + b"\0" + kind + b"\0" + size + value
    head += b"\0" + (b"\0" if flags == 0x1000 else b"")
    lines = [struct.pack("<II", y, 48) + struct.pack("<12f", *range(12)) for y in range(2)]
    table = struct.pack("<QQ", len(head) + 16, len(head) + 16 + len(lines[0]))
    return head + mostly(draw, table + b"".join(lines), BODIES)


def _read_mesh(path: Path) -> None:
    for read in (load_face_sources, load_mesh):
        read(path)


FORMATS: dict[str, tuple[Callable[[], st.SearchStrategy[bytes]], Callable[[Path], object]]] = {
    "random.off": (offs, _read_mesh), "random.ply": (plys, _read_mesh), "random.obj": (objs, _read_mesh),
    "random.gltf": (gltfs, _read_mesh), "random.hdr": (hdrs, PanoramaSky.load), "random.exr": (exrs, PanoramaSky.load),
}  # fmt: skip


def work(count: int, folder: Path) -> dict[str, dict[str, int]]:
    """Read so many random files of each format; raises for the first that is neither used nor refused in one line."""
    tally = {name: {"used": 0, "refused": 0} for name in FORMATS}
    for name in FORMATS:  # what is imported and compiled on first use is no file's
        _read(name, b"", folder)
    fuzzing.bound_memory(MEMORY_BYTES)
    few = settings(
        max_examples=count, derandomize=True, database=None, deadline=None, phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )  # fmt: skip
    for name, (contents, _) in FORMATS.items():
        few(_reader(name, contents(), folder, tally[name]))()
    return tally


def _reader(name: str, contents: st.SearchStrategy[bytes], folder: Path, counts: dict[str, int]) -> Any:
    @given(contents)
    def read(content: bytes) -> None:
        signal.alarm(fuzzing.TIME_S)  # its default ends the process, wherever it is
        counts["used" if _read(name, content, folder) else "refused"] += 1
        signal.alarm(0)

    return read


def _read(name: str, content: bytes, folder: Path) -> bool:
    path = folder / name
    path.write_bytes(content)
    (folder / "now.txt").write_text(name, encoding="utf-8")
    try:
        FORMATS[name][1](path)
    except InputError as error:
        fuzzing.check_refusal(error)
        return False
    return True


if __name__ == "__main__":
    print(json.dumps(work(int(sys.argv[1]), Path.cwd())))
