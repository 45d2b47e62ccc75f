"""What is measured at a point: frames, builds, memory, pictures, errors. Runs in the point's own process."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial
from math import isfinite
from statistics import median
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.hits import MISS
from atra.judge.compare import Agreement, Verdict, compare
from atra.judge.oracle import Examination, Standing, examine, sample_pixels
from atra.judge.ties import coplanar_overlaps
from atra.tracers import Tracer
from experiments.harness.configuration import PACKET_WIDTHS, Quantity, SceneSource, Ties
from experiments.harness.memory import peak_rss_bytes, reset_peak_rss, rss_bytes
from experiments.harness.point import Offset, Point
from experiments.harness.rounds import RoundSamples, measure_rounds
from experiments.harness.scene_loading import load_scene, mesh_sha256
from experiments.methods.tracing import expert_packet_widths, make_pixel_tracer
from experiments.workloads.multiframe.frame_tracing import (
    SEPARATE,
    Images,
    compare_images,
    make_for_each_frame,
    make_own_tracer,
    separate_methods,
)

OWN, SINGLE = "own", "rtcIntersect1"
"""Names in the samples of a time: the point's own method, the paper's baseline."""

PACKETS = {width: f"packets_{width}" for width in PACKET_WIDTHS if width > 1}
"""Names there of packets per pixel by their width; the fastest of those measured are the expert's baseline."""

PLAN, BUILD, BASELINE_BUILD = "plan", "build", "baseline_build"
"""Names in the samples of a build: the point's plan, its BVH build, the BVH build of the plain mesh."""

BUILDS, BUILDS_BUDGET_S = 5, 2.0
"""How often a timed point plans and builds, unless that takes longer than the budget: the price of a method hangs on
these times, and one sample is easily an accident."""

_AGREEMENT = ("equal", "tied", "edge", "wrong")


@dataclass(frozen=True)
class Measured:
    """What came of a point; the fields are those of `experiments.harness.records.Record`."""

    results: dict[str, Any]
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)


def measure_point(point: Point) -> Measured:
    """Measure the point's quantity. Raises InputError and MemoryBudgetError as the tracers do."""
    return _MEASURES[Quantity(point.quantity)](point)


def _measure_time(point: Point) -> Measured:
    """Build the point's own method, read the memory, time it against the baselines round by round, and plan and build
    it again for more samples of these."""
    _warm_up(point)
    with ExitStack() as stack:
        own, results = _build_own(point, stack)
        single = stack.enter_context(make_for_each_frame(own, partial(make_pixel_tracer, point, packet_width=1)))
        packets = {
            PACKETS[width]: stack.enter_context(
                make_for_each_frame(own, partial(make_pixel_tracer, point, packet_width=width))
            )
            for width in expert_packet_widths()
        }
        separate = {
            name: stack.enter_context(make_for_each_frame(own, make)) for name, make in separate_methods(point).items()
        }
        results["baseline_build_time_s"] = float(single.build_time_s)
        if SEPARATE in separate:
            results["separate_embree_bytes"] = int(separate[SEPARATE].embree_bytes)
        methods: dict[str, Tracer] = {OWN: own, SINGLE: single, **packets, **separate}
        images = {name: _Frames(tracer) for name, tracer in methods.items()}
        timed = _rounds(point, {name: one.trace for name, one in images.items()})
        results["packets_width"] = fastest_packets(timed.samples)
        agreements = compare_images(images[OWN].latest(), images[SINGLE].latest())
        results |= _counts(agreements) | _depth_errors(agreements)
        results |= _plan_and_build_again(own)
    return _measured(results, timed)


def fastest_packets(samples: Mapping[str, Sequence[float]]) -> int:
    """The width of the packets with the shortest median among the samples of a time."""
    widths = [width for width, name in PACKETS.items() if name in samples]
    return min(widths, key=lambda width: median(samples[PACKETS[width]]))


def _plan_and_build_again(own: Tracer) -> dict[str, Any]:
    """Medians and samples of plan and build, the first sample of each the one that has been."""
    plans, builds = [own.plan_time_s], [own.build_time_s]
    while len(builds) < BUILDS and sum(plans) + sum(builds) + plans[0] + builds[0] <= BUILDS_BUDGET_S:
        own.plan()
        own.build()
        plans.append(own.plan_time_s)
        builds.append(own.build_time_s)
    return {
        "plan_time_s": median(plans),
        "build_time_s": median(builds),
        "plan_samples_s": plans,
        "build_samples_s": builds,
    }


def _measure_build(point: Point) -> Measured:
    """Plan and build again and again, and the BVH of the plain mesh beside it."""
    _warm_up(point)
    with ExitStack() as stack:
        own, results = _build_own(point, stack)
        baseline = stack.enter_context(make_pixel_tracer(point, own.mesh, own.camera, 1))
        # By the method's own clocks: they know which of its two BVHs is built while it plans, and stop to compile.
        plans, builds = [], []

        def prepare() -> None:
            own.plan()
            own.build()
            plans.append(own.plan_time_s)
            builds.append(own.build_time_s)

        timed = _rounds(point, {OWN: prepare, BASELINE_BUILD: baseline.build})
    warmup = len(plans) - timed.rounds
    for samples, chosen in ((timed.warmup, slice(warmup)), (timed.samples, slice(warmup, None))):
        del samples[OWN]
        samples |= {PLAN: tuple(plans[chosen]), BUILD: tuple(builds[chosen])}
    return _measured(results, timed)


def _measure_memory(point: Point) -> Measured:
    """Build the one method and nothing else."""
    _warm_up(point, baselines=False)
    with ExitStack() as stack:
        _, results = _build_own(point, stack)
    return _measured(results, None)


def _make_pictures(point: Point) -> Measured:
    """Shade the hits of the point's method and of rtcIntersect1, and mark where they differ."""
    from experiments.workloads.picture.shading import (  # with Pillow, which nothing else needs here
        difference_picture,
        encode_png,
        shade,
    )

    with ExitStack() as stack:
        own, results = _build_own(point, stack)
        single = stack.enter_context(make_pixel_tracer(point, own.mesh, own.camera, 1))
        hits, reference = own.trace(), single.trace()
        agreement = compare(own.mesh, own.camera, hits, reference)
    images = {
        "aligned": shade(hits),
        "pixel": shade(reference),
        "difference": difference_picture(hits, reference, agreement.verdict),
    }
    results["pictures"] = {name: base64.b64encode(encode_png(image)).decode() for name, image in images.items()}
    results |= _counts([agreement]) | _depth_errors([agreement])
    return _measured(results, None)


def _judge_agreement(point: Point) -> Measured:
    """Trace every offset with the point's method and with rtcIntersect1, and let the oracle decide who is wrong where
    they disagree, and at a sample of all pixels."""
    with ExitStack() as stack:
        own, results = _build_own(point, stack)
        mesh, camera = own.mesh, own.camera
        single = stack.enter_context(make_pixel_tracer(point, mesh, camera, 1))
        totals: Counter[str] = Counter()
        agreements = []
        listed: dict[str, list[Any]] = {}
        for number, offset in enumerate(point.offsets):
            hits, reference = own.trace(offset), single.trace(offset)
            agreement = compare(mesh, camera, hits, reference)
            agreements.append(agreement)
            # Every image of every point draws a sample of its own, so that a scene's samples add up.
            sample = sample_pixels(camera, point.sample_rays, [_seed(point), number])
            found = examine(mesh, camera, hits, reference, agreement, sample, point.threads)
            totals.update(_counts([agreement]) | _errors(found))
            for name, values in _disagreements(found, offset).items():
                listed.setdefault(name, []).extend(values)
    results |= totals | _depth_errors(agreements) | {"images": len(point.offsets), "disagreements": listed}
    return _measured(results, None)


def _seed(point: Point) -> int:
    return crc32(repr(sorted(point.configuration().items())).encode())


def _errors(found: Examination) -> dict[str, int]:
    """Counts of what the oracle says, by column of the table."""
    disputed, sampled = found.disputed, found.sampled
    return {
        "method_wrong": int((disputed & found.hits.wrong).sum()),
        "baseline_wrong": int((disputed & found.reference.wrong).sum()),
        "rays_sampled": int(sampled.sum()),
        "sampled_method_wrong": int((sampled & found.hits.wrong).sum()),
        "sampled_baseline_wrong": int((sampled & found.reference.wrong).sum()),
    }


def _disagreements(found: Examination, offset: Offset) -> dict[str, list[Any]]:
    """Columns of a list of every pixel where the images differ or one was found wrong; None = nothing, JSON has no
    infinity."""
    rows = np.flatnonzero(found.disputed | found.hits.wrong | found.reference.wrong)
    columns: dict[str, NDArray[Any]] = {
        "offset_x": np.full(len(found.x), offset[0]),
        "offset_y": np.full(len(found.x), offset[1]),
        "x": found.x,
        "y": found.y,
        "verdict": _named(Verdict, found.verdict),
        "sampled": found.sampled,
        "truth_prim_id": found.truth.prim_id,
        "truth_depth": found.truth.depth,
        "truth_edge_distance": found.truth.edge_distance,
        "truth_exhaustive": found.truth.exhaustive,
    }
    for name, testimony in (("method", found.hits), ("baseline", found.reference)):
        columns |= {
            f"{name}_prim_id": testimony.prim_id,
            f"{name}_stored_depth": testimony.stored_depth,
            f"{name}_depth": testimony.depth,
            f"{name}_edge_distance": testimony.edge_distance,
            f"{name}_standing": _named(Standing, testimony.standing),
            f"{name}_off_by": testimony.off_by,
        }
    return {name: [_json_value(value) for value in values[rows].tolist()] for name, values in columns.items()}


def _named(kind: type[IntEnum], codes: NDArray[np.uint8]) -> NDArray[np.str_]:
    return np.array([one.name.lower().replace("_", " ") for one in kind])[codes]


def _json_value(value: Any) -> Any:
    nothing = value == int(MISS) or (isinstance(value, float) and not isfinite(value))
    return None if nothing else value


def _measure_planner(point: Point) -> Measured:
    """Plans, and every candidate beside them."""
    from experiments.workloads.planner.measure import measure_planner  # nothing else needs the planner here

    results, timed = measure_planner(point, _load_mesh(point))
    return _measured(results, timed)


_MEASURES: dict[Quantity, Callable[[Point], Measured]] = {
    Quantity.time: _measure_time,
    Quantity.build: _measure_build,
    Quantity.memory: _measure_memory,
    Quantity.picture: _make_pictures,
    Quantity.agreement: _judge_agreement,
    Quantity.planner: _measure_planner,
}


def _measured(results: dict[str, Any], timed: RoundSamples | None) -> Measured:
    if timed is None:
        return Measured(results)
    return Measured(
        results | {"rounds": timed.rounds},
        {name: list(values) for name, values in timed.warmup.items()},
        {name: list(values) for name, values in timed.samples.items()},
    )


def _rounds(point: Point, methods: dict[str, Callable[[], object]]) -> RoundSamples:
    return measure_rounds(methods, rounds=point.rounds, warmup=point.warmup, budget_s=point.frame_budget_s)


class _Frames:
    """Traces frame after frame into one image, as a renderer would: no sample pays for fresh pages."""

    def __init__(self, tracer: Tracer) -> None:
        self._tracer = tracer
        self._hits: Any = None

    def trace(self) -> None:
        self._hits = self._tracer.trace(out=self._hits)

    def latest(self) -> Images:
        if self._hits is None:
            self.trace()
        return self._hits


def _counts(agreements: Sequence[Agreement]) -> dict[str, int]:
    """Pixels of all images."""
    return {
        f"pixels_{kind}": sum(int(getattr(agreement, f"pixels_{kind}")) for agreement in agreements)
        for kind in _AGREEMENT
    }


def _depth_errors(agreements: Sequence[Agreement]) -> dict[str, float]:
    """The worst of all images, the method's and beside them those of rtcIntersect1."""
    own, single = zip(*((one.depth_errors, one.reference_depth_errors) for one in agreements), strict=True)
    return {
        "depth_error_max": max(one.largest for one in own),
        "depth_error_p999": max(one.p999 for one in own),
        "baseline_depth_error_max": max(one.largest for one in single),
        "baseline_depth_error_p999": max(one.p999 for one in single),
    }


def _load_mesh(point: Point) -> Mesh:
    mesh, _ = load_scene(SceneSource(point.scene_source), point.scene, point.scene_path)
    if mesh_sha256(mesh) != point.mesh_sha256:
        raise InputError(f"scene {point.scene} changed since this run began; start it again")
    return mesh


def _build_own(point: Point, stack: ExitStack) -> tuple[Tracer, dict[str, Any]]:
    """Load the scene and build the point's own method, while nothing else is in the process, reading the memory on
    the way."""
    results: dict[str, Any] = {"rss_start_bytes": rss_bytes()}
    mesh = _load_mesh(point)
    if point.ties == Ties.lowest.value:
        coplanar_overlaps(mesh)  # kept with the mesh; like reading it, no part of the method's memory
    reset_peak_rss()  # reading a file may take more than tracing it
    results["rss_mesh_bytes"] = rss_bytes()
    own = make_own_tracer(point, mesh, point.camera)
    stack.enter_context(own)
    results |= {
        "rss_bytes": rss_bytes(),
        "peak_rss_bytes": peak_rss_bytes(),
        "triangles_traced": int(own.triangle_count),
        "packet_width": int(own.packet_width),
        "threads": int(own.threads),
    }
    if own.embree_bytes:  # a peer does not tell
        results["embree_bytes"] = int(own.embree_bytes)
    return own, results


def _warm_up(point: Point, *, baselines: bool = True) -> None:
    """Trace a few triangles, two of which tie and one of which no copy can show, with every kernel the point uses:
    compiles them and starts Embree's threads, so that neither falls into a build time, a memory reading or a sample."""
    vertices = np.array(
        [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0.3, 0.3, 2), (0, 0, 2), (0, 0, 1)], np.float32
    )
    mesh = Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3), (2, 1, 0), (4, 5, 6)], np.uint32))
    # Two cells of the point's own size: how packets fit into a cell decides which kernel is compiled.
    split = (min(point.split_x, 2), min(point.split_y, 2))
    width = split[0] * (point.width // point.split_x)
    height = split[1] * (point.height // point.split_y)
    camera = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, width, height)
    tracers = [make_own_tracer(point, mesh, camera, split)]
    if baselines:
        tracers += [make_pixel_tracer(point, mesh, camera, width) for width in (1, *expert_packet_widths())]
        tracers += [make(mesh, camera, split) for make in separate_methods(point).values()]
    for tracer in tracers:
        with tracer:
            tracer.trace()
