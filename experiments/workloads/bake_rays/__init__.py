"""Workload `bake_rays`: what alignment can do for rays of a bake that share their directions, with plan and build."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from statistics import median

from atra.errors import InputError
from atra.tracing.options import option
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over_own, series

ONE_BY_ONE, TOGETHER = "single_rays", "coherent_packets"
"""Names in the samples, beside the aligned rays: the same rays one by one, and in the widest packets."""

CELLS = 128
"""Largest number of cells side by side in a bundle's image."""


class Use(Enum):
    """sun: rays of one direction from texels. sky: rays of several directions, each planned and built anew. bundle: all
    hits of parallel rays across the whole scene."""

    sun = "sun"
    sky = "sky"
    bundle = "bundle"


@dataclass(frozen=True)
class BakeRaysSettings:
    """Raises InputError for values that no bake could use."""

    use: Use = option(Use.sun, "what rays are for: sun, sky or bundle")
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


BAKE_RAYS = Workload(
    name="bake_rays",
    options=BakeRaysSettings,
    columns=(
        *statistics_columns("aligned_time{}_s", "aligned rays, plan and build included", series(OWN)),
        *statistics_columns("single_over_aligned{}", "rays one by one / aligned", over_own(series(ONE_BY_ONE))),
        *statistics_columns("packets_over_aligned{}", "coherent packets / aligned", over_own(series(TOGETHER))),
        Column("prepare_s", REAL, "of a round of aligned rays: plan and build"),
        Column("aligned_texel_share", REAL, "of all texels that are lit, those in such tiles of flat charts"),
        Column("tiles", WHOLE, "of flat charts"),
        Column("rays_compared", WHOLE, "of which visibility, or the number of hits, was compared"),
        Column("rays_different", WHOLE, "of these, those that see something else", over=max),
        Column("rays_undecided", WHOLE, "others whose rounding decides: at a triangle's rim, or on one", over=max),
    ),
    headline=_headline,
    room=__name__,
    samples=lambda _: frozenset((OWN, ONE_BY_ONE, TOGETHER)),
    judged=OWN,
    needs=("rays_compared", "rays_different"),
)  # fmt: skip
