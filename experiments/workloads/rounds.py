"""Rounds of a point: every tracer traces once a round, into one image of its own, and a warm-up compiles it before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

import numpy as np

from atra.all_hits.reductions import Reduction
from atra.embree.library import load_library
from atra.errors import InputError
from atra.exact.ties import coplanar_overlaps
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.harness.environment import peak_rss_bytes, reset_peak_rss, rss_bytes
from experiments.harness.point import Measured, Point, make_own
from experiments.harness.rounds import RoundSamples, measure_rounds
from experiments.methods.options import split_of
from experiments.methods.pixel import PixelOptions, make_pixel
from experiments.workloads.baselines import OWN, PACKETS, SINGLE
from experiments.workloads.resources import Prepared, Resources
from scenes.loading import SceneSource, load_scene

BUILDS, BUILDS_BUDGET_S = 5, 2.0
"""How often a timed point plans and builds, within a budget of seconds; a single sample is too noisy."""

MakeTracer = Callable[..., Any]
"""Point, mesh and view -> tracer."""

_FEW = ((0, 1, 2), (0, 2, 3), (2, 1, 0), (4, 5, 6))

_EVERYDAY = Mesh(
    np.array([(-1, -0.9, 0.1), (0.9, -1, -0.2), (0.1, 0.8, 0.3), (1, 0.7, -1)], np.float32),
    np.array([(0, 1, 2), (3, 2, 1)], np.uint32),
)
"""What other people's methods warm up on: no triangle that the eye sees edge on, none twice, as few tracers expect."""


def load_mesh(point: Point) -> Mesh:
    """The mesh of the point's scene. Raises InputError if it changed since the run began."""
    scene = load_scene(SceneSource(point.scene_source), point.scene, point.scene_path, point.subdivided, point.copies)
    if scene.mesh_sha256 != point.mesh_sha256:
        raise InputError(f"scene {point.scene} changed since this run began; start it again")
    return scene.mesh


def make_single(point: Point, mesh: Mesh, view: View, packet_width: int | None = 1) -> Tracer:
    """Rays per pixel with the point's threads, build quality and ties.

    packet_width: 1 is the paper's baseline, None the widest native packets.
    """
    return make_pixel(mesh, view, PixelOptions(packet_width), point.tracing)


def expert_packet_widths() -> tuple[int, ...]:
    """Widths an expert would try: every native one from 8 on, or the widest if all are below."""
    native = load_library().native_packet_widths
    return tuple(width for width in native if width >= 8) or native[-1:]


def build_own(point: Point, stack: ExitStack) -> tuple[Any, dict[str, Any]]:
    """Load the scene and build what the point's workload measures while nothing else is in the process. Returns the
    tracer, and `Resources`; the method's counters join these when the stack closes."""
    rss_start_bytes = rss_bytes()
    mesh = load_mesh(point)
    if point.ties == "lowest":
        coplanar_overlaps(mesh)  # cached with the mesh, so not part of the method's memory
    reset_peak_rss()  # reading a file may take more than tracing it
    rss_mesh_bytes = rss_bytes()
    own = stack.enter_context(point.workload.make(point, mesh))
    resources = Resources(
        packet_width=int(own.packet_width),
        triangles_traced=int(own.triangle_count),
        rss_start_bytes=rss_start_bytes,
        rss_mesh_bytes=rss_mesh_bytes,
        rss_bytes=rss_bytes(),
        peak_rss_bytes=peak_rss_bytes(),
        threads=int(own.threads),
    )
    if own.embree_bytes:  # a peer does not tell
        resources["embree_bytes"] = int(own.embree_bytes)
    results: dict[str, Any] = {**resources}
    counters = [column.name for column in point.method.counters]
    stack.callback(lambda: results.update({name: own.counters[name] for name in counters}))
    return own, results


def warm_up(
    point: Point,
    makers: Iterable[MakeTracer],
    use: Callable[[Any], object] = lambda tracer: tracer.trace(),
    triangles: Sequence[tuple[int, int, int]] = _FEW,
) -> None:
    """Compile every kernel of the point and start Embree's threads, before memory is read or a clock runs.

    makers: of tracers of `shrunk(point)`, the point's own method first. use: what is done with each. triangles: indices
    into the seven vertices here; by default two tie, and one cannot be shown by a copy. Another's method gets two
    triangles without such cases; what it raises has a note of these.
    """
    vertices = np.array(
        [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0.3, 0.3, 2), (0, 0, 2), (0, 0, 1)], np.float32
    )
    mesh, small = Mesh(vertices, np.array(triangles, np.uint32)), shrunk(point)
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, small.width, small.height)
    for number, make in enumerate(makers):
        is_foreign = number == 0 and not point.method.is_ours
        try:
            with make(small, _EVERYDAY if is_foreign else mesh, camera) as tracer:
                use(tracer)
        except Exception as error:
            if is_foreign:
                corners, faces = _EVERYDAY.vertices.tolist(), _EVERYDAY.faces.tolist()
                error.add_note(f"while warming up, before the scene: vertices {corners}, faces {faces}, {camera}")
            raise


def baseline_makers() -> dict[str, MakeTracer]:
    """Makers of single rays, and of packets of every width an expert would try, by the names of their samples."""
    widths = {SINGLE: 1} | {PACKETS[width]: width for width in expert_packet_widths()}
    return {name: partial(make_single, packet_width=width) for name, width in widths.items()}


def own_and_baselines() -> list[MakeTracer]:
    """Makers of the point's own method and of its baselines."""
    return [make_own, *baseline_makers().values()]


def race_baselines(
    point: Point,
    judge: Callable[[dict[str, Any], dict[str, Frames]], Mapping[str, Any]],
    what: Reduction[Any] | None = None,
    triangles: Sequence[tuple[int, int, int]] = _FEW,
) -> Measured:
    """Build the point's own method, read the memory, time it against the baselines round by round, and plan and build
    it again for more samples of these.

    judge: tracers and their frames, by the names of their samples -> what is found by comparing them. what: is gathered
    in place of the nearest hit. triangles: as of `warm_up`. Raises InputError and MemoryBudgetError as the tracers do.
    """
    warm_up(point, own_and_baselines(), lambda tracer: Frames(tracer, what)(), triangles)
    with ExitStack() as stack:
        tracers, results = build_with_baselines(point, stack)
        frames = {name: Frames(tracer, what) for name, tracer in tracers.items()}
        return race(point, frames, lambda: {**judge(tracers, frames), **plan_and_build_again(tracers[OWN])}, results)


def build_with_baselines(point: Point, stack: ExitStack) -> tuple[dict[str, Any], dict[str, Any]]:
    """`build_own`, then the baselines. Returns the tracers by the names of their samples, and the results."""
    own, results = build_own(point, stack)
    tracers = {OWN: own}
    for name, make in baseline_makers().items():
        tracers[name] = stack.enter_context(make(point, own.mesh, own.camera))
    results["baseline_build_time_s"] = float(tracers[SINGLE].build_time_s)
    return tracers, results


def shrunk(point: Point) -> Point:
    """The point with at most two cells along each axis; they keep their size, which decides the kernel."""
    if not point.method.has_cells:
        return point
    columns, rows = split_of(point.options)
    few = replace(point.options, split_x=min(columns, 2), split_y=min(rows, 2))
    width, height = few.split_x * (point.width // columns), few.split_y * (point.height // rows)
    return replace(point, width=width, height=height, options=few)


class Frames:
    """A contestant that traces frame after frame into one image, so that no sample pays for fresh pages.

    what: the reduction of all hits that is gathered in place of the nearest.
    """

    def __init__(self, tracer: Any, what: Reduction[Any] | None = None) -> None:
        self._tracer, self._what = tracer, what
        self._latest: Any = None

    def __call__(self) -> float | None:
        """Make a frame. Returns the seconds it took by the tracer's own word, None = it has none."""
        if self._what is not None:
            self._latest = self._tracer.gather(self._what, out=self._latest)
            return None
        self._latest = self._tracer.trace(out=self._latest)
        return getattr(getattr(self._tracer, "prepared", None), "frame_time_s", None)

    def latest(self) -> Any:
        """The images made last; makes them if none were."""
        if self._latest is None:
            self()
        return self._latest


def race(
    point: Point,
    contestants: Mapping[str, Callable[[], object]],
    compare: Callable[[], Mapping[str, Any]] = dict,
    results: dict[str, Any] | None = None,
) -> Measured:
    """Time contestants in rounds, and then compare their answers.

    contestants: by the names of their samples, what each does in a round. compare: makes further results, once the
    rounds are over. results: what is known before; all that comes is added to it.
    """
    timed, results = timed_rounds(point, contestants), {} if results is None else results
    results.update(compare())
    return measured(results, timed)


def timed_rounds(point: Point, methods: Mapping[str, Callable[[], object]]) -> RoundSamples:
    """As many rounds as the point asks for."""
    return measure_rounds(methods, rounds=point.rounds, warmup=point.warmup, budget_s=point.frame_budget_s)


def plan_and_build_again(own: Any) -> Prepared:
    """Plan and build, and so often again as `BUILDS` and their budget say."""
    plans, builds = [own.plan_time_s], [own.build_time_s]
    while len(builds) < BUILDS and sum(plans) + sum(builds) + plans[0] + builds[0] <= BUILDS_BUDGET_S:
        own.build()
        plans.append(own.plan_time_s)
        builds.append(own.build_time_s)
    return Prepared(
        plan_time_s=median(plans), build_time_s=median(builds), plan_samples_s=plans, build_samples_s=builds
    )


def measured(results: dict[str, Any], timed: RoundSamples) -> Measured:
    """Results and the samples of the rounds in the form of a record. What is added to `results` later, such as counters
    when a stack closes, is in the record, too."""
    results |= {"rounds": timed.rounds} | ({} if timed.occupancy is None else timed.occupancy.shares)
    return Measured(
        results,
        {name: list(values) for name, values in timed.warmup.items()},
        {name: list(values) for name, values in timed.samples.items()},
    )
