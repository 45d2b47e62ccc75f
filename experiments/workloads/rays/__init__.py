"""Workload `rays`: questions that libraries answer of rays of no camera, asked of the point's method and of
`atra.RayScene` in the same rounds, and how many hits each loses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.rays.scene import RayScene
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point, make_own
from experiments.harness.records import Record
from experiments.methods.peers.peer import QUESTIONS, Asked, PreparedPeer
from experiments.workloads.baselines import LIBRARY, OWN, say_library
from experiments.workloads.rays.judging import judged, sample_of, truth_of
from experiments.workloads.rounds import load_mesh, race
from experiments.workloads.typed import Times, Worst, workload

Rays = tuple[NDArray[np.float32], NDArray[np.float32]]
"""Origins and directions, (N, 3) each."""

BATCHES = ("coherent", "incoherent")
"""coherent: of the point's camera, a ray for each pixel. incoherent: as many, from anywhere in the mesh's
box, every way as likely."""


@dataclass(frozen=True)
class RaysOptions(Settings):
    """What is asked of which rays."""

    question: str = option("closest", "question: closest, any, count, all, or contains", choices=QUESTIONS)
    ray_batch: str = option("coherent", "coherent or incoherent rays; contains asks of random points", choices=BATCHES)
    judged_rays: int = whole(1000, "rays, or points, whose answers are judged by a test with every triangle", 0)


TIMES = Times({
    "answer_time{}_s": OWN,
    "answer_library_time{}_s": LIBRARY,
    "answer_gain{}": (OWN, LIBRARY),
}, judged=OWN)  # fmt: skip


class Judged(TypedDict):
    """How many hits each loses, and finds twice or in vain, of rays and points tested with every triangle."""

    asked: int
    judged: int
    judged_hits: int
    lost: Worst
    extra: Worst
    library_lost: Worst
    library_extra: Worst


def _headline(record: Record) -> str:
    lost = "lost {library_lost} against {lost} of {judged_hits}".format(**record.results)
    return f"{say_library(record)}; {lost}"


def _problem(point: Point) -> str | None:
    if not point.method.is_ours:
        return None
    from experiments.methods import METHODS  # all of them, which a worker has no use for

    others = ", ".join(method.name for method in METHODS if not method.is_ours)
    return f"method={point.method.name}, expected a tracer of others beside `atra.RayScene`: {others}"


RAYS = workload(
    "rays", __name__, _headline, TIMES, Judged, options=RaysOptions, problem=_problem,
    rays=lambda row: f"{row.get('ray_batch', 'own')}, {row.get('question', 'closest')}",
    told=("answer_time_s", "answer_library_time_s", "answer_gain", "judged_hits", "lost", "library_lost"),
)  # fmt: skip


def measure(point: Point) -> Measured:
    """Ask once, which builds and compiles, judge these answers, and then take the time. Raises InputError and
    MemoryBudgetError as the tracers do, and InputError for a question that the method has no answer to."""
    asked, mesh = point.workload_options, load_mesh(point)
    given = _given(asked, mesh, point.camera)
    with ExitStack() as stack:
        calls = _calls(point, mesh, asked.question, given, stack)
        answers = {name: call() for name, call in calls.items()}
        sample = sample_of(len(given[0]), asked.judged_rays)
        some = tuple(array[sample] for array in given)
        truth = truth_of(asked.question, mesh, *some)
        (lost, extra), (library_lost, library_extra) = (
            judged(asked.question, answers[name], sample, truth, mesh, some) for name in (OWN, LIBRARY)
        )
        results = Judged(
            asked=len(given[0]), judged=len(sample), judged_hits=truth.hits,
            lost=lost, extra=extra, library_lost=library_lost, library_extra=library_extra,
        )  # fmt: skip
        return race(point, calls, results={**results})


def _given(asked: RaysOptions, mesh: Mesh, camera: Camera) -> tuple[NDArray[np.float32], ...]:
    """Origins and directions, or points alone: (N, 3) float32 each."""
    count = camera.width * camera.height
    if asked.question == "contains":
        return random_rays(mesh, count)[:1]
    return camera_rays(camera) if asked.ray_batch == "coherent" else random_rays(mesh, count)


def camera_rays(camera: Camera) -> Rays:
    """Through the centres of all pixels, row after row."""
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(x, y, (0.5, 0.5))
    axes = np.asarray(camera.axes)
    return (origins @ axes + camera.eye).astype(np.float32), np.ascontiguousarray(directions @ axes, np.float32)


def random_rays(mesh: Mesh, count: int) -> Rays:
    """From anywhere in the mesh's box, every way as likely."""
    random = np.random.default_rng(1)
    low, high = mesh.bounds
    return random.uniform(low, high, (count, 3)).astype(np.float32), random.normal(size=(count, 3)).astype(np.float32)


def _calls(
    point: Point, mesh: Mesh, question: str, given: tuple[NDArray[np.float32], ...], stack: ExitStack
) -> Mapping[str, Callable[[], Asked]]:
    own = getattr(stack.enter_context(make_own(point, mesh)), "prepared", None)
    answer = own.scene.answers().get(question) if isinstance(own, PreparedPeer) else None
    if answer is None:
        raise InputError(f"method={point.method.name} has no answer to workload.question={question}")
    scene = stack.enter_context(RayScene(mesh, threads=point.tracing.threads))
    return {OWN: lambda: answer(*given), LIBRARY: lambda: _ANSWERS[question](scene, *given)}


def _all_hits(scene: RayScene, origins: NDArray[Any], directions: NDArray[Any]) -> Asked:
    hits = scene.all_hits(origins, directions)
    return hits.ray_ids, hits.prim_id


_ANSWERS: Mapping[str, Callable[..., Asked]] = {
    "closest": lambda scene, *rays: scene.intersect(*rays).prim_id,
    "any": lambda scene, *rays: scene.occluded(*rays),
    "count": lambda scene, *rays: scene.count(*rays),
    "all": _all_hits,
    "contains": lambda scene, points: scene.contains(points),
}
