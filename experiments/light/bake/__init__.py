"""Workload `bake`: samples of a lightmap, beside those of a bake that lacks one of its means."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.light.lightmaps.paths import BakeOptions
from atra.light.oidn import check_denoiser
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Point, Workload
from experiments.harness.records import Record
from experiments.light import ROBUST
from experiments.results.statistics import Series, statistics_columns
from experiments.workloads.baselines import OWN, over, over_own, series
from experiments.workloads.resources import say_mib

OTHER, WHOLE_MAP, WITHOUT_VIEW = "other", "whole_map", "without_view"
"""Names in the samples, beside the point's own: the bake it is compared with; the whole map, visible texels first; the
whole map, neighbouring texels side by side."""

STAGES = ("order", "generate", "aim", "shadow", "scatter", "trace", "shade", "compact", "gather", "other")
TRACING, SHADING, RARE = ("shadow", "trace"), ("aim", "scatter", "shade"), ("order", "generate", "gather")
"""Stages in Embree, stages that compute light, and stages run once a sample."""

THRESHOLDS = (10, 5, 2)
"""Relative errors of a map in percent whose times are told."""

FULLEST = 0.7
"""Share of texels that are lit in the map that emptier ones are compared with."""


AGAINST = (
    "nothing", "compaction", "occupancy", "expansion", "roulette", "environment", "translucency", "lights", "mitsuba",
)  # fmt: skip
"""What a round is compared with: nothing; less compaction; the fullest map; no expansion; no roulette; no sampling of
the sky; code for translucent faces; choice of lamps by their power; as many paths by Mitsuba 3."""


@dataclass(frozen=True)
class BakeSettings(Settings):
    """Raises InputError for values that no bake could use."""

    robust_rays: bool = option(True, ROBUST)
    size: int = whole(512, "texels along a side of the map, before a lower occupancy makes it larger", 8, 1 << 14)
    occupancy: float | None = option(
        None, "share of the map that is lit, by empty rows; null: what xatlas makes", null="any"
    )
    samples: int = whole(16, "samples per texel and round", 1, 1 << 20)
    final_samples: int = whole(512, "samples per texel of a finished map, made after the rounds", 1, 1 << 20)
    bounces: int = option(4, "most reflections of light before it reaches a texel; 0 = direct light alone")
    roulette_from: int | None = option(
        2, "bounces after which Russian roulette by albedo ends paths; null = never", null="never"
    )
    materials: str = option(
        "plain",
        "surfaces and lights: plain = of measurements: grey, a sun and a sky, but for the built-in box; own = as "
        "`atra render` shows the scene",
        choices=("plain", "own"),
    )
    albedo: float | None = option(None, "albedo of all faces; null: the scene's own", null="own")
    panorama: bool = option(False, "whether the sky is a panorama with a sun in it, and the only light")
    environment: str = option(
        "mis",
        "what finds a panorama's light: bsdf = scattered rays, mis = also rays aimed at bright parts, by the power "
        "heuristic; for other skies always scattered rays",
        choices=("mis", "bsdf"),
    )
    lamps: int = whole(0, "point lights all over the scene, in place of its own; 0: its own", 0, 1 << 16)
    compaction: str = option(
        "bounces",
        "which lanes are packed together: none = all texels of the map, texels = lit texels, bounces = also the "
        "paths that continue after every bounce",
        choices=("none", "texels", "bounces"),
    )
    priority: bool = option(False, "whether texels that the view shows come first")
    lights: str = option(
        "aimed",
        "how lamps are chosen: aimed = by their power, grid = by what they may give in a cell of a grid, with less "
        "noise for many lamps",
        choices=("aimed", "grid"),
    )
    batch_rays: int = whole(1 << 19, "rays in flight, of all threads together; determines the memory", 1 << 8, 1 << 26)
    expansion: int = whole(16, "samples of a texel side by side in a batch", 1, 1 << 12)
    denoise: bool = option(False, "whether the finished map is denoised")
    against: str = option("nothing", "bake that is timed beside, in the same rounds", choices=AGAINST)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, most in (("occupancy", 0.95), ("albedo", 0.999)):
            share = getattr(self, name)
            if share is not None and not 0.0 < share <= most:
                raise InputError(f"workload.{name} is {share}, expected a number above 0 and at most {most}, or null")
        if self.against == "mitsuba":
            light: dict[str, Any] = {"albedo": self.albedo, "panorama": self.panorama, "lamps": self.lamps or None}
            light["materials"] = None if self.materials == "plain" else self.materials
            for name, value in light.items():
                if value not in (None, False):
                    raise InputError(
                        f"workload.{name} is {value!r} with workload.against=mitsuba, which is handed all texels of a "
                        "scene in its own light; leave it out"
                    )
        for name, of_waves in (("priority", (True,)), ("against", ("compaction", "expansion", "environment"))):
            if self.is_depth_first and getattr(self, name) in of_waves:
                raise InputError(
                    f"workload.{name} is {getattr(self, name)} for a bake that is denoised or held against Mitsuba, by "
                    "paths one after the other; leave it out"
                )
        self.options()

    def options(self, threads: int | None = 1, build_quality: str = "medium") -> dict[str, Any]:
        """Options of the baker that is measured, checked."""
        given = {name: getattr(self, name) for name in ("bounces", "roulette_from", "lights")}
        of_both = vars(BakeOptions(threads, build_quality, self.robust_rays, **given))
        of_waves = "environment", "compaction", "batch_rays", "expansion"
        return of_both if self.is_depth_first else of_both | {name: getattr(self, name) for name in of_waves}

    @property
    def is_depth_first(self) -> bool:
        """Whether the library's baker is measured, for what Mitsuba and finishing are held against, or one in waves."""
        return self.denoise or self.against == "mitsuba"

    @property
    def other(self) -> dict[str, Any] | None:
        """Options that differ in the bake it is compared with; None if that is no bake of ours."""
        less = {"texels": "none", "bounces": "texels"}
        nothing = self.against == "compaction" and self.compaction not in less
        if nothing or self.against in ("nothing", "mitsuba"):
            return None
        changes: dict[str, dict[str, Any]] = {
            "compaction": {"compaction": less.get(self.compaction)},
            "expansion": {"expansion": 1},
            "roulette": {"roulette_from": None},
            "environment": {"environment": "bsdf"},
            "lights": {"lights": "aimed"},
        }
        return changes.get(self.against, {})


def _headline(record: Record) -> str:
    results = record.results
    own = median(record.samples[OWN])
    return (
        f"{results['rays_per_round'] / own / 1e6:.2f} million rays/s, {results['lane_utilisation']:.0%} of lanes used, "
        f"{say_mib(results['buffer_bytes'])} of rays in flight"
    )


def _problem(point: Point) -> str | None:
    """Why the finished map cannot be denoised, where it is to be."""
    try:
        if point.workload_options.denoise:
            check_denoiser()
    except InputError as error:
        return str(error)
    return None


def _rays_per_s(name: str = OWN, rays: str = "rays_per_round") -> Series:
    def read(record: Record) -> Any:
        taken, count = series(name)(record), record.results.get(rays)
        return None if taken is None or count is None else count / taken

    return read


def _of_view(point: Point) -> frozenset[str]:
    settings = point.workload_options
    is_held = settings.other is not None or settings.against == "mitsuba"
    others = {OTHER} if is_held else {WHOLE_MAP, WITHOUT_VIEW} if settings.priority else set()
    return frozenset({OWN, *others})


def _result(name: str) -> Series:
    """One value a process."""

    def read(record: Record) -> Any:
        value = record.results.get(name)
        return None if not value else np.array([value])

    return read


def _quality(record: Record) -> Any:
    """Ratio of variance times time, the time to reach an error."""
    ratios, variances = over_own(series(OTHER))(record), _result("variance_ratio")(record)
    return None if ratios is None or variances is None else ratios * variances


_RAYS, _OTHER_RAYS = _rays_per_s(), _rays_per_s(OTHER, "other_rays_per_round")

BAKE = Workload(
    name="bake",
    options=BakeSettings,
    columns=(
        *statistics_columns("bake_time{}_s", "a round of samples of the texels that come first", series(OWN)),
        *statistics_columns("rays_per_s{}", "rays that were traced in a second", _RAYS),
        *statistics_columns("speedup_vs_other{}", "time of the other bake / time of this one", over_own(series(OTHER))),
        *statistics_columns(
            "speedup_vs_best_other{}", "speedup_vs_other, Mitsuba's first rays as they are", _result("best_other_ratio")
        ),
        *statistics_columns("rays_speedup_vs_other{}", "rays/s, this / the other's", over(_RAYS, _OTHER_RAYS)),
        *statistics_columns("quality_vs_other{}", "time to an error, the other's / this", _quality),
        *statistics_columns("tracing_vs_other{}", "stages that trace, the other's / this", _result("tracing_ratio")),
        *statistics_columns("shading_vs_other{}", "stages that shade, the other's / this", _result("shading_ratio")),
        *statistics_columns("view_speedup{}", "a round without a view / this", over_own(series(WITHOUT_VIEW))),
        *statistics_columns(
            "whole_map_cost{}", "the whole map, seen first / by place", over(series(WHOLE_MAP), series(WITHOUT_VIEW))
        ),
        Column("rays_per_round", WHOLE, "rays that a round traces"),
        Column("other_light_ratio", REAL, "mean light of all texels, Mitsuba's / this"),
        Column("other_light_error", REAL, "standard error of other_light_ratio"),
        Column("lane_utilisation", REAL, "share of SIMD lanes with a ray, in stages that trace"),
        Column("batch_fill", REAL, "share of a batch's room that texels fill with rays"),
        *(Column(f"{stage}_s", REAL, f"time of stage {stage} in a round") for stage in STAGES),
        *(
            Column(f"{kind}time_to_rmse_{percent}_s", REAL, f"time until the error {of} is {percent} %")
            for kind, of in (("", "of the map"), ("visible_", "of what the view shows"))
            for percent in THRESHOLDS
        ),
        Column("buffer_bytes", WHOLE, "memory of the rays in flight"),
        Column("texels", WHOLE, "texels that are lit"),
        Column("charts", WHOLE, "charts in the map"),
        Column("map_occupancy", REAL, "share of the map that is lit"),
        Column("visible_share", REAL, "share of the texels that the view shows"),
        Column("culling_map_s", REAL, "time to find the visible texels"),
        Column("seam_step_ratio", REAL, "difference of both sides of seams, after / before stitching"),
        Column("denoised_ratio", REAL, "error denoised / raw of 4 x as many samples, the same in every process"),
    ),
    headline=_headline,
    package=__name__,
    samples=_of_view,
    judged=OWN,
    needs=("rays_per_round", "lane_utilisation", "buffer_bytes", "texels"),
    problem=_problem,
    told=(
        "rays_per_s", "lane_utilisation", "speedup_vs_other", "quality_vs_other", "view_speedup", "whole_map_cost",
    ),
)  # fmt: skip
