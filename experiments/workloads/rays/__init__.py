"""Workload `rays`: batches of rays through our own BVH, from the root and as the method starts them, beside Embree."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from statistics import median
from typing import Any

from atra.tracing.options import option
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.methods import METHODS
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, PACKETS, SINGLE, fastest, over_own, series, single_over_packets
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES, say_ms

PLAIN, SORTED = "plain", "packets_sorted"
"""Names in the samples: the same rays in the same order and packets, from the root; and Embree's widest packets in that
order, if it differs from the batch's."""

_OWN_COUNTS = {
    "traversal_steps": "nodes popped, or descended into",
    "box_tests": "boxes tested",
    "block_tests": "blocks of up to four triangles tested",
    "list_entries": "nodes of lists put on the stack",
    "rays_from_root": "rays, or packets, without a list",
    "rays_proven_miss": "rays, or packets, that meet no node",
}

COUNTED = tuple(_OWN_COUNTS)
"""Results in the order of `atra.bvh.single`."""

PLAIN_COUNTED = tuple(f"plain_{name}" for name in COUNTED[:3])

_COUNTS = _OWN_COUNTS | {plain: f"{name} from the root" for plain, name in zip(PLAIN_COUNTED, COUNTED, strict=False)}


class Kind(Enum):
    """What rays there are (`atra.rays.ray_sets`)."""

    primary = "primary"
    occlusion = "occlusion"
    diffuse = "diffuse"


@dataclass(frozen=True)
class RayOptions:
    """Which rays are traced."""

    ray_kind: Kind = option(Kind.primary, "primary, occlusion or diffuse")


def _headline(record: Record) -> str:
    own, plain = median(record.samples[OWN]), median(record.samples[PLAIN])
    ratio = record.results["steps_ratio"]
    return f"{say_ms(own)}, {plain / own:.2f}x from the root in {ratio:.2f} of its steps"


def _problem(point: Point) -> str | None:
    if point.method.make_rays is not None:
        return None
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


RAYS = Workload(
    name="rays",
    options=RayOptions,
    columns=(
        *RESOURCE_COLUMNS,
        Column("rays_traced", WHOLE, "rays of the batch"),
        Column(
            "rays_different", WHOLE, "rays that hit another triangle, or at another t, than from the root", over=max
        ),
        Column("rays_wrong", WHOLE, "rays with another triangle than rtcIntersect1, without an excuse", over=max),
        *(Column(name, WHOLE, help) for name, help in _COUNTS.items()),
        Column("steps_ratio", REAL, "traversal_steps / those from the root"),
        Column("bytes_touched", WHOLE, "nodes, blocks and lists read, each as often as it is"),
        Column("plain_bytes_touched", WHOLE, "bytes_touched from the root"),
        Column("bvh_build_time_s", REAL, "building the BVH"),
        Column("sampling_time_s", REAL, "finding the shafts that rays use"),
        Column("order_time_s", REAL, "classifying rays and putting them in order"),
        Column("break_even_batches", REAL, "batches until all preparation is paid back", _break_even),
        *statistics_columns("render_time{}_s", "one batch", series(OWN)),
        *statistics_columns("plain_render_time{}_s", "the same from the root", series(PLAIN)),
        *statistics_columns("baseline_render_time{}_s", "rtcIntersect1 or rtcOccluded1", series(SINGLE)),
        *statistics_columns("packets_render_time{}_s", "the fastest packets of Embree", fastest),
        *statistics_columns("packets_sorted_render_time{}_s", "the widest ones, rays sorted", series(SORTED)),
        *_ratio_columns("speedup_vs_bvh", "the same from the root / this, in the same rounds", series(PLAIN)),
        *_ratio_columns("speedup", "rtcIntersect1 / this, in the same rounds", series(SINGLE)),
        *_ratio_columns("speedup_vs_packets", "the fastest packets / this, in the same rounds", fastest),
        *_ratio_columns("speedup_vs_sorted", "sorted packets of Embree / this, in the same rounds", series(SORTED)),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, PLAIN, SINGLE)),
    optional=frozenset((*PACKETS.values(), SORTED)),
    judged=OWN,
    needs=(*RESOURCES, *COUNTED, *PLAIN_COUNTED, "rays_different", "steps_ratio"),
    canary=single_over_packets,
    problem=_problem,
)
