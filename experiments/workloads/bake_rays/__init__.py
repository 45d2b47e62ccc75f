"""Workload `bake_rays`: what alignment can do for rays of a bake that share their directions, with plan and build."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from statistics import median
from typing import Any

import numpy as np

from atra.errors import InputError
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import option
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over, over_own, series

ONE_BY_ONE, TOGETHER = "single_rays", "coherent_packets"
"""Names in the samples, beside the aligned rays: the same rays one by one, and in the widest packets."""

RASTERED, PATHS, DIRECT = "rasterised", "paths", "direct_light"
"""And where bundles carry light: rasterised; samples of a path tracer; and of the light that comes straight, which
bundles are given."""

PASS_SAMPLES = 4
"""Of a texel, in a round of either."""

CELLS = 128
"""Of a bundle's image, side by side, where its rays are aligned."""


class Use(Enum):
    """sun: rays of one direction from texels. sky: of several directions, each planned and built anew. bundle: rays of
    directions across the whole scene, all of whose hits are wanted. light: the same, and hits exchange their light."""

    sun = "sun"
    sky = "sky"
    bundle = "bundle"
    light = "light"


@dataclass(frozen=True)
class BakeRaysSettings:
    """Raises InputError for values that no bake could use."""

    use: Use = option(Use.sun, "what rays are for: sun, sky, bundle or light")
    positions: int = option(16, "sub-texel positions that rays of a direction start from")
    directions: int = option(1, "directions of a round, where the use is not the sun")
    map_size: int = option(512, "texels along a side of the map, and rays of a bundle")
    tile_size: int = option(8, "texels along a side of a tile")
    least_texels: int = option(16, "of a tile; rays of smaller ones are not asked for")

    def __post_init__(self) -> None:
        for name, most in (
            ("positions", 1 << 12),
            ("directions", 1 << 12),
            ("map_size", 1 << 13),
            ("tile_size", 1 << 10),
            ("least_texels", 1 << 20),
        ):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise InputError(f"workload.{name} is {value}, expected a whole number from 1 to {most}")


def _headline(record: Record) -> str:
    own, packets = (median(record.samples[name]) for name in (OWN, TOGETHER))
    return (
        f"packets {packets * 1e3:.1f} ms, aligned {own * 1e3:.1f} ms: {packets / own:.2f}x; "
        f"{record.results['rays_different']} of {record.results['rays_compared']} rays see something else"
    )


def _of_use(point: Point) -> frozenset[str]:
    others = (RASTERED, PATHS, DIRECT) if point.workload_options.use is Use.light else ()
    return frozenset((OWN, ONE_BY_ONE, TOGETHER, *others))


def _paths_s(record: Record) -> Any:
    """Seconds to the error, by the rounds of paths."""
    samples, passes = record.results.get("paths_samples_to_rmse_5"), series(PATHS)(record)
    return None if samples is None or passes is None else passes * samples / PASS_SAMPLES


def _bundles_s(record: Record) -> Any:
    """Seconds to the error, by the rounds of the fastest bundles, and those of the light that they are given."""
    directions = record.results.get("bundle_directions_to_rmse_5")
    if directions is None or RASTERED not in record.samples:
        return None
    rounds = [record.samples[name] for name in (OWN, ONE_BY_ONE, TOGETHER, RASTERED)]
    fastest = np.asarray(min(rounds, key=median), np.float64)
    given = np.asarray(record.samples[DIRECT], np.float64) * record.results["direct_samples"] / PASS_SAMPLES
    of_round = record.configuration["workload_options"]["directions"]
    return given + fastest * directions / of_round


BAKE_RAYS = Workload(
    name="bake_rays",
    options=BakeRaysSettings,
    columns=(
        *statistics_columns("aligned_time{}_s", "aligned rays, plan and build included", series(OWN)),
        *statistics_columns("single_over_aligned{}", "rays one by one / aligned", over_own(series(ONE_BY_ONE))),
        *statistics_columns("packets_over_aligned{}", "coherent packets / aligned", over_own(series(TOGETHER))),
        *statistics_columns(
            "aligned_over_raster{}", "aligned rays / rasterised ones", over(series(OWN), series(RASTERED))
        ),
        *statistics_columns(
            "paths_over_bundles{}", "time to an error of 5 %, paths / bundles", over(_paths_s, _bundles_s)
        ),
        *statistics_columns("paths_time_to_rmse_5{}_s", "until the error of paths is 5 %, by its variance", _paths_s),
        *statistics_columns("bundles_time_to_rmse_5{}_s", "the same of the fastest bundles, measured", _bundles_s),
        Column("paths_samples_to_rmse_5", REAL, "of a texel, until the error is 5 %, by their variance"),
        Column("direct_samples", WHOLE, "of the light that comes straight, which bundles are given"),
        Column("bundle_directions_to_rmse_5", REAL, "until their error is 5 %, as measured"),
        Column("bundle_directions_tried", WHOLE, "until then, or until it counts as not reached"),
        Column("bundle_error", REAL, "after these, relative"),
        Column("bundle_error_within_charts", REAL, "the same, of texels all around which their chart goes on"),
        Column("texels_within_charts", REAL, "share of the texels that count"),
        Column("bundle_rays_cut", REAL, "share of rays with more hits than are kept"),
        Column("bundle_hits_s", REAL, "of a rasterised direction, finding its hits"),
        Column("bundle_exchange_s", REAL, "of a rasterised direction, carrying light between them"),
        Column("texels_never_hit", REAL, "share of the texels that count"),
        Column("prepare_s", REAL, "of a round of aligned rays: plan and build"),
        Column("aligned_texel_share", REAL, "of all texels that are lit, those in such tiles of flat charts"),
        Column("tiles", WHOLE, "of flat charts"),
        Column("rays_compared", WHOLE, "of which visibility, or the number of hits, was compared"),
        Column("rays_different", WHOLE, "of these, those that see something else", over=max),
        Column("rays_undecided", WHOLE, "others whose rounding decides: at a triangle's rim, or on one", over=max),
    ),
    headline=_headline,
    room=__name__,
    samples=_of_use,
    judged=OWN,
    needs=("rays_compared", "rays_different"),
)  # fmt: skip
