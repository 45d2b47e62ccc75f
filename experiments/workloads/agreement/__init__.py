"""Workload `agreement`: who is wrong where a method and rtcIntersect1 differ, by a float64 oracle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from enum import IntEnum
from math import isfinite
from typing import Any, TypedDict
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import check_offset
from atra.judge.compare import Verdict, compare
from atra.prim_ids import MISS
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point
from experiments.harness.records import Record
from experiments.workloads.agreement.oracle import Correctness, Examination, examine, sample_pixels
from experiments.workloads.images import Images, say_holes, summed
from experiments.workloads.resources import Resources
from experiments.workloads.rounds import build_own, make_single, measured
from experiments.workloads.typed import workload

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


class Faults(TypedDict):
    """What the oracle says of all images, and every pixel where two differ or one was found wrong, as columns."""

    images: int
    method_wrong: int
    baseline_wrong: int
    method_holes: int
    baseline_holes: int
    rays_sampled: int
    sampled_method_wrong: int
    sampled_baseline_wrong: int
    disagreements: dict[str, list[Any]]


AGREEMENT = workload("agreement", __name__, _headline, Resources, Images, Faults, options=AgreementOptions)


def measure(point: Point) -> Measured:
    """Trace every offset with the point's method and with rtcIntersect1, and let the oracle decide who is wrong where
    they disagree, and at a sample of all pixels."""
    options = point.workload_options
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        mesh, camera = own.mesh, own.camera
        single = stack.enter_context(make_single(point, mesh, camera))
        agreements, examined = [], []
        for number, offset in enumerate(options.offsets):
            hits, reference = own.trace(offset), single.trace(offset)
            agreements.append(compare(hits, reference))
            # Every image of every point draws a sample of its own, so that a scene's samples add up.
            sample = sample_pixels(camera, options.sample_rays, [_seed(point), number])
            examined.append(examine(mesh, camera, hits, reference, agreements[-1], sample, point.threads))
    return measured(results | {**summed(agreements), **_faults(examined, options.offsets)})


def _seed(point: Point) -> int:
    return crc32(repr(sorted(point.row.items())).encode())


def _faults(examined: Sequence[Examination], offsets: Sequence[Offset]) -> Faults:
    def count(chosen: Callable[[Examination], NDArray[np.bool_]]) -> int:
        return sum(int(chosen(image).sum()) for image in examined)

    parts = [_disagreements(image, offset) for image, offset in zip(examined, offsets, strict=True)]
    return Faults(
        images=len(examined),
        method_wrong=count(lambda image: image.disputed & image.hits.wrong),
        baseline_wrong=count(lambda image: image.disputed & image.reference.wrong),
        method_holes=count(lambda image: image.disputed & image.hits.holes),
        baseline_holes=count(lambda image: image.disputed & image.reference.holes),
        rays_sampled=count(lambda image: image.sampled),
        sampled_method_wrong=count(lambda image: image.sampled & image.hits.wrong),
        sampled_baseline_wrong=count(lambda image: image.sampled & image.reference.wrong),
        disagreements={name: [value for part in parts for value in part[name]] for name in parts[0]},
    )


def _disagreements(image: Examination, offset: Offset) -> dict[str, list[Any]]:
    """Columns of a list of every pixel where the images differ or one was found wrong; None = nothing, JSON has no
    infinity."""
    rows = np.flatnonzero(image.disputed | image.hits.wrong | image.reference.wrong)
    columns: dict[str, NDArray[Any]] = {
        "offset_x": np.full(len(image.x), offset[0]),
        "offset_y": np.full(len(image.x), offset[1]),
        "x": image.x,
        "y": image.y,
        "verdict": _named(Verdict, image.verdict),
        "sampled": image.sampled,
        "truth_prim_id": image.truth.prim_id,
        "truth_depth": image.truth.depth,
        "truth_edge_distance": image.truth.edge_distance,
        "truth_exhaustive": image.truth.exhaustive,
    }
    for name, answer in (("method", image.hits), ("baseline", image.reference)):
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
    return np.array([member.name.lower().replace("_", " ") for member in kind])[codes]


def _json_value(value: Any) -> Any:
    nothing = value == int(MISS) or (isinstance(value, float) and not isfinite(value))
    return None if nothing else value
