"""Workload `agreement`: who is wrong where a method and rtcIntersect1 differ, by a float64 oracle."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import check_offset
from atra.judge.compare import Verdict, compare
from atra.prim_ids import MISS
from experiments.harness.column import WHOLE, Column
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point, Workload
from experiments.harness.records import Record
from experiments.workloads.agreement.oracle import Correctness, Examination, examine, sample_pixels
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, counts, depth_errors, say_holes
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES
from experiments.workloads.rounds import build_own, make_single, measured

Offset = tuple[float, float]


@dataclass(frozen=True)
class AgreementOptions(Settings):
    """Raises InputError for values no image could use."""

    offsets: list[list[float]] = option(((0.5, 0.5),), "sub-pixel positions of the images that are compared")  # type: ignore[assignment]
    sample_rays: int = whole(1000, "rays of each image that are tested with every triangle", 0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.offsets:
            raise InputError("workload.offsets is empty, expected at least one sub-pixel position such as [0.5,0.5]")
        for offset in self.offsets:
            check_offset(tuple(offset), "workload.offsets")  # type: ignore[arg-type]


def _headline(record: Record) -> str:
    told = "{pixels_wrong} pixels wrong".format(**record.results) + say_holes(record.results)
    told += "; by float64 {method_wrong} to {baseline_wrong}".format(**record.results)
    return f"{told}; depths off by up to {record.results['depth_error_max']:.1e}"


AGREEMENT = Workload(
    name="agreement",
    options=AgreementOptions,
    columns=(
        *RESOURCE_COLUMNS,
        *IMAGE_COLUMNS,
        Column("images", WHOLE, "images compared, one an offset"),
        Column("method_wrong", WHOLE, "pixels that differ where float64 finds the method wrong"),
        Column("baseline_wrong", WHOLE, "pixels that differ where float64 finds rtcIntersect1 wrong"),
        Column("method_holes", WHOLE, "wrong pixels where the method's ray slips through between triangles"),
        Column("baseline_holes", WHOLE, "wrong pixels where an rtcIntersect1 ray slips through between triangles"),
        Column("rays_sampled", WHOLE, "rays drawn from all pixels and tested with every triangle"),
        Column("sampled_method_wrong", WHOLE, "sampled rays that the method gets wrong"),
        Column("sampled_baseline_wrong", WHOLE, "sampled rays that rtcIntersect1 gets wrong"),
    ),
    headline=_headline,
    package=__name__,
    needs=(*RESOURCES, *PIXELS, "images", "disagreements", "method_wrong", "baseline_wrong"),
)


def measure(point: Point) -> Measured:
    """Trace every offset with the point's method and with rtcIntersect1, and let the oracle decide who is wrong where
    they disagree, and at a sample of all pixels."""
    options = point.workload_options
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        mesh, camera = own.mesh, own.camera
        single = stack.enter_context(make_single(point, mesh, camera))
        totals: Counter[str] = Counter()
        agreements = []
        listed: dict[str, list[Any]] = {}
        for number, offset in enumerate(options.offsets):
            hits, reference = own.trace(offset), single.trace(offset)
            agreement = compare(hits, reference)
            agreements.append(agreement)
            # Every image of every point draws a sample of its own, so that a scene's samples add up.
            sample = sample_pixels(camera, options.sample_rays, [_seed(point), number])
            found = examine(mesh, camera, hits, reference, agreement, sample, point.threads)
            totals.update(counts([agreement]) | _errors(found))
            for name, values in _disagreements(found, offset).items():
                listed.setdefault(name, []).extend(values)
    results |= totals | depth_errors(agreements) | {"images": len(options.offsets), "disagreements": listed}
    return measured(results)


def _seed(point: Point) -> int:
    return crc32(repr(sorted(point.row.items())).encode())


def _errors(found: Examination) -> dict[str, int]:
    """Counts of what the oracle says, by column of the table."""
    disputed, sampled = found.disputed, found.sampled
    return {
        "method_wrong": int((disputed & found.hits.wrong).sum()),
        "baseline_wrong": int((disputed & found.reference.wrong).sum()),
        "method_holes": int((disputed & found.hits.holes).sum()),
        "baseline_holes": int((disputed & found.reference.holes).sum()),
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
    for name, answer in (("method", found.hits), ("baseline", found.reference)):
        columns |= {
            f"{name}_prim_id": answer.prim_id,
            f"{name}_stored_depth": answer.stored_depth,
            f"{name}_depth": answer.depth,
            f"{name}_edge_distance": answer.edge_distance,
            f"{name}_correctness": _named(Correctness, answer.correctness),
            f"{name}_off_by": answer.off_by,
        }
    return {name: [_json_value(value) for value in values[rows].tolist()] for name, values in columns.items()}


def _named(kind: type[IntEnum], codes: NDArray[np.uint8]) -> NDArray[np.str_]:
    return np.array([one.name.lower().replace("_", " ") for one in kind])[codes]


def _json_value(value: Any) -> Any:
    nothing = value == int(MISS) or (isinstance(value, float) and not isfinite(value))
    return None if nothing else value
