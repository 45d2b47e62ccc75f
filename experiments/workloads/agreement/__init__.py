"""Workload `agreement`: who is wrong where a method and rtcIntersect1 differ, by a float64 oracle."""

from __future__ import annotations

from dataclasses import dataclass

from atra.errors import InputError
from atra.geometry.view import check_offset
from atra.tracing.options import option
from experiments.harness.column import WHOLE, Column
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.workloads.images import IMAGE_COLUMNS, PIXELS, say_holes
from experiments.workloads.resources import RESOURCE_COLUMNS, RESOURCES

Offset = tuple[float, float]


@dataclass(frozen=True)
class AgreementOptions:
    """Raises InputError for values no image could use."""

    offsets: list[list[float]] = option(((0.5, 0.5),), "sub-pixel positions of the images that are compared")  # type: ignore[assignment]
    sample_rays: int = option(1000, "rays of each image that are tested with every triangle")

    def __post_init__(self) -> None:
        if not self.offsets:
            raise InputError("workload.offsets is empty, expected at least one sub-pixel position such as [0.5,0.5]")
        for offset in self.offsets:
            check_offset(tuple(offset), "workload.offsets")  # type: ignore[arg-type]
        if self.sample_rays < 0:
            raise InputError(f"workload.sample_rays is {self.sample_rays}, expected a whole number of at least 0")


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
        Column("method_wrong", WHOLE, "of the pixels that are not equal, those where float64 finds the method wrong"),
        Column("baseline_wrong", WHOLE, "and those where it finds rtcIntersect1 wrong"),
        Column("method_holes", WHOLE, "of the method's wrong ones, rays that slip through between triangles"),
        Column("baseline_holes", WHOLE, "and of rtcIntersect1's"),
        Column("rays_sampled", WHOLE, "rays drawn from all pixels and tested with every triangle"),
        Column("sampled_method_wrong", WHOLE, "of these, where the method is wrong"),
        Column("sampled_baseline_wrong", WHOLE, "of these, where rtcIntersect1 is wrong"),
    ),
    headline=_headline,
    room=__name__,
    needs=(*RESOURCES, *PIXELS, "images", "disagreements", "method_wrong", "baseline_wrong"),
)
