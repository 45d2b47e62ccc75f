"""Workload `agreement`: who is wrong where a method and rtcIntersect1 differ, by a float64 oracle."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TypedDict
from zlib import crc32

from atra.errors import InputError
from atra.geometry.view import check_offset
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point
from experiments.harness.records import Record
from experiments.workloads.agreement.oracle import Examination, examine, sample_pixels
from experiments.workloads.images import Images, say_holes, summed
from experiments.workloads.resources import Resources
from experiments.workloads.rounds import build_own, make_single
from experiments.workloads.typed import workload


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
    """What the oracle says of all images."""

    images: int
    method_wrong: int
    baseline_wrong: int
    rays_sampled: int
    sampled_method_wrong: int
    sampled_baseline_wrong: int


AGREEMENT = workload("agreement", __name__, _headline, Resources, Images, Faults, options=AgreementOptions)


def measure(point: Point) -> Measured:
    """Trace every offset with the point's method and with rtcIntersect1, and let the oracle decide who is wrong where
    they disagree, and at a sample of all pixels."""
    options = point.workload_options
    seed = crc32(repr(sorted(point.row.items())).encode())
    faults: Counter[str] = Counter()
    agreements = []
    with ExitStack() as stack:
        own, results = build_own(point, stack)
        single = stack.enter_context(make_single(point, own.mesh, own.camera))
        for number, offset in enumerate(options.offsets):
            # Every image of every point draws a sample of its own, so that a scene's samples add up.
            sample = sample_pixels(own.camera, options.sample_rays, [seed, number])
            image = examine(own.trace(offset), single.trace(offset), sample)
            agreements.append(image.agreement)
            faults.update(_faults(image))
    return Measured(results | {**summed(agreements), **faults})


def _faults(image: Examination) -> Faults:
    return Faults(
        images=1,
        method_wrong=int((image.disputed & image.hits_wrong).sum()),
        baseline_wrong=int((image.disputed & image.reference_wrong).sum()),
        rays_sampled=int(image.sampled.sum()),
        sampled_method_wrong=int((image.sampled & image.hits_wrong).sum()),
        sampled_baseline_wrong=int((image.sampled & image.reference_wrong).sum()),
    )
