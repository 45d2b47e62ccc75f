"""What the article on a progressive lightmapper claims, and what we set ourselves, judged by a table of `bake`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import Claim, Judgement, NotMeasuredError
from experiments.results.verdicts import Bounds, Which, ratio_judge, value_judge
from experiments.workloads.bake import RARE, STAGES
from experiments.workloads.bake.judges import judge_buffers, judge_culling_map, judge_mitsuba

_WHOLE = "By the whole 95 % interval over processes, on every scene."


def _where(rows: pd.DataFrame, **values: object) -> pd.Series:
    """Which rows have these values."""
    found = rows["scene"].notna()
    for name, value in values.items():
        found &= column(rows, name).eq(value).fillna(False).astype(bool)
    return found


def _against(what: str, **values: object) -> Which:
    return lambda rows: _where(rows, against=what, **values)


def _no_gpu(table: pd.DataFrame | None) -> Judgement:
    raise NotMeasuredError("there is no GPU here")


def _share_of(rows: pd.DataFrame, stages: tuple[str, ...]) -> object:
    whole = sum(numbers(rows, f"{stage}_s") for stage in STAGES)
    return sum(numbers(rows, f"{stage}_s") for stage in stages) / whole


def _plain(compaction: str) -> Which:
    return _against("compaction", compaction=compaction, priority=False, albedo="own", packets="1")


def _dark(rows: pd.DataFrame) -> pd.Series:
    bounces = _against("compaction", compaction="bounces", packets="1")(rows)
    return bounces & column(rows, "albedo").ne("own")


def _emptiest(which: Which) -> Which:
    def found(rows: pd.DataFrame) -> pd.Series:
        chosen = which(rows)
        occupancy = pd.to_numeric(column(rows, "occupancy").where(chosen), errors="coerce")
        return chosen & occupancy.eq(occupancy.min())

    return found


def _view(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, priority=True, compaction="bounces") & column(rows, "view_speedup").notna()


def _half_seen(rows: pd.DataFrame) -> pd.Series:
    return _view(rows) & pd.Series(numbers(rows, "visible_share") <= 0.5, rows.index)


def _natural(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, occupancy="any")


def _ratio(
    id: str, section: str, text: str, reported: str, how: str, name: str, which: Which, bound: Bounds
) -> Claim:  # fmt: skip
    return Claim(id, section, text, reported, f"{how} {_WHOLE}", {"": ratio_judge(name, which, bound)})


def _share(
    id: str, section: str, text: str, reported: str, how: str,
    share: Callable[[pd.DataFrame], object], which: Which, bound: Bounds, counted: bool = True,
) -> Claim:  # fmt: skip
    told = "Counted, on every scene." if counted else _WHOLE
    return Claim(id, section, text, reported, f"{how} {told}", {"": value_judge(share, which, bound, counted)})


_ARTICLE, _OURS = "article", "targets"
_MORE = Bounds(low=1.0)

CLAIMS = (
    _share(
        "occupancy", _ARTICLE, "In practice charts cover 50 to 70 % of a map.", "50 to 70 %",
        "Share of the map that triangles touch, as xatlas packs it.",
        lambda rows: numbers(rows, "map_occupancy"), _natural, Bounds(0.5, 0.7),
    ),
    _ratio(
        "compaction-tracing", _ARTICLE, "Compaction speeds tracing.", "faster",
        "Stages that trace with a lane for every texel, over those with lanes for lit ones alone, above 1.",
        "tracing_vs_other", _plain("texels"), _MORE,
    ),
    _ratio(
        "compaction-shading", _ARTICLE, "Compaction speeds shading.", "faster",
        "The same of stages that shade.", "shading_vs_other", _plain("texels"), _MORE,
    ),
    _ratio(
        "compaction-bounces", _ARTICLE, "Compaction between bounces gains, too.", "faster",
        "Time with lit lanes alone over that of lanes that go on, above 1.",
        "speedup_vs_other", _plain("bounces"), _MORE,
    ),
    _ratio(
        "occupancy-no-matter", _ARTICLE, "With it rays/s do not depend on how full a map is.", "independent",
        "Rays/s on the emptiest map over those on the fullest, 0.95 to 1.05.",
        "rays_speedup_vs_other", _against("occupancy"), Bounds(0.95, 1.05),
    ),
    _ratio(
        "side-by-side", _ARTICLE, "Rays of a texel that lie side by side are faster.", "faster",
        "Rays/s over those of rays one sample after the other, above 1.",
        "rays_speedup_vs_other", _against("expansion"), _MORE,
    ),
    _share(
        "full-batches", _ARTICLE, "Expansion keeps batches full although few texels come first.", "full",
        "Of the rays that a batch of seen texels has room for, those in it, at least half.",
        lambda rows: numbers(rows, "batch_fill"),
        lambda rows: _against("expansion")(rows) & pd.Series(numbers(rows, "expansion") >= 16, rows.index),
        Bounds(low=0.5),
    ),
    Claim(
        "buffers", _ARTICLE, "Buffers do not grow with the map.", "independent",
        "Bytes of rays in flight on the largest map over those on the smallest, at most 1.02.", {"": judge_buffers},
    ),
    _share(
        "rare-stages", _ARTICLE, "Expansion and gathering are rare.", "rare",
        "Share of both, and of the order of texels, in a round, at most 5 % (our reading).",
        partial(_share_of, stages=RARE), _plain("bounces"), Bounds(high=0.05), counted=False,
    ),
    _ratio(
        "view-sooner", _ARTICLE, "What the view shows is done sooner when it comes first.", "sooner",
        "A round of the whole map over one of seen texels, above 1.", "view_speedup", _view, _MORE,
    ),
    _ratio(
        "roulette", _ARTICLE, "Roulette shortens the time to an error.", "shorter",
        "Variance times time without it over those with it, above 1.",
        "quality_vs_other", _against("roulette"), _MORE,
    ),
    _ratio(
        "panorama", _ARTICLE, "A sky that is found by both ways shortens the time to an error.", "shorter",
        "Variance times time with a sky found by chance alone over those with both, above 1.",
        "quality_vs_other", _against("environment", environment="mis"), _MORE,
    ),
    _ratio(
        "light-grid", _ARTICLE, "A grid of lights shortens the time to an error.", "shorter",
        "Variance times time with any light as likely over those with the grid, of the most lamps, above 1.",
        "quality_vs_other", _against("lights", lamps=256), _MORE,
    ),
    _ratio(
        "opaque", _ARTICLE, "Opaque scenes pay nothing for translucency.", "nothing",
        "Time with code for it, of the same scene but for one face that is not quite opaque, over that of the code "
        "which opaque scenes run, at most 1.03.",
        "speedup_vs_other", _against("translucency"), Bounds(high=1.03),
    ),
    _share(
        "no-waiting", _ARTICLE, "There are no points at which all must wait.", "none",
        "Share of a round outside of all its stages, at most 1 % (our reading).",
        partial(_share_of, stages=("other",)), _plain("bounces"), Bounds(high=0.01), counted=False,
    ),
    Claim(
        "culling-map", _OURS, "Visible-first rays find what a view shows 1.5 times sooner than packets.",
        "1.5", f"Seconds of packets over those of visible-first rays. {_WHOLE}",
        {"": judge_culling_map},
    ),
    _share(
        "culling-map-share", _OURS, "What a view shows is found in a small share of a bake.", "small",
        "Median seconds of visible-first rays, over those until what is seen has an error of 5 %, at most 0.05.",
        lambda rows: numbers(rows, "culling_map_s") / numbers(rows, "visible_time_to_rmse_5_s"),
        lambda rows: _where(rows, priority=True, method=VISIBLE_FIRST.name), Bounds(high=0.05), counted=False,
    ),
    Claim(
        "gpu", _ARTICLE, "GPUs are an order of magnitude faster than CPUs (a goal).", "10", "",
        {"": _no_gpu},
    ),
    _ratio(
        "target-texels", _OURS, "Lanes for lit texels alone: 1.15 times the rays/s on the emptiest map.", "1.15",
        "Rays/s over those with a lane for every texel, at least 1.15.",
        "rays_speedup_vs_other", _emptiest(_plain("texels")), Bounds(low=1.15),
    ),
    _ratio(
        "target-bounces", _OURS, "Lanes that go on alone: 1.15 times as fast, with an albedo of 0.5.", "1.15",
        "Time with lit lanes over that of lanes that go on, at least 1.15.",
        "speedup_vs_other", _dark, Bounds(low=1.15),
    ),
    _ratio(
        "target-view", _OURS, "What is seen, half the map at most, reaches its error 1.6 times sooner.",
        "1.6", "A round of the whole map over one of seen texels, at least 1.6.",
        "view_speedup", _half_seen, Bounds(low=1.6),
    ),
    _ratio(
        "target-whole-map", _OURS, "The whole map takes at most 1.05 times as long with seen texels first.", "1.05",
        "Time of the whole map, seen first over by place, at most 1.05.", "whole_map_cost", _view, Bounds(high=1.05),
    ),
    _share(
        "target-denoised", _OURS, "Denoised at a quarter of the samples a map is no worse than raw.", "1.0",
        "Error denoised over the raw one of four times the samples, against a map of other random numbers, at most 1.",
        lambda rows: numbers(rows, "denoised_ratio"), lambda rows: _where(rows, denoise=True), Bounds(high=1.0),
    ),
    _share(
        "target-seams", _OURS, "Stitching leaves a quarter of the difference at seams.", "0.25",
        "Root mean square after over before, at most 0.25.",
        lambda rows: numbers(rows, "seam_step_ratio"), lambda rows: _where(rows, denoise=True), Bounds(high=0.25),
    ),
    Claim(
        "target-mitsuba", _OURS, "As many paths a second as Mitsuba 3, in one thread.", "1.0",
        "Time of as many paths by Mitsuba over that of a round, where both find the same light, at least 1; without "
        f"what Mitsuba loses as it takes first rays for those of a camera. {_WHOLE}",
        {"": partial(judge_mitsuba, which=_against("mitsuba", threads=1))},
    ),
)  # fmt: skip
