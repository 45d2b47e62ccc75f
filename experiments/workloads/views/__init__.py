"""Workload `views`: a mesh seen by many cameras, or a batch of rays, from the first call to the last result; by the
point's method and, in the same rounds, by the library with default options."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from atra import RayScene, render_views
from atra.errors import InputError as InputError
from atra.geometry.camera import CalibratedCamera, Camera, LensCamera
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point, make_own
from experiments.harness.records import Record
from experiments.methods.peers.peer import scene_for_rays
from experiments.workloads.baselines import OWN
from experiments.workloads.batches import camera_rays, random_rays
from experiments.workloads.rounds import load_mesh, race
from experiments.workloads.typed import Least, Times, workload

LIBRARY = "library"
"""Name in the samples of `atra.render_views` or `atra.RayScene.intersect`."""


JOBS = ("views", "camera_rays", "random_rays")
"""views: all images of cameras around the point's, with all that is built for them. camera_rays, random_rays: one
call with as many rays as the image has pixels, of the camera or random in the mesh; building is not counted."""


@dataclass(frozen=True)
class ViewsOptions(Settings):
    """What is asked for."""

    job: str = option("views", "job to do: views, camera_rays or random_rays", choices=JOBS)
    views: int = whole(20, "cameras, where views are asked for", 1)


TIMES = Times({"job_time{}_s": OWN, "library_time{}_s": LIBRARY, "library_gain{}": (OWN, LIBRARY)}, judged=OWN)


class Equality(TypedDict):
    """How alike the answers of both are."""

    ids_equal: Least


def _headline(record: Record) -> str:
    own, library = (np.asarray(record.samples[name]) for name in (OWN, LIBRARY))
    gain = f"{np.median(own / library):.2f}x as fast"
    return f"{np.median(own):.3f} s; the library {np.median(library):.3f} s, {gain}"


def _problem(point: Point) -> str | None:
    job = point.workload_options.job
    if job == "views" or not point.method.is_ours:
        return None
    from experiments.methods import METHODS  # all of them, which a worker has no use for

    others = ", ".join(method.name for method in METHODS if not method.is_ours)
    return f"method={point.method.name} with workload.job={job}, expected a tracer of others beside ours: {others}"


VIEWS = workload("views", __name__, _headline, TIMES, Equality, options=ViewsOptions, problem=_problem)


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
    """Compare both once, which compiles all that they need, and then time them. Raises InputError and
    MemoryBudgetError as the tracers do, and InputError for a tracer that takes no rays."""
    mesh = load_mesh(point)
    with ExitStack() as stack:
        if point.workload_options.job == "views":
            own, library = _of_views(point, mesh)
        else:
            own, library = _of_rays(point, mesh, stack)
        ids_equal = min(float((ours == theirs).mean()) for ours, theirs in zip(own(), library(), strict=True))
        contestants = {OWN: lambda: deque(own(), maxlen=0), LIBRARY: lambda: deque(library(), maxlen=0)}
        return race(point, contestants, results={"ids_equal": ids_equal})


def _of_views(point: Point, mesh: Mesh) -> tuple[Callable[[], Ids], Callable[[], Ids]]:
    """Both get a mesh of which nothing is known yet, as a file's is."""
    cameras: Sequence[View] = cameras_around(point.camera, mesh, point.workload_options.views)

    def own() -> Ids:
        with make_own(point, Mesh(mesh.vertices, mesh.faces), cameras[0]) as tracer:
            yield tracer.trace().prim_id
            for camera in cameras[1:]:
                tracer.look(camera)
                yield tracer.trace().prim_id

    def library() -> Ids:
        tracing = point.tracing
        fresh = Mesh(mesh.vertices, mesh.faces)
        for _, hits in render_views(fresh, cameras, threads=tracing.threads, ties=tracing.ties):
            yield hits.prim_id

    return own, library


def _of_rays(point: Point, mesh: Mesh, stack: ExitStack) -> tuple[Callable[[], Ids], Callable[[], Ids]]:
    """The rays lie in memory, in the form that each takes them in."""
    if point.workload_options.job == "camera_rays":
        origins, directions = camera_rays(point.camera)
    else:
        origins, directions = random_rays(mesh, point.camera.width * point.camera.height)
    own_scene = scene_for_rays(stack.enter_context(make_own(point, mesh)), point.method.name)
    rays = own_scene.make_rays(origins, directions)
    scene = stack.enter_context(RayScene(mesh, threads=point.tracing.threads))

    def own() -> Ids:
        yield own_scene.cast(rays)[1]

    def library() -> Ids:
        yield scene.intersect(origins, directions).prim_id

    return own, library
