"""Workload `render`: whole pictures, hybrid or path traced, with the point's own method for primary visibility, and the
same with single rays and packets in its place, round by round."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np

from atra.light.pictures.hybrid import Hybrid
from atra.light.pictures.paths import Paths
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.light import ROBUST
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import BESIDE_BASELINES, OWN, PACKETS, SINGLE, over_own, packets_width, series
from experiments.workloads.images import Images
from experiments.workloads.resources import Preparation, Resources, say_ms
from experiments.workloads.typed import columns_of, needs_of

STAGES = {
    "primary": "primary visibility",
    "surfaces": "what is seen: places, normals, colours",
    "generate": "rays made",
    "shadow": "Embree: rays to the lights",
    "occlusion": "Embree: rays into the sky",
    "depth_first": "paths followed one by one, Embree within",
    "accumulate": "light summed",
    "other": "waiting, Python",
}
"""Stages of both renderers, in the order of figures, and what each does."""

_EMBREE = ("primary", "shadow", "occlusion")


@dataclass(frozen=True)
class RenderOptions(Settings):
    """Raises InputError for values that no picture can have."""

    robust_rays: bool = option(True, ROBUST)
    frame: str = option("hybrid", "how a picture is made: hybrid or path", choices=("hybrid", "path"))
    samples: int = whole(16, "samples of each pixel of a picture", 1)
    jitter: str = option(
        "shared",
        "sub-pixel offset of rays: shared = one for all pixels, new for each sample, off = the centre",
        choices=("shared", "off"),
    )
    shadow_rays: int = option(1, "rays to each light per sample, 0 to 64")
    occlusion_rays: int = option(1, "rays into the sky per sample, 0 to 64")
    occlusion_part: float = option(0.1, "hybrid: how far things occlude, of the diagonal of the scene's box")
    max_depth: int = option(5, "most rays of a path, the primary ray included")
    lights: str = option(
        "aimed",
        "how emitters are found: aimed = a ray from every surface but mirrors is aimed at one, and both ways share its "
        "light, found = by scattered rays alone, which never meet lamps without extent",
        choices=("aimed", "found"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.of_library(1.0)

    def of_library(self, diagonal: float) -> dict[str, Any]:
        """The renderer's own options, checked. diagonal: of the scene's box."""
        of_both: dict[str, Any] = {"jitter": self.jitter, "robust": self.robust_rays}
        if self.frame == "path":
            of_paths: dict[str, Any] = of_both | {"bounces": self.max_depth - 1, "lights": self.lights}
            Paths(**of_paths)
            return of_paths
        hybrid: dict[str, Any] = of_both | {
            "shadow_rays": self.shadow_rays,
            "occlusion_rays": self.occlusion_rays,
            "occlusion_length": self.occlusion_part * diagonal,
            "most_samples": None,
        }
        Hybrid(**hybrid)
        return hybrid


def primary(name: str) -> str:
    """Name in the samples of what primary visibility took of a picture, of those called `name`."""
    return f"{name}_primary"


def _forecast(record: Record) -> Any:
    """Amdahl: packets' picture over the same with primary visibility as fast as the point's own."""
    width = packets_width(record)
    own = series(primary(OWN))(record)
    if width is None or own is None:
        return None
    whole, part = (series(name)(record) for name in (PACKETS[width], primary(PACKETS[width])))
    return whole / (whole - part + own)


def _stage(name: str) -> Any:
    return lambda record: record.results.get("stages", {}).get(name)


def stage_column(name: str) -> str:
    """The column of a stage."""
    return f"stage_{name}_s"


def outside_embree(stages: Mapping[str, float]) -> float | None:
    """The share of a picture's time that is neither primary visibility nor Embree's; None where that is not known."""
    if not stages or "depth_first" in stages:  # Embree within
        return None
    return 1.0 - sum(stages.get(name, 0.0) for name in _EMBREE) / sum(stages.values())


def _break_even(record: Record) -> int | None:
    """None where the packets' samples are the faster ones."""
    width, own = packets_width(record), series(OWN)(record)
    if width is None or own is None or "baseline_build_time_s" not in record.results:
        return None
    results, samples = record.results, record.configuration["workload_options"]["samples"]
    ahead_s = float(np.median(series(PACKETS[width])(record) - own)) / samples
    behind_s = results["plan_time_s"] + results["build_time_s"] - results["baseline_build_time_s"]
    if behind_s <= 0:
        return 1
    return max(1, ceil(behind_s / ahead_s)) if ahead_s > 0 else None


def _headline(record: Record) -> str:
    options, own = record.configuration["workload_options"], series(OWN)(record)
    width = packets_width(record)
    gain = np.median(over_own(series(PACKETS[width]))(record)) if width is not None else np.nan
    shares = record.results["stages"]["primary"] / np.median(own)
    return (
        f"{say_ms(float(np.median(own)))} a picture of {options['samples']} samples, {gain:.2f}x with packets, "
        f"{np.median(_forecast(record)):.2f}x by Amdahl; primary {shares:.0%}"
    )


RENDER = Workload(
    name="render",
    options=RenderOptions,
    columns=(
        *columns_of(Resources, Images),
        Column("pixels_unlike", WHOLE, "pixels of another colour where rtcIntersect1 sees the same triangle", over=max),
        *columns_of(Preparation),
        *BESIDE_BASELINES.columns,
        *statistics_columns("primary_time{}_s", "primary visibility of a picture", series(primary(OWN))),
        *statistics_columns("speedup_forecast{}", "the gain over packets that Amdahl's law forecasts", _forecast),
        *(Column(stage_column(name), REAL, f"in a picture: {help}", _stage(name)) for name, help in STAGES.items()),
        Column("stages_over_frame", REAL, "sum of all stages / time of a picture"),
        Column(
            "outside_embree", REAL, "share of a picture's time outside primary visibility and Embree",
            lambda record: outside_embree(record.results.get("stages", {})),
        ),
        Column("break_even_subframes", WHOLE, "samples after which plan and build are paid back", _break_even),
    ),
    headline=_headline,
    package=__name__,
    samples=lambda _: frozenset({OWN, SINGLE, primary(OWN), primary(SINGLE)}),
    needs=(*needs_of(Resources, Images, Preparation), "rays", "stages", "stages_over_frame"),
    optional=BESIDE_BASELINES.optional,
    judged=OWN,
    canary=BESIDE_BASELINES.canary,
)  # fmt: skip
