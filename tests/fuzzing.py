"""Mutated files for every reader, worked through in a process whose memory and time are bounded.

`python -m tests.fuzzing COUNT` works through COUNT inputs in the working folder, which should be empty, and prints what
became of them as JSON. `python -m tests.fuzzing COUNT KIND` takes them all of one kind. An input is a kind of file and
a seed: `python -m tests.fuzzing 1 KIND SEED` reads one again and shows the traceback of what went wrong.
"""

from __future__ import annotations

import io
import json
import random
import re
import resource
import signal
import struct
import sys
import tempfile
import traceback
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh

from atra.errors import InputError
from atra.files.cameras.bop import read_bop
from atra.files.cameras.calibration_files import read_calibration
from atra.files.meshes.loading import load_face_sources, load_mesh
from atra.files.saving import encode_exr
from atra.geometry.camera import Camera
from atra.light import PanoramaSky
from experiments.harness.records import Record, read_record, write_record
from experiments.results.table import Tables, make_table, read_table
from scenes.directory import CAMERAS_FILE, load_scene_from_directory
from scenes.scene import CAMERA_FIELDS
from tests.files.samples import CORNERS, FORMS, QUADS, TRIANGLES, gltf
from tests.files.test_calibrations import KALIBR, MESSAGE, OPEN3D, OPENCV, ROS, XML
from tests.meshes import strips_ply
from tests.report_samples import small_table, write_tables

MEMORY_BYTES = 512 * 2**20
"""What reading one input may add to the process; the largest input has 2 MB."""

TIME_S = 20
"""What reading one input may take."""

_LARGEST_INPUT_BYTES = 2_000_000

NEVER_USED = {"mesh.xyz"}
"""A point cloud: read, and refused for having no triangles."""


@dataclass(frozen=True)
class Kind:
    """A kind of file: healthy samples of it, and how it is read from `path`.

    read: returns whether the file was used; raises InputError where it is refused, AssertionError where what it gave
    is not what it promises.
    """

    path: str
    samples: tuple[bytes, ...]
    read: Callable[[Path], bool]


def _read_mesh(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mesh = load_mesh(path)
    assert len(load_face_sources(path).face) == mesh.triangle_count
    assert mesh.vertices.ndim == mesh.faces.ndim == 2
    assert np.isfinite(mesh.vertices).all()
    assert mesh.faces.max() < len(mesh.vertices)
    assert mesh.name.isprintable()
    return True


def _read_model(path):
    """The XML of a 3MF, in an archive without damage."""
    archive = path.with_suffix(".3mf")
    with zipfile.ZipFile(archive, "w") as members:
        members.write(path, "3D/3dmodel.model")
    return _read_mesh(archive)


def _three_mf(model):
    """An archive that is the same whenever it is made: the member has no date of its own."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as members:
        members.writestr(zipfile.ZipInfo("3D/3dmodel.model"), model)
    return archive.getvalue()


def _read_record(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        record = read_record(path.parent, path.stem)
    assert record is not None or path.with_name(path.name + ".corrupt").exists()
    return record is not None


def _read_table(path):
    table = read_table(path)
    assert table is not None
    assert list(table.columns) == list(make_table([]).columns)
    return True


def _read_cameras(path):
    (path.parent / "box.ply").write_bytes(_mesh_samples()["mesh.ply"][0])
    fields = load_scene_from_directory("box", path.parent).camera
    assert tuple(fields) == CAMERA_FIELDS
    Camera(**fields, width=8, height=8)
    return True


def _read_sky(path):
    texels = PanoramaSky.load(path).texels
    assert texels.ndim == 3
    assert (texels >= 0).all()
    assert np.isfinite(texels).all()
    return True


def _read_calibration(path):
    (camera,) = read_calibration(path, (8, 8)).values()
    assert np.isfinite(camera.rays(np.array([4]), np.array([4]))[0]).all()
    return True


def _read_bop(path):
    for camera in read_bop(path, (8, 8)).values():
        assert np.isfinite(camera.axes).all()
    return True


def _sky_samples():
    texels = np.random.default_rng(1).random((6, 12, 3)).astype(np.float32)
    texels[3:] = 0.5
    whole, half = ({name: texels[..., k].astype(kind) for k, name in enumerate("RGB")} for kind in ("f4", "f2"))
    head = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n"
    row = bytes([2, 2, 0, 12]) + bytes([140, 128, 12, *range(12), 3, 1, 2, 3, 137, 9, 140, 129])
    return {
        "sky.exr": (encode_exr(whole), encode_exr(half)),
        "sky.hdr": (head % (6, 12) + 6 * row, head % (2, 3) + bytes(range(100, 124))),
    }


def _mesh_samples():
    meshes = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=1)
    scene = trimesh.Scene(meshes[:1])
    scene.add_geometry(meshes[1], transform=trimesh.transformations.translation_matrix((3, 0, 0)))
    shapes = (CORNERS, TRIANGLES), (CORNERS, QUADS), _MIXED
    written = {
        f"mesh.{form}" if "." not in form else form: tuple(_as_bytes(write(*shape)) for shape in shapes)
        for form, write in FORMS.items()
    }
    placed = gltf([{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0], "scale": [-1, 2, 1]}])
    return written | {
        "mixed.ply": (written["little.ply"][2], written["big.ply"][2]),
        "strips.ply": (strips_ply([(0, 1, 2, 4, -1, 1, 3, 2)]), strips_ply([(0, 1, 2, 4), (1, 3, 2)])),
        "mesh.obj": (*written["mesh.obj"], _POLYGONS),
        "text.stl": tuple(_as_bytes(mesh.export(file_type="stl_ascii")) for mesh in meshes),
        "mesh.stl": tuple(mesh.export(file_type="stl") for mesh in meshes),
        "mesh.gltf": (json.dumps(json.loads(placed), indent=1).encode(),),
        "mesh.glb": (scene.export(file_type="glb"), meshes[0].export(file_type="glb")),
        "mesh.3mf": (_three_mf(_MODEL),),
        "mesh.xyz": (b"0 0 0\n1 0 0\n1 1 0\n",),
    }


def _as_bytes(content):
    return content if isinstance(content, bytes) else content.encode()


_MIXED = [(0, 0, 0), (4, 0, 0), (4, 4, 0), (1, 1, 0), (0, 4, 0)], [(0, 1, 2), (0, 2, 3, 4), (0, 1, 2, 3, 4)]
_POLYGONS = (
    b"mtllib none.mtl\nv 0 0 0\nv\t4 0 0 # right\nv 4 4 0\nv 1 1.5e0 0\nv 0 4 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n"
    b"f -5 -4 -3 -2 -1\nusemtl b\nf 1//1 3//1 \\\n 4//1 5//1\nl 1 2\n"
)
_MODEL = (
    b'<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
    b'<resources><object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    b'<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>'
    b'<object id="2"><components><component objectid="1" transform="-1 0 0 0 1 0 0 0 1 5 0 0"/></components></object>'
    b'</resources><build><item objectid="1"/><item objectid="2"/></build></model>'
)


def _record_sample(folder):
    record = Record(
        "mutated", "ok", None, {"scene": "box", "split_x": 4, "eye": [0.0, 1.0, 2.0]}, {"cpu": "a cpu", "load": [0.5]},
        {"own": [2.0]}, {"own": [1.0, 1.5], "rtcIntersect1": [3.0, 3.5]}, {"rss_bytes": 123},
    )  # fmt: skip
    return write_record(folder, record).read_bytes()


def kinds():
    """Every kind of file that is read, by name."""
    found = {path: Kind(path, samples, _read_mesh) for path, samples in _mesh_samples().items()}
    found["model of 3mf"] = Kind("mesh.model", (_MODEL,), _read_model)
    # The file's name is its author's, too.
    named = "\x1b[31mred\N{RIGHT-TO-LEFT OVERRIDE}\a.off"
    found["hostile name"] = replace(found["mesh.off"], path=named)
    with tempfile.TemporaryDirectory() as folder:
        write_tables(Path(folder), Tables(small_table(), small_table()))
        table = (Path(folder) / "table.parquet").read_bytes()
        record = _record_sample(Path(folder))
    camera = {"eye": [0, 0, 5], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_degrees": 40.5}
    cameras = json.dumps({"box": camera, "other": {"eye": [1, 2, 3], "target": [0.5, 0, 0]}}).encode()
    bop = {"cam_K": [500, 0, 320, 0, 500, 240, 0, 0, 1], "depth_scale": 1.0}
    posed = bop | {"cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_w2c": [1, 2, 3.5]}
    calibrations = {
        "opencv.yml": (OPENCV.encode(),), "camera_info.yaml": (ROS.format("plumb_bob").encode(),),
        "camchain.yaml": (KALIBR.format("cam0", "equidistant").encode(),), "calibration.xml": (XML.encode(),),
        "calibration.json": (json.dumps(MESSAGE).encode(), json.dumps(OPEN3D).encode()),
    }  # fmt: skip
    found |= {path: Kind(path, samples, _read_calibration) for path, samples in calibrations.items()}
    found["bop"] = Kind("scene_camera.json", (json.dumps({"0": bop, "1": posed}).encode(),), _read_bop)
    found |= {path: Kind(path, samples, _read_sky) for path, samples in _sky_samples().items()}
    found |= {
        "record": Kind("mutated.json", (record,), _read_record),
        "table": Kind("table.parquet", (table,), _read_table),
        "cameras": Kind(CAMERAS_FILE, (cameras,), _read_cameras),
    }
    return found


_NUMBERS = (
    b"-1", b"0", b"-0.0", b"1", b"2.5", b"7", b"255", b"65536", b"4294967295", b"4294967296", b"999999999999",
    b"18446744073709551616", b"-9223372036854775809", b"1e5", b"1e12", b"1e39", b"1e308", b"1e400", b"nan", b"inf",
    b"-inf", b"NaN", b"Infinity", b"0x10", b"1_0", b"1,5", b"9" * 5000, b"", b"null", b"true", b'"text"', b"[]", b"{}",
)  # fmt: skip
_WORDS = tuple(struct.pack("<I", word) for word in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7FC00000, 0x7F800000))
_INTRUDERS = (
    b"\xff\xfe\x80", b"\0", b"\0" * 64, b"\x1b[31m\x1b]0;title\x07", b"\xe2\x80\xae", b"\r", b"\n\n", b"\t \t", b"#",
    b"[" * 100_000, b'{"a":' * 50_000, b"(" * 10_000, b"../../", b"/dev/zero", b"end_header\n", b"element vertex 99\n",
    b"property list uchar int x\n", b"<script>", b"-" * 3000, b" " * 200_000,
)  # fmt: skip


def mutate(content, other, choose):
    """One to four changes to `content`; `other` is a healthy file of the same kind to take pieces from."""
    for _ in range(choose.choice((1, 1, 1, 1, 2, 4))):
        content = choose.choice(_CHANGES)(content, other, choose)[:_LARGEST_INPUT_BYTES]
    return content


def _place(content, choose):
    # Headers are short but decide most.
    return choose.randrange(min(len(content), choose.choice((200, len(content)))) + 1) if content else 0


def _piece(content, choose):
    start = _place(content, choose)
    return start, start + choose.choice((1, 2, 4, 16, 100, 1000))


def _flip(content, _, choose):
    changed = bytearray(content)
    for _i in range(choose.choice((1, 1, 3, 20))):
        if changed:
            changed[min(_place(content, choose), len(changed) - 1)] ^= 1 << choose.randrange(8)
    return bytes(changed)


def _truncate(content, _, choose):
    return content[: choose.randrange(len(content) + 1)]


def _replace(content, other, choose):
    """A piece goes or is repeated, another file's or an intruder comes before it, or a number takes its place."""
    start, end = _piece(content, choose)
    foreign, piece = other[slice(*_piece(other, choose))], content[start:end]
    repeated = piece * choose.choice((2, 3, 1001))
    others = (b"", repeated, foreign + piece, choose.choice(_INTRUDERS) + piece, choose.choice(_WORDS))
    return content[:start] + choose.choice(others) + content[end:]


def _renumber(content, _, choose):
    found = [match.span() for match in re.finditer(rb"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?", content[:200_000])]
    if not found:
        return content
    start, end = choose.choice(found[:20] if choose.random() < 0.5 else found)
    return content[:start] + choose.choice(_NUMBERS) + content[end:]


def _reword(content, _, choose):
    words = [match.span() for match in re.finditer(rb"[A-Za-z_]{2,}", content[:200_000])]
    if len(words) < 2:
        return content
    (start, end), (first, last) = choose.sample(words, 2)
    return content[:start] + content[first:last] + content[end:]


_CHANGES = (_flip, _truncate, *[_replace] * 5, _renumber, _renumber, _reword)


def make_input(kind, name, seed):
    """The mutated file of that seed; the same every time."""
    choose = random.Random(f"{name} {seed}")
    return mutate(choose.choice(kind.samples), choose.choice(kind.samples), choose)


def work(count, folder, kind=None, only=None):
    """Work through `count` inputs, all kinds in turn, or those of one kind, or the one with the seed `only`.

    folder: empty. `now.txt` in it names the input being read, for finding the cause if this process dies.
    Returns which kinds were used unchanged, for each kind how many inputs were used and refused, and what went wrong,
    by input.
    """
    every = kinds()
    # Before the memory is bounded: imports and tables made on first use are not the inputs'.
    healthy = [name for name, kind in every.items() if _try(kind, kind.samples[0], folder)]
    tally = {name: {"used": 0, "refused": 0} for name in every}
    wrong = []
    names = list(every) if kind is None else [kind]
    todo = [(names[number % len(names)], number // len(names)) for number in range(count)]
    todo = todo if only is None else [(kind, only)]
    bound_memory(MEMORY_BYTES)
    for name, seed in todo:
        (folder / "now.txt").write_text(f"{name} {seed}")
        signal.alarm(TIME_S)  # its default ends the process, wherever it is
        try:
            used = _try(every[name], make_input(every[name], name, seed), folder)
            tally[name]["used" if used else "refused"] += 1
        except Exception as error:
            wrong.append(f"{name} {seed}: {type(error).__name__}: {str(error)[:300]}")
            if only is not None:
                traceback.print_exception(error)
        signal.alarm(0)
    return {"healthy": healthy, "tally": tally, "wrong": wrong}


def _try(kind, content, folder):
    """Whether the input was used; raises for whatever must not happen."""
    before = _names(folder)
    with tempfile.TemporaryDirectory(dir=folder) as inside:
        path = Path(inside) / kind.path
        path.write_bytes(content)
        try:
            used = kind.read(path)
        except InputError as error:
            check_refusal(error)
            used = False
        assert _names(folder) - {Path(inside).name} == before, "something was written outside the folder"
    return used


def check_refusal(error):
    """A refusal is one printable line, and came before the memory ran out."""
    assert str(error).isprintable(), f"raw control characters in {str(error)!r}"
    assert len(str(error)) <= 2000, f"a message of {len(str(error))} characters"
    cause = error
    while cause is not None:
        assert not isinstance(cause, MemoryError), f"memory was asked for in vain: {error}"
        cause = cause.__cause__ or cause.__context__


def _names(folder):
    return {path.name for path in folder.iterdir()}


def bound_memory(more_bytes):
    """Let this process grow by so much and no more."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    limit = pages * resource.getpagesize() + more_bytes
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))


if __name__ == "__main__":
    asked = dict(zip(("kind", "only"), (*sys.argv[2:3], *map(int, sys.argv[3:4])), strict=False))
    print(json.dumps(work(int(sys.argv[1]), Path.cwd(), **asked)))
