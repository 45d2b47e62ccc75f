"""Workload `classification`: rays through our own BVH, from the root and as the method starts them, beside Embree."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import intersect_rays
from atra.geometry.mesh import Mesh
from atra.prim_ids import MISS
from atra.raster.tracer import RasterTracer
from atra.rays.rays import RayHits, Rays
from atra.rays.scene import RayScene
from atra.trees.layout import BLOCK_BYTES
from experiments.classification.bvh.binary import NODE_BYTES
from experiments.classification.bvh.scene import BvhScene, PreparedRays
from experiments.classification.bvh.single import BLOCKS, BOXES, LISTED, STEPS
from experiments.classification.ray_sets import ray_set
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.environment import peak_rss_bytes, reset_peak_rss, rss_bytes
from experiments.harness.options import Settings, option
from experiments.harness.point import Measured, Point, Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, PACKETS, SINGLE, fastest, over_own, series, single_over_packets
from experiments.workloads.resources import Resources, say_ms
from experiments.workloads.rounds import expert_packet_widths, load_mesh, measured, timed_rounds
from experiments.workloads.typed import columns_of, needs_of

PLAIN, SORTED = "plain", "packets_sorted"
"""Names in the samples: the same rays in the same order, from the root; and Embree's widest packets in that order, if
it differs from the batch's."""

_OWN_COUNTS = {
    "traversal_steps": "nodes popped, or descended into",
    "box_tests": "boxes tested",
    "block_tests": "blocks of up to four triangles tested",
    "list_entries": "nodes of lists put on the stack",
    "rays_from_root": "rays without a list",
    "rays_proven_miss": "rays that meet no node",
}

COUNTED = tuple(_OWN_COUNTS)
"""Results in the order of `bvh.single`."""

PLAIN_COUNTED = tuple(f"plain_{name}" for name in COUNTED[:3])

_COUNTS = _OWN_COUNTS | {plain: f"{name} from the root" for plain, name in zip(PLAIN_COUNTED, COUNTED, strict=False)}


KINDS = ("primary", "occlusion", "diffuse")
"""What rays there are (`ray_sets`)."""


@dataclass(frozen=True)
class RayOptions(Settings):
    """Which rays are traced."""

    ray_kind: str = option(
        "primary", "rays of pixels, or from what they see: to what is near, or a bounce", choices=KINDS
    )


def _headline(record: Record) -> str:
    own, plain = median(record.samples[OWN]), median(record.samples[PLAIN])
    ratio = record.results["steps_ratio"]
    return f"{say_ms(own)}, {plain / own:.2f}x from the root in {ratio:.2f} of its steps"


def _problem(point: Point) -> str | None:
    if point.method.make_rays is not None:
        return None
    from experiments.methods import METHODS  # all of them, which a worker has no use for

    able = ", ".join(method.name for method in METHODS if method.make_rays is not None)
    return f"method={point.method.name} traces no batches of rays, expected one of {able}"


def _break_even(record: Record) -> float | None:
    """None where nothing is saved."""
    if PLAIN not in record.samples:
        return None
    saved = median(record.samples[PLAIN]) - median(record.samples[OWN])
    parts = (record.results.get(name, 0.0) for name in ("shaft_build_time_s", "sampling_time_s", "order_time_s"))
    return float(sum(parts) / saved) if saved > 0 else None


def _ratio_columns(name: str, help: str, read: Any) -> tuple[Column, ...]:
    return statistics_columns(name + "{}", help, over_own(read))


CLASSIFICATION = Workload(
    name="classification",
    options=RayOptions,
    columns=(
        *columns_of(Resources),
        Column("rays_traced", WHOLE, "rays of the batch"),
        Column(
            "rays_different", WHOLE, "rays that hit another triangle, or at another t, than from the root", over=max
        ),
        Column("rays_wrong", WHOLE, "rays with another triangle than rtcIntersect1, without an excuse", over=max),
        *(Column(name, WHOLE, help) for name, help in _COUNTS.items()),
        Column("steps_ratio", REAL, "traversal_steps / those from the root"),
        Column("bytes_touched", WHOLE, "nodes, blocks and lists read, each as often as it is"),
        Column("plain_bytes_touched", WHOLE, "bytes_touched from the root"),
        Column("bvh_build_time_s", REAL, "time to build the BVH"),
        Column("sampling_time_s", REAL, "time to find the shafts that rays use"),
        Column("order_time_s", REAL, "time to classify and sort rays"),
        Column("break_even_batches", REAL, "batches until all preparation is paid back", _break_even),
        *statistics_columns("render_time{}_s", "one batch", series(OWN)),
        *statistics_columns("plain_render_time{}_s", "one batch, traced from the root", series(PLAIN)),
        *statistics_columns("baseline_render_time{}_s", "rtcIntersect1 or rtcOccluded1", series(SINGLE)),
        *statistics_columns("packets_render_time{}_s", "the fastest packets of Embree", fastest),
        *statistics_columns(
            "packets_sorted_render_time{}_s", "the widest packets of Embree, rays sorted", series(SORTED)
        ),
        *_ratio_columns("speedup_vs_bvh", "a batch from the root / this, in the same rounds", series(PLAIN)),
        *_ratio_columns("speedup", "rtcIntersect1 / this, in the same rounds", series(SINGLE)),
        *_ratio_columns("speedup_vs_packets", "the fastest packets / this, in the same rounds", fastest),
        *_ratio_columns("speedup_vs_sorted", "sorted packets of Embree / this, in the same rounds", series(SORTED)),
    ),
    headline=_headline,
    package=__name__,
    samples=lambda point: frozenset((OWN, PLAIN, SINGLE)),
    optional=frozenset((*PACKETS.values(), SORTED)),
    judged=OWN,
    needs=(*needs_of(Resources), *COUNTED, *PLAIN_COUNTED, "rays_different", "steps_ratio"),
    canary=single_over_packets,
    problem=_problem,
    once="rays",
    rays=lambda row: f"{row.get('ray_kind', 'own')}, in a batch",
    told=("render_time_s", "steps_ratio", "speedup_vs_bvh", "speedup", "speedup_vs_packets"),
)


_LOOKUP_BYTES = 12
"""A row, a place and a length are read for each ray that has a list."""

_AS_NEAR = 1e-5
"""Relative difference of two float64 distances within which float32 may take either triangle for the nearer."""

_RIM = 1e-4
"""Barycentric distance from a triangle's edge within which float32 may say that a ray hits it or misses it."""

_WARM_MESH = Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], np.float32), np.array([(0, 1, 2), (0, 1, 3)]))


def make(point: Point, mesh: Mesh) -> BvhScene:
    """What is measured. Raises InputError as the scene does."""
    make_rays = point.method.make_rays
    assert make_rays is not None
    return make_rays(mesh, point.options, point.tracing)


def measure(point: Point) -> Measured:
    """Build, count and time. Raises InputError and MemoryBudgetError as the scenes do."""
    kind = point.workload_options.ray_kind
    any_hit = kind == "occlusion"
    _warm_up(point, any_hit)
    results: dict[str, Any] = {"rss_start_bytes": rss_bytes()}
    mesh = load_mesh(point)
    rays = _rays_of(point, mesh)
    reset_peak_rss()
    results["rss_mesh_bytes"] = rss_bytes()
    with ExitStack() as stack:
        own = stack.enter_context(make(point, mesh))
        prepared = own.prepare(rays)
        plain = prepared.from_root()
        results |= {
            "rss_bytes": rss_bytes(),
            "peak_rss_bytes": peak_rss_bytes(),
            "triangles_traced": mesh.triangle_count,
            "packet_width": 1,
            "threads": own.threads,
            "rays_traced": len(rays),
            "bvh_build_time_s": own.build_time_s - own.counters.get("shaft_build_time_s", 0.0),
            "sampling_time_s": prepared.sampling_time_s,
            "order_time_s": prepared.order_time_s,
            **own.counters,
            **counted(own, prepared, plain, any_hit),
        }
        embree = {SINGLE: 1} | {PACKETS[width]: width for width in expert_packet_widths()}
        scenes = {
            name: stack.enter_context(RayScene(mesh, packet_width=width, threads=point.threads, precision="fast"))
            for name, width in embree.items()
        }
        calls = {OWN: _query(own, prepared, any_hit), PLAIN: _query(own, plain, any_hit)}
        calls |= {name: _query(scene, rays, any_hit) for name, scene in scenes.items()}
        if not np.array_equal(prepared.batch.order, np.arange(len(rays))):
            order = prepared.batch.order
            in_order = Rays(rays.origins[order], rays.directions[order], rays.tnear[order], rays.tfar[order])
            calls[SORTED] = _query(list(scenes.values())[-1], in_order, any_hit)
        if not any_hit:
            results["rays_wrong"] = wrong(own.intersect(prepared), scenes[SINGLE].intersect(rays))
        timed = timed_rounds(point, calls)
    return measured(results, timed)


def _rays_of(point: Point, mesh: Mesh) -> Rays:
    with RasterTracer(mesh, point.camera, threads=point.threads, ties="any") as raster:
        return ray_set(point.workload_options.ray_kind, mesh, point.camera, raster.trace())


def _query(scene: Any, rays: Any, any_hit: bool) -> Callable[[], Any]:
    return (lambda: scene.occluded(rays)) if any_hit else (lambda: scene.intersect(rays))


def counted(scene: BvhScene, prepared: PreparedRays, plain: PreparedRays, any_hit: bool) -> dict[str, Any]:
    """What rays take from their lists and from the root, and how many of them hit something else."""
    prim_id, counts = scene.count(prepared, any_hit)
    from_root, plain_counts = scene.count(plain, any_hit)
    different = (prim_id != MISS) != (from_root != MISS) if any_hit else prim_id != from_root
    if not any_hit:
        own, root = scene.intersect(prepared), scene.intersect(plain)
        different |= (own.t != root.t) | (own.prim_id != prim_id) | (root.prim_id != from_root)
    results: dict[str, Any] = {name: int(count) for name, count in zip(COUNTED, counts, strict=True)}
    results |= {f"plain_{name}": int(count) for name, count in zip(COUNTED[:3], plain_counts, strict=False)}
    results["rays_different"] = int(different.sum())
    results["steps_ratio"] = float(counts[STEPS] / plain_counts[STEPS])
    for name, of, lookups in (("", counts, len(prepared.rays)), ("plain_", plain_counts, 0)):
        read = of[BOXES] * NODE_BYTES + of[BLOCKS] * BLOCK_BYTES + of[LISTED] * 4
        results[f"{name}bytes_touched"] = int(read + (lookups * _LOOKUP_BYTES if of[LISTED] else 0))
    return results


def wrong(own: RayHits, single: RayHits) -> int:
    """How many rays hit another triangle than rtcIntersect1 finds, and float64 says that ours is not as good.

    Ours is as good where it is hit, or all but hit, and not behind theirs but for rounding.
    """
    differ = np.flatnonzero(own.prim_id != single.prim_id)
    ours, theirs = _distances(own, differ), _distances(single, differ)
    with np.errstate(invalid="ignore"):
        as_near = ours <= theirs + _AS_NEAR * np.abs(theirs)
    rim = np.isnan(ours) | np.isnan(theirs)
    return int((~(as_near | rim)).sum())


def _distances(hits: RayHits, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """(N,) float64, where rays meet the triangles named; inf for none, NaN on a rim, where float32 may say either."""
    t = np.full(len(rows), np.inf)
    named = hits.prim_id[rows] != MISS
    at = rows[named]
    plane = intersect_rays(hits.mesh, hits.rays.origins[at], hits.rays.directions[at], hits.prim_id[at])
    t[named] = np.where(np.abs(plane.edge_distance) < _RIM, np.nan, plane.depth)
    return t


def _warm_up(point: Point, any_hit: bool) -> None:
    """Compile every kernel of the point."""
    rays = Rays(np.full((64, 3), 0.1), np.tile([(-1.0, -0.9, -0.8)], (64, 1)))
    with make(point, _WARM_MESH) as scene:
        prepared = scene.prepare(rays)
        counted(scene, prepared, prepared.from_root(), any_hit)
        scene.occluded(prepared), scene.occluded(prepared.from_root())
    for width in (1, *expert_packet_widths()):
        with RayScene(_WARM_MESH, packet_width=width, threads=1, precision="fast") as embree:
            _query(embree, rays, any_hit)()
