"""Workload `views`: a mesh seen by many cameras, all that is built for them included; by the point's method and, in the
same rounds, by the library with default options."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from atra import render_views
from atra.geometry.camera import CalibratedCamera, Camera, LensCamera
from atra.geometry.mesh import Mesh
from experiments.harness.options import Settings, whole
from experiments.harness.point import Measured, Point, make_own
from experiments.workloads.baselines import LIBRARY, OWN, say_library
from experiments.workloads.rounds import load_mesh, race
from experiments.workloads.typed import Least, Times, workload


@dataclass(frozen=True)
class ViewsOptions(Settings):
    """How many cameras."""

    views: int = whole(20, "cameras, each with an eye of its own", 1)


TIMES = Times({"job_time{}_s": OWN, "library_time{}_s": LIBRARY, "library_gain{}": (OWN, LIBRARY)}, judged=OWN)


class Equality(TypedDict):
    """How alike the answers of both are."""

    ids_equal: Least


VIEWS = workload(
    "views", __name__, say_library, TIMES, Equality, options=ViewsOptions,
    told=("job_time_s", "library_time_s", "library_gain{}", "ids_equal"),
)  # fmt: skip


STEP, TURN_DEGREES = 1 / 50, 30.0
"""How far eyes lie from the view's, as a share of the scene's diagonal, and how far they are turned at most."""


def cameras_around(camera: Camera, mesh: Mesh, count: int) -> tuple[CalibratedCamera | LensCamera, ...]:
    """`count` cameras with an eye each, pixels that are not square and a principal point that is not in the middle."""
    diagonal = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    focal = 1 / camera.pixel_pitch
    K = np.array([[1.05 * focal, 0, 0.45 * camera.width], [0, focal, 0.55 * camera.height], [0, 0, 1]])
    right, down, forward = camera.axes
    made = []
    for place in np.arange(count) / count * 2 * pi:
        eye = np.add(camera.eye, STEP * diagonal * (cos(place) * right + sin(place) * forward))
        turn = radians(TURN_DEGREES) * sin(place)
        R = np.stack([cos(turn) * right - sin(turn) * forward, down, sin(turn) * right + cos(turn) * forward])
        made.append(Camera.from_opencv(K, R, -R @ eye, camera.width, camera.height))
    return tuple(made)


Ids = Iterator[NDArray[np.uint32]]


def measure(point: Point) -> Measured:
    """Compare both once, which compiles all that they need, and then time them: each gets a mesh of which nothing is
    known yet, as a file's is. Raises InputError and MemoryBudgetError as the tracers do."""
    mesh, tracing = load_mesh(point), point.tracing
    cameras = cameras_around(point.camera, mesh, point.workload_options.views)

    def own() -> Ids:
        with make_own(point, Mesh(mesh.vertices, mesh.faces), cameras[0]) as tracer:
            yield tracer.trace().prim_id
            for camera in cameras[1:]:
                tracer.look(camera)
                yield tracer.trace().prim_id

    def library() -> Ids:
        fresh = Mesh(mesh.vertices, mesh.faces)
        for _, hits in render_views(fresh, cameras, threads=tracing.threads, ties=tracing.ties):
            yield hits.prim_id

    ids_equal = min(float((ours == theirs).mean()) for ours, theirs in zip(own(), library(), strict=True))
    contestants = {OWN: lambda: deque(own(), maxlen=0), LIBRARY: lambda: deque(library(), maxlen=0)}
    return race(point, contestants, results={"ids_equal": ids_equal})
