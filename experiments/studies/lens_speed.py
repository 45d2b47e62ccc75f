"""Milliseconds of frames through a lens, and of frames of the BOP toolkit's renderer; adds rows to a table.

    python -m experiments.studies lens_speed TABLE.csv runs=30 threads=1

Lenses: packets and the rasteriser, each with the lens and without. BOP: 20 objects of 10,000 triangles drawn one by one
at 640 x 480, by `atra.compat.bop.Renderer` and by OpenGL on llvmpipe, which needs moderngl and EGL. Methods take turns
in every run, after two that do not count.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import atra
from atra.compat.bop import Renderer
from atra.geometry.lenses.models import Lens
from experiments.methods.peers.llvmpipe import opengl_context
from experiments.studies.processes import Row, Turn, add_rows, in_processes
from scenes.directory import PAPER_SCENES
from scenes.loading import SceneSource, load_scene

LENSES: dict[str, tuple[Lens, float]] = {
    "barrel": (atra.OpenCVLens(k1=-0.25, k2=0.05, p1=0.002, p2=-0.001), 0.9),
    "fisheye": (atra.FisheyeLens(k1=0.05, k2=-0.01), 0.5),
}
"""Lenses, and focal lengths as shares of the image's width."""

_UNCOUNTED = 2

_OBJECTS, _TRIANGLES, _BOP_SIZE, _FOCAL = 20, 10_000, (640, 480), 570.0

_VERTEX_SHADER = """
#version 450
in vec3 position;
uniform mat4 to_clip;
out float depth;
void main() {
    gl_Position = to_clip * vec4(position, 1.0);
    depth = gl_Position.w;
}
"""

_FRAGMENT_SHADER = """
#version 450
in float depth;
layout(location = 0) out float seen;
void main() { seen = depth; }
"""

Frames = Mapping[str, Callable[[], Any]]
"""What draws a frame, by the method's name."""


def timed(what: str, lens: str, source: str, size: int, threads: int, runs: int) -> list[Row]:
    """Milliseconds of every frame of a scene through a lens, or of "bop". Run in a process of its own."""
    from importlib import import_module

    rows: list[Row] = import_module("experiments.studies.lens_speed").measure(what, lens, source, size, threads, runs)
    return rows


def measure(what: str, lens: str, source: str, size: int, threads: int, runs: int) -> list[Row]:
    """The same in this process."""
    frames = _bop(threads) if what == "bop" else _through_lens(what, source, lens, size, threads)
    rows = list[Row]()
    for run in range(-_UNCOUNTED, runs):
        for method, draw in frames.items():
            start = perf_counter()
            draw()
            taken_ms = round(1e3 * (perf_counter() - start), 3)
            if run >= 0:
                rows.append({"method": method, "run": run, "ms": taken_ms})
    return rows


def study(
    table: str, *, runs: int = 30, threads: int = 1, size: int = 1024, source: str = "directory",
    scenes: tuple[str, ...] = PAPER_SCENES, bop: bool = True,
) -> None:  # fmt: skip
    """Measure images of `size` x `size` pixels of scenes (of a `scenes.loading.SceneSource`) through every lens, and
    frames of the BOP toolkit."""
    asked = [(scene, lens, size, size) for scene in scenes for lens in LENSES] + [("bop", "", *_BOP_SIZE)] * bop
    for what, lens, width, height in asked:
        given = {"what": what, "lens": lens, "source": source, "size": size, "threads": threads, "runs": runs}
        columns = {"frame": what, "lens": lens, "width": width, "height": height, "threads": threads}
        add_rows(Path(table), in_processes(timed, 1, Turn(given, columns)).drop(columns="process"))


def _through_lens(name: str, source: str, lens_name: str, size: int, threads: int) -> Frames:
    """Packets and the rasteriser with a lens, and with the same camera without."""
    scene = load_scene(SceneSource(source), name, None)
    lens, focal = LENSES[lens_name]
    placed, pitch = atra.Camera(**scene.camera), 1.0 / (focal * size)
    sensor = atra.ImagePlane(pitch, pitch, 0.5 * size, 0.5 * size)
    camera = atra.LensCamera(placed.eye, placed.target, placed.up, size, size, lens=lens, sensor=sensor)
    frames = {}
    for method, tracer in (("packets", atra.PixelTracer), ("raster", atra.RasterTracer)):
        for suffix, view in (("", camera), (" without lens", camera.undistorted())):
            made = tracer(scene.mesh, view, threads=threads)
            frames[method + suffix] = _drawing(made)
    return frames


def _drawing(tracer: Any) -> Callable[[], Any]:
    """Draws a frame into the same arrays every time."""
    out = tracer.trace()
    return lambda: tracer.trace(out=out)


def _object(number: int) -> atra.Mesh:
    """A bumpy ball of 10,000 triangles, 50 in radius."""
    rings, segments = 51, 100
    theta, phi = np.meshgrid(
        np.linspace(0.0, np.pi, rings), np.arange(segments) * (2.0 * np.pi / segments), indexing="ij"
    )
    radius = 50.0 + 4.0 * np.sin(5.0 * theta + number) * np.sin(7.0 * phi) * np.sin(theta)
    points = radius * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    row, column = (part.ravel() for part in np.mgrid[0 : rings - 1, 0:segments])
    a, b = row * segments + column, row * segments + (column + 1) % segments
    faces = np.concatenate([np.stack([a, b, a + segments], 1), np.stack([b, b + segments, a + segments], 1)])
    return atra.Mesh(points.reshape(3, -1).T, faces, f"object {number}")


def _bop(threads: int) -> Frames:
    """A frame of the toolkit: the depth image of every object by itself."""
    random, (width, height) = np.random.default_rng(0), _BOP_SIZE
    intrinsics = _FOCAL, _FOCAL, 0.5 * width, 0.5 * height
    meshes = [_object(number) for number in range(_OBJECTS)]
    assert all(mesh.triangle_count == _TRIANGLES for mesh in meshes)
    places = random.uniform((-250.0, -180.0, 600.0), (250.0, 180.0, 1000.0), (_OBJECTS, 3))
    renderer, rival = Renderer(width, height), _llvmpipe(meshes, threads)
    for number, mesh in enumerate(meshes):
        renderer.add_object(number, mesh)

    def ours() -> list[NDArray[np.float32]]:
        return [
            renderer.render_object(number, np.eye(3), place, *intrinsics)["depth"]
            for number, place in enumerate(places)
        ]

    def theirs() -> list[NDArray[np.float32]]:
        return [rival(number, place) for number, place in enumerate(places)]

    _check_alike(ours(), theirs())
    return {"atra": ours, "llvmpipe": theirs}


def _check_alike(ours: list[NDArray[np.float32]], theirs: list[NDArray[np.float32]]) -> None:
    """Raise unless both draw the same objects, but for pixels at their rims."""
    for one, other in zip(ours, theirs, strict=True):
        both = (one > 0.0) & (other > 0.0)
        if both.sum() < 0.95 * max((one > 0.0).sum(), 1) or np.abs(one - other)[both].max() > 2.0:
            raise RuntimeError("the two renderers draw different images")


def _llvmpipe(meshes: list[atra.Mesh], threads: int) -> Callable[[int, NDArray[np.float64]], NDArray[np.float32]]:
    """Draws an object by OpenGL; the OpenCV camera's pixel centres are whole numbers, as for `Renderer`."""
    context, (width, height), near, far = opengl_context(threads), _BOP_SIZE, 10.0, 10_000.0
    context.enable(context.DEPTH_TEST)
    framebuffer = context.framebuffer(
        [context.texture(_BOP_SIZE, 1, dtype="f4")], context.depth_renderbuffer(_BOP_SIZE)
    )
    program = context.program(_VERTEX_SHADER, _FRAGMENT_SHADER)
    drawn = [
        context.vertex_array(
            program, [(context.buffer(mesh.vertices.tobytes()), "3f", "position")], context.buffer(mesh.faces)
        )
        for mesh in meshes
    ]
    # Rows from below, as OpenGL counts them, are rows from above here.
    projection = np.array([
        (2.0 * _FOCAL / width, 0.0, 1.0 / width, 0.0),
        (0.0, 2.0 * _FOCAL / height, 1.0 / height, 0.0),
        (0.0, 0.0, (far + near) / (far - near), -2.0 * far * near / (far - near)),
        (0.0, 0.0, 1.0, 0.0),
    ])  # fmt: skip

    def draw(number: int, place: NDArray[np.float64]) -> NDArray[np.float32]:
        moved, depth = np.eye(4), np.empty((height, width), np.float32)
        moved[:3, 3] = place
        program["to_clip"].write(np.ascontiguousarray((projection @ moved).T, np.float32))
        framebuffer.use()
        framebuffer.clear(depth=1.0)
        drawn[number].render()
        framebuffer.read_into(depth, components=1, dtype="f4")
        return depth

    return draw
