"""`atra compile`: compile kernels in advance, for a container image or, by `.ci/kernels`, to be shipped."""

from __future__ import annotations

import os
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import trimesh

import atra
from atra.command.doctor import say_kernels
from atra.command.picture import compile_picture
from atra.compat.trimesh import RayMeshIntersector
from atra.compiled.instruction_sets import chosen_instruction_set, native_lanes
from atra.compiled.store import QUIET_VARIABLE, cache_folder
from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.geometry.view import View
from atra.raster.clusters import CLUSTER
from atra.rays.all_hits.cells import FEWEST_POINTS


def add_compile(parser: ArgumentParser) -> None:
    """Declare its arguments."""
    parser.add_argument("--all", action="store_true", help="every method, and pictures, not only the rasteriser")


def run_compile(arguments: Namespace) -> int:
    """Compile in as many processes as there are cores, and say where the kernels are."""
    chosen_instruction_set()  # refuses an unknown one before a process starts
    if cache_folder() is None:
        raise InputError("compiled kernels can be kept nowhere here; name a folder with NUMBA_CACHE_DIR")
    os.environ[QUIET_VARIABLE] = "1"
    names = [name for name in JOBS if arguments.all or name.startswith("raster")]
    # Processes that are spawned, not forked: a fork would have this process's threads and no kernel of its own.
    with ProcessPoolExecutor(min(resolve_threads(None), len(names)), get_context("spawn")) as pool:
        running = {pool.submit(_run, name): name for name in names}
        for count, done in enumerate(as_completed(running), 1):
            done.result()
            print(f"{count} of {len(names)}: {running[done]}", file=sys.stderr)
    print(say_kernels())
    return 0


def _run(name: str) -> None:
    JOBS[name]()


def _box(times: int = 1) -> atra.Mesh:
    """A closed box, every triangle of which is there so many times."""
    corners = np.array(list(product((-1.0, 1.0), repeat=3)), np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return atra.Mesh(corners, np.array(faces * times, np.uint32))


_MESH = _box(1 + CLUSTER // 12)
"""Ties are settled, and there are more triangles than a cluster holds, so that they are sorted, too."""

_SEEN_FROM: Any = {"eye": (0.3, 0.4, 3.0), "target": (0.0, 0.0, 0.0), "width": 64}
_CAMERAS: dict[str, View] = {
    "pinhole": atra.Camera(**_SEEN_FROM, height=48),
    "orthographic": atra.OrthographicCamera(**_SEEN_FROM, view_height=3.0, height=48),
    "lens": atra.LensCamera.panorama(**_SEEN_FROM),
}

_REDUCTIONS: dict[str, Any] = {
    "count": atra.Count,
    "layers": lambda: atra.Layers(4),
    "thickness": atra.Thickness,
    "transmittance": lambda: atra.Transmittance(np.full(12, 0.5, np.float32)),
}

_TRACERS: dict[str, Callable[[atra.Mesh, View], atra.Tracer]] = {
    "raster": atra.RasterTracer,
    "single rays": partial(atra.PixelTracer, packet_width=1),
    "packets": atra.PixelTracer,
    "aligned": partial(atra.AlignedTracer, split=(4, 1)),
    "aligned instances": partial(atra.AlignedTracer, split=(4, 1), geometry="instanced", culling=False),
    "visible-first": partial(atra.VisibleFirstTracer, split=(4, 1)),
}
_PINHOLE_ONLY, _ALL_HITS = ("visible-first",), ("raster", "packets", "aligned")
_WITH_LENS = ("raster", "single rays", "packets")


def _trace(tracer: str, view: str, what: str | None = None) -> None:
    with _TRACERS[tracer](_MESH if what is None else _box(), _CAMERAS[view]) as built:
        if what is None:
            built.trace()
        else:
            built.gather(_REDUCTIONS[what]())


def _shoot_rays() -> None:
    """Batches at a mesh so large that rays are sorted, single and in packets."""
    random, count = np.random.default_rng(0), 1 << 17
    corners = random.uniform(0.0, 260.0, (count, 1, 3)) + random.normal(size=(count, 3, 3))
    mesh = atra.Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count).reshape(-1, 3))
    origins = random.uniform(0.0, 260.0, (1 << 15, 3)).astype(np.float32)
    directions = random.normal(size=origins.shape).astype(np.float32)
    for options in ({}, *({"packet_width": width, "precision": "fast"} for width in {1, native_lanes()})):
        with atra.RayScene(mesh, **options) as scene:  # type: ignore[arg-type]
            scene.intersect(origins, directions)
            scene.occluded(origins, directions)


def _find_all_hits() -> None:
    with atra.RayScene(_box()) as scene:
        points = np.zeros((4, 3), np.float32)
        scene.all_hits(points, points + 1)
        scene.count(points, points + 1)
        scene.contains(points)
        scene.contains(np.zeros((FEWEST_POINTS, 3)))
    mesh = trimesh.creation.box()
    RayMeshIntersector(mesh).intersects_location(points, points + 1)


def _compare() -> None:
    camera = _CAMERAS["pinhole"]
    with atra.RasterTracer(_MESH, camera) as one, atra.PixelTracer(_MESH, camera) as other:
        atra.compare(one.trace(), other.trace())


def _place_hits() -> None:
    with atra.RasterTracer(_MESH, _CAMERAS["pinhole"]) as tracer:
        hits = tracer.trace()
    _ = hits.u, hits.points, hits.normals


def _read_files() -> None:
    """A mesh of text with a concave polygon, and one of bytes with faces of several sizes."""
    text = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 1 0\nv 0 2 0\nf 1 2 3 4 5\n"
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
    faces = "".join(chr(size) + chr(0) * 4 * size for size in (3, 4))
    with TemporaryDirectory() as folder:
        for name, content in (("mesh.obj", text), ("mesh.ply", head + chr(0) * 60 + faces)):
            path = Path(folder, name)
            path.write_bytes(content.encode())
            atra.load_mesh(path)


def _jobs() -> Iterator[tuple[str, Callable[[], None]]]:
    views = ("pinhole", "orthographic")
    for view, tracer in product(views, _TRACERS):
        if view == "pinhole" or tracer not in _PINHOLE_ONLY:
            yield f"{tracer}, {view}", partial(_trace, tracer, view)
    for tracer in _WITH_LENS:
        yield f"{tracer}, lens", partial(_trace, tracer, "lens")
    for what, view, tracer in product(_REDUCTIONS, views, _ALL_HITS):
        yield f"{tracer}, {view}, {what}", partial(_trace, tracer, view, what)
    yield "rays", _shoot_rays
    yield "all hits of rays", _find_all_hits
    yield "comparing", _compare
    yield "mesh files", _read_files
    yield "pictures in full light", partial(compile_picture, _box(), _CAMERAS["pinhole"])
    yield "raster, places and normals of hits", _place_hits


JOBS = dict(_jobs())
"""What is compiled: small calls of the library by name, which compile what they use."""
