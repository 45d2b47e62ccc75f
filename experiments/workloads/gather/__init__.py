"""Workload `gather`: all hits along the ray of every pixel, beside single rays and packets that gather the same."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from atra import Count, Layers, Thickness, Transmittance
from atra.all_hits.reductions import Reduction
from atra.tracing.options import option
from experiments.harness.column import WHOLE, Column
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, SINGLE, TIME_COLUMNS
from experiments.workloads.resources import PREPARATION, PREPARATION_COLUMNS, RESOURCE_COLUMNS, RESOURCES

DIFFERENCES = ("hits_in_all", "hits_missing", "hits_too_many", "pixels_different")


class What(Enum):
    """What is made of all hits (`atra.all_hits.reductions`)."""

    count = "count"
    thickness = "thickness"
    transmittance = "transmittance"
    layers = "layers"


@dataclass(frozen=True)
class GatherOptions:
    """Raises InputError for values that no ray could use."""

    what: What = option(What.count, "what is gathered: count, thickness, transmittance or layers")
    layers: int = option(8, "the nearest hits that are kept, where layers are gathered")
    factor: float = option(0.5, "what each triangle lets through, where transmittance is gathered")

    def __post_init__(self) -> None:
        self.reduction  # noqa: B018  # refuses what cannot be gathered

    @property
    def reduction(self) -> Reduction[Any]:
        """The library's value for it."""
        if self.what is What.count:
            return Count()
        if self.what is What.thickness:
            return Thickness()
        return Transmittance(self.factor) if self.what is What.transmittance else Layers(self.layers)


def _headline(record: Record) -> str:
    own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
    gain = f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x single rays"
    return f"{gain}; {record.results['pixels_different']} pixels other than theirs"


def _problem(point: Point) -> str | None:
    what = point.workload_options.what
    if point.method.is_ours or what in (What.count, What.thickness):
        return None
    return f"method={point.method.name} with workload.what={what.value}, expected count or thickness: theirs do no more"


GATHER = Workload(
    name="gather",
    options=GatherOptions,
    columns=(
        *RESOURCE_COLUMNS,
        Column("hits_in_all", WHOLE, "hits along all rays, as single rays find them"),
        Column("hits_missing", WHOLE, "of these, those not found, where hits are counted", over=max),
        Column("hits_too_many", WHOLE, "hits found beside these, where hits are counted", over=max),
        Column("pixels_different", WHOLE, "pixels of which something else was gathered than by single rays", over=max),
        *PREPARATION_COLUMNS,
        *TIME_COLUMNS,
    ),
    headline=_headline,
    room=__name__,
    samples=lambda point: frozenset((OWN, SINGLE)),
    needs=(*RESOURCES, *DIFFERENCES, *PREPARATION),
    **BESIDE_BASELINES,
    problem=_problem,
)
