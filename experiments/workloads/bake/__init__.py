"""Workload `bake`: samples of a lightmap, beside those of a batch in which every texel of the map has a lane."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from statistics import median
from typing import Any

from atra.bake import BakeOptions
from atra.errors import InputError
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.point import Point
from experiments.harness.records import Record
from experiments.methods.method import option
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over_own, series
from experiments.workloads.resources import say_mib
from experiments.workloads.workload import UnderSky, Workload

PLAIN, WHOLE_MAP, WITHOUT_VIEW = "all_lanes", "whole_map", "without_view"
"""Names in the samples, beside the point's own: texels that nothing lights keep their lanes; the whole map, seen texels
first; the whole map, in the order of rows."""

STAGES = ("order", "generate", "aim", "shadow", "scatter", "trace", "shade", "compact", "gather", "other")
THRESHOLDS = (10, 5, 2)
"""Percent, of the relative error of a map."""


class Compaction(Enum):
    """As of `atra.bake.BakeOptions`."""

    none = "none"
    texels = "texels"
    bounces = "bounces"


class Lights(Enum):
    """As of `atra.bake.BakeOptions`."""

    uniform = "uniform"
    grid = "grid"


@dataclass(frozen=True)
class BakeSettings(UnderSky):
    """Raises InputError for values that no bake could use."""

    size: int = option(512, "texels along a side of the map, before a lower occupancy makes it larger")
    occupancy: float | None = option(
        None, "share of the map that is lit, by wider gutters; null: what xatlas makes", "any"
    )
    samples: int = option(16, "of a texel, in a round")
    final_samples: int = option(512, "samples of a finished map, which nobody waits for")
    bounces: int = option(4, "how often light is reflected at most")
    albedo: float | None = option(None, "of all faces; null: the scene's own", "own")
    compaction: Compaction = option(Compaction.bounces, "which lanes move together: none, texels or bounces")
    priority: bool = option(False, "whether texels that the view shows come first")
    lights: Lights = option(Lights.uniform, "which of many lights rays are aimed at: uniform or grid")
    adaptive: bool = option(False, "whether texels are left at 1 %, in a finished map")
    packets: int | None = option(1, "rays of a packet; null: the widest that are native", "widest")
    batch_rays: int = option(1 << 19, "rays in flight")
    expansion: int = option(16, "samples of a texel side by side in a batch")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, low, high in (("size", 8, 1 << 14), ("samples", 1, 1 << 20), ("final_samples", 1, 1 << 20)):
            value = getattr(self, name)
            if not low <= value <= high:
                raise InputError(f"workload.{name} is {value}, expected a whole number from {low} to {high}")
        for name, most in (("occupancy", 0.95), ("albedo", 0.999)):
            share = getattr(self, name)
            if share is not None and not 0.0 < share <= most:
                raise InputError(f"workload.{name} is {share}, expected a number above 0 and at most {most}, or null")
        self.options()

    def options(self, threads: int | None = 1, build_quality: str = "medium") -> BakeOptions:
        """The library's value for it."""
        return BakeOptions(
            packet_width=self.packets,
            threads=threads,
            build_quality=build_quality,
            bounces=self.bounces,
            lights=self.lights.value,
            adaptive=self.adaptive,
            compaction=self.compaction.value,
            batch_rays=self.batch_rays,
            expansion=self.expansion,
        )


def _headline(record: Record) -> str:
    results = record.results
    own = median(record.samples[OWN])
    return (
        f"{results['rays_per_round'] / own / 1e6:.2f} million rays/s, {results['lane_utilisation']:.0%} of lanes used, "
        f"{say_mib(results['buffer_bytes'])} of rays in flight"
    )


def _rays_per_s(record: Record) -> Any:
    own, rays = series(OWN)(record), record.results.get("rays_per_round")
    return None if own is None or rays is None else rays / own


def _of_view(point: Point) -> frozenset[str]:
    names = {OWN, PLAIN}
    return frozenset(names | {WHOLE_MAP, WITHOUT_VIEW} if point.workload_options.priority else names)


def _over(upper: str, lower: str) -> Any:
    def ratios(record: Record) -> Any:
        above, below = series(upper)(record), series(lower)(record)
        return None if above is None or below is None else above / below

    return ratios


BAKE = Workload(
    name="bake",
    options=BakeSettings,
    columns=(
        *statistics_columns("bake_time{}_s", "a round of samples of the texels that come first", series(OWN)),
        *statistics_columns("rays_per_s{}", "rays that were traced in a second", _rays_per_s),
        *statistics_columns("speedup_vs_all_lanes{}", "every texel with a lane / this", over_own(series(PLAIN))),
        *statistics_columns("view_speedup{}", "a round without a view / this", over_own(series(WITHOUT_VIEW))),
        *statistics_columns("whole_map_cost{}", "the whole map, seen first / in rows", _over(WHOLE_MAP, WITHOUT_VIEW)),
        Column("rays_per_round", WHOLE, "rays that a round traces"),
        Column("lane_utilisation", REAL, "of the lanes of all stages that trace, those with a ray"),
        *(Column(f"{stage}_s", REAL, f"of a round, in the stage {stage}") for stage in STAGES),
        *(
            Column(f"{kind}time_to_rmse_{percent}_s", REAL, f"until the error {of} is {percent} %, by its variance")
            for kind, of in (("", "of the map"), ("visible_", "of what the view shows"))
            for percent in THRESHOLDS
        ),
        Column("buffer_bytes", WHOLE, "rays in flight"),
        Column("texels", WHOLE, "that are lit"),
        Column("charts", WHOLE, "in the map"),
        Column("texels_lost", WHOLE, "faces without a texel"),
        Column("map_occupancy", REAL, "share of the map that is lit"),
        Column("visible_share", REAL, "of its texels, those that the view shows"),
        Column("culling_map_s", REAL, "finding these by the point's method"),
        Column("atlas_s", REAL, "making charts and texels"),
    ),
    headline=_headline,
    room=__name__,
    samples=_of_view,
    judged=OWN,
    needs=("rays_per_round", "lane_utilisation", "buffer_bytes", "texels"),
)  # fmt: skip
