"""Workload `gather`: all hits along the ray of every pixel, beside single rays and packets that gather the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

from atra import Count, Layers, Thickness, Transmittance
from atra.all_hits.reductions import Reduction
from experiments.harness.options import Settings, option
from experiments.harness.point import Measured, Point
from experiments.harness.records import Record
from experiments.workloads import rounds
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, say_gains
from experiments.workloads.resources import Preparation, Resources
from experiments.workloads.typed import Worst, workload


class Differences(TypedDict):
    """Gatherings of the method beside those of single rays; hits are 0 where they are not counted."""

    hits_in_all: int
    hits_missing: Worst
    hits_too_many: Worst
    pixels_different: Worst


WHAT = ("count", "thickness", "transmittance", "layers")
"""What is made of all hits (`atra.all_hits.reductions`)."""


@dataclass(frozen=True)
class GatherOptions(Settings):
    """Raises InputError for values that no ray could use."""

    what: str = option("count", "reduction of all hits: count, thickness, transmittance or layers", choices=WHAT)
    layers: int = option(8, "the nearest hits that are kept, where layers are gathered")
    factor: float = option(0.5, "transmittance of each triangle, where transmittance is gathered")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.reduction  # noqa: B018  # refuses what cannot be gathered

    @property
    def reduction(self) -> Reduction[Any]:
        """The library's value for it."""
        if self.what == "count":
            return Count()
        if self.what == "thickness":
            return Thickness()
        return Transmittance(self.factor) if self.what == "transmittance" else Layers(self.layers)


def _headline(record: Record) -> str:
    different = record.results["pixels_different"]
    return f"{say_gains(record, single_rays=SINGLE)}; {different} pixels other than theirs"


def _problem(point: Point) -> str | None:
    if point.method.is_ours:
        return None
    return f"method={point.method.name} finds the nearest hit; workload=rays asks other libraries for all hits"


GATHER = workload(
    "gather", __name__, _headline, Resources, Differences, Preparation, BESIDE_BASELINES,
    options=GatherOptions, problem=_problem,
    told=("render_time_s", "speedup", "speedup_vs_packets", "pixels_different"),
)  # fmt: skip


_EXACT_TO = 1e-5
"""Tolerance as a share of the image's largest value: thicknesses are differences of float32 depths."""

CLOSED = ((0, 1, 6), (1, 2, 6), (2, 0, 6), (2, 1, 0))
"""A tetrahedron, since thickness needs a closed mesh. The plane of one face contains the eye, so no copy can show it; a
corner in the eye would put every sample in doubt, which takes seconds to decide."""


def measure(point: Point) -> Measured:
    """Time gatherings. Raises InputError for a mesh that is not for what is gathered, too."""
    what = point.workload_options.reduction

    def judge(_: Any, gathered: dict[str, rounds.Frames]) -> Differences:
        return differences(gathered[OWN].latest(), gathered[SINGLE].latest(), what)

    return rounds.race_baselines(point, judge, what, CLOSED)


def differences(own: Any, single: Any, what: Reduction[Any]) -> Differences:
    """Differences of two results of `gather`."""
    differs: NDArray[np.bool_] = np.zeros((single.camera.height, single.camera.width), bool)
    hits = missing = too_many = 0
    for name in what.planes():
        ours, theirs = getattr(own, name), getattr(single, name)
        if name == "count":
            more = ours.astype(np.int64) - theirs
            hits, missing, too_many = int(theirs.sum()), int(-more[more < 0].sum()), int(more[more > 0].sum())
        differs |= _unlike(ours, theirs).reshape(-1, *differs.shape).any(axis=0)
    return Differences(
        hits_in_all=hits, hits_missing=missing, hits_too_many=too_many, pixels_different=int(differs.sum())
    )


def _unlike(own: NDArray[Any], single: NDArray[Any]) -> NDArray[np.bool_]:
    if own.dtype.kind != "f":
        return own != single
    finite = np.isfinite(single)
    largest = np.abs(single[finite]).max(initial=0.0)
    return ~np.isclose(own, single, rtol=0, atol=_EXACT_TO * largest, equal_nan=True)
