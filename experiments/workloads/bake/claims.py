"""What the article on a progressive lightmapper claims, and what we set ourselves, judged by a table of `bake`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf

import numpy as np
import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.methods.pixel import PIXEL
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED, Claim, Judgement
from experiments.results.table import workload_rows
from experiments.workloads.bake import BAKE, STAGES, Against, Compaction, Environment

_WHOLE = "By the whole 95 % interval over processes, on all scenes but one."

_FORECAST = 1.5
"""Of packets over visible-first rays, written down before anything was measured."""

Which = Callable[[pd.DataFrame], pd.Series]


@dataclass(frozen=True)
class Bound:
    """Between which numbers a ratio is to lie."""

    low: float = -inf
    high: float = inf


def _where(rows: pd.DataFrame, **values: object) -> pd.Series:
    """Which rows have these values."""
    found = rows["scene"].notna()
    for name, value in values.items():
        found &= column(rows, name).eq(value).fillna(False).astype(bool)
    return found


def _against(what: Against, **values: object) -> Which:
    return lambda rows: _where(rows, against=what.value, **values)


def judge_ratio(table: pd.DataFrame | None, name: str, which: Which, bound: Bound) -> Judgement:
    """Whether a ratio lies within its bound on all scenes but one, by its whole interval on each; it fails where it
    lies outside on more than one."""
    rows = None if table is None else workload_rows(table, BAKE.name)
    if rows is None or f"{name}_low" not in rows:
        return Judgement(NOT_MEASURED, why="no point of it is in the table")
    rows = rows[which(rows) & rows[f"{name}_low"].notna()]
    if not len(rows):
        return Judgement(NOT_MEASURED, why="no point of it was measured by three processes")
    low, high = numbers(rows, f"{name}_low"), numbers(rows, f"{name}_high")
    right = pd.Series((low >= bound.low) & (high <= bound.high), rows["scene"]).groupby(level=0).all()
    wrong = pd.Series((high < bound.low) | (low > bound.high), rows["scene"]).groupby(level=0).any()
    told = "; ".join(_span(scene, same[name]) for scene, same in rows.groupby("scene", sort=False, observed=True))
    spanned, spared = f"{low.min():.2f} to {high.max():.2f}", int(len(right) > 1)
    if int((~right).sum()) <= spared:
        return Judgement(HOLDS, told, spanned)
    verdict = DOES_NOT_HOLD if int(wrong.sum()) > spared else UNDECIDED
    return Judgement(verdict, told, spanned, f"inside on {int(right.sum())} of {len(right)} scenes")


def _span(scene: object, values: pd.Series) -> str:
    """ "sponza 1.20", or "sponza 1.20 to 1.31" of several points."""
    low, high = f"{values.min():.2f}", f"{values.max():.2f}"
    return f"{scene} {low}" if low == high else f"{scene} {low} to {high}"


def judge_shares(
    table: pd.DataFrame | None, share: Callable[[pd.DataFrame], object], which: Which, bound: Bound
) -> Judgement:
    """Whether what every process finds alike lies within its bound, on all scenes but one."""
    rows = None if table is None else workload_rows(table, BAKE.name)
    rows = None if rows is None else rows[which(rows) & rows["status"].eq("ok")]
    if rows is None or not len(rows):
        return Judgement(NOT_MEASURED, why="no point of it is in the table")
    values = pd.Series(np.asarray(share(rows), np.float64), rows["scene"])
    values = values[np.isfinite(values)].groupby(level=0, sort=False).median()
    if not len(values):
        return Judgement(NOT_MEASURED, why="no point tells")
    told = "; ".join(f"{scene} {value:.2f}" for scene, value in values.items())
    outside = int((~values.between(bound.low, bound.high)).sum())
    if outside <= int(len(values) > 1):
        return Judgement(HOLDS, told)
    return Judgement(DOES_NOT_HOLD, told, None, f"outside on {outside} of {len(values)} scenes")


def judge_buffers(table: pd.DataFrame | None) -> Judgement:
    """Bytes of rays in flight on the largest map over those on the smallest, with equal batches."""
    rows = None if table is None else workload_rows(table, BAKE.name)
    if rows is not None:
        rows = rows[rows["status"].eq("ok") & ~rows["priority"].eq(True) & rows["buffer_bytes"].notna()]
    ratios = {}
    for _, same in () if rows is None else rows.groupby(["scene", "batch_rays"], observed=True):
        if same["size"].nunique() > 1:
            of_size = same.groupby("size")["buffer_bytes"].max()
            ratios[same["scene"].iloc[0]] = float(of_size.iloc[-1]) / float(of_size.iloc[0])
    if not ratios:
        return Judgement(NOT_MEASURED, why="no two sizes of a map with equal batches are in the table")
    told = "; ".join(f"{scene} {ratio:.3f}" for scene, ratio in ratios.items())
    if max(ratios.values()) <= 1.02:
        return Judgement(HOLDS, told)
    return Judgement(DOES_NOT_HOLD, told, None, "larger maps take more")


def judge_culling_map(table: pd.DataFrame | None) -> Judgement:
    """Seconds in which packets find what a view shows over those of the visible-first method, on all scenes but one."""
    rows = None if table is None else workload_rows(table, BAKE.name)
    ratios = {}
    for scene, same in () if rows is None else rows.groupby("scene", sort=False):
        packets, first = (
            same.loc[same["method"].eq(method.name), "culling_map_s"].dropna() for method in (PIXEL, VISIBLE_FIRST)
        )
        if len(packets) and len(first):
            ratios[scene] = float(packets.median() / first.median())
    if not ratios:
        return Judgement(NOT_MEASURED, why="no scene was searched by both methods")
    told = "; ".join(f"{scene} {ratio:.2f}" for scene, ratio in ratios.items())
    below = sum(ratio < _FORECAST for ratio in ratios.values())
    if below <= int(len(ratios) > 1):
        return Judgement(HOLDS, told)
    return Judgement(DOES_NOT_HOLD, told, None, f"less than {_FORECAST:g} on {below} of {len(ratios)} scenes")


def _not_measured(table: pd.DataFrame | None, why: str) -> Judgement:
    return Judgement(NOT_MEASURED, why=why)


def _share_of(rows: pd.DataFrame, stages: tuple[str, ...]) -> object:
    whole = sum(numbers(rows, f"{stage}_s") for stage in STAGES)
    return sum(numbers(rows, f"{stage}_s") for stage in stages) / whole


def _plain(compaction: Compaction) -> Which:
    return _against(Against.compaction, compaction=compaction.value, priority=False, albedo="own", packets="1")


def _dark(rows: pd.DataFrame) -> pd.Series:
    bounces = _against(Against.compaction, compaction=Compaction.bounces.value, packets="1")(rows)
    return bounces & column(rows, "albedo").ne("own")


def _emptiest(which: Which) -> Which:
    def found(rows: pd.DataFrame) -> pd.Series:
        chosen = which(rows)
        occupancy = pd.to_numeric(column(rows, "occupancy").where(chosen), errors="coerce")
        return chosen & occupancy.eq(occupancy.min())

    return found


def _view(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, priority=True, compaction=Compaction.bounces.value) & column(rows, "view_speedup").notna()


def _half_seen(rows: pd.DataFrame) -> pd.Series:
    return _view(rows) & pd.Series(numbers(rows, "visible_share") <= 0.5, rows.index)


def _natural(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, occupancy="any")


def _ratio(
    id: str, section: str, text: str, reported: str, how: str, name: str, which: Which, bound: Bound
) -> Claim:  # fmt: skip
    judges = {"": partial(judge_ratio, name=name, which=which, bound=bound)}
    return Claim(id, section, text, reported, f"{how} {_WHOLE}", judges)


_ARTICLE, _OURS = "article", "targets"
_MORE = Bound(low=1.0)

CLAIMS = (
    Claim(
        "occupancy", _ARTICLE, "In practice charts cover 50 to 70 % of a map.", "50 to 70 %",
        "Share of the map that triangles touch, as xatlas packs it; on all scenes but one.",
        {"": partial(judge_shares, share=lambda rows: numbers(rows, "map_occupancy"), which=_natural,
                     bound=Bound(0.5, 0.7))},
    ),
    _ratio(
        "compaction-tracing", _ARTICLE, "Compaction speeds tracing.", "faster",
        "Stages that trace with a lane for every texel, over those with lanes for lit ones alone, above 1.",
        "tracing_vs_other", _plain(Compaction.texels), _MORE,
    ),
    _ratio(
        "compaction-shading", _ARTICLE, "Compaction speeds shading.", "faster",
        "The same of stages that shade.", "shading_vs_other", _plain(Compaction.texels), _MORE,
    ),
    _ratio(
        "compaction-bounces", _ARTICLE, "Compaction between bounces gains, too.", "faster",
        "Time with lit lanes alone over that of lanes that go on, above 1.",
        "speedup_vs_other", _plain(Compaction.bounces), _MORE,
    ),
    _ratio(
        "occupancy-no-matter", _ARTICLE, "With it rays/s do not depend on how full a map is.", "independent",
        "Rays/s on the emptiest map over those on the fullest, 0.95 to 1.05.",
        "rays_speedup_vs_other", _against(Against.occupancy), Bound(0.95, 1.05),
    ),
    _ratio(
        "side-by-side", _ARTICLE, "Rays of a texel that lie side by side are faster.", "faster",
        "Rays/s over those of rays one sample after the other, above 1.",
        "rays_speedup_vs_other", _against(Against.expansion), _MORE,
    ),
    Claim(
        "full-batches", _ARTICLE, "Expansion keeps batches full although few texels come first.", "full",
        "Of the rays that a batch of seen texels has room for, those in it, at least half; on all scenes but one.",
        {"": partial(judge_shares, share=lambda rows: numbers(rows, "batch_fill"),
                     which=lambda rows: _against(Against.expansion)(rows)
                     & pd.Series(numbers(rows, "expansion") >= 16, rows.index), bound=Bound(low=0.5))},
    ),
    Claim(
        "buffers", _ARTICLE, "Buffers do not grow with the map.", "independent",
        "Bytes of rays in flight on the largest map over those on the smallest, at most 1.02.", {"": judge_buffers},
    ),
    Claim(
        "rare-stages", _ARTICLE, "Expansion and gathering are rare.", "rare",
        "Share of both, and of the order of texels, in a round, at most 5 % (our reading); on all scenes but one.",
        {"": partial(judge_shares, share=partial(_share_of, stages=("order", "generate", "gather")),
                     which=_plain(Compaction.bounces), bound=Bound(high=0.05))},
    ),
    _ratio(
        "view-sooner", _ARTICLE, "What the view shows is done sooner when it comes first.", "sooner",
        "A round of the whole map over one of seen texels, above 1.", "view_speedup", _view, _MORE,
    ),
    _ratio(
        "roulette", _ARTICLE, "Roulette shortens the time to an error.", "shorter",
        "Variance times time without it over those with it, above 1.",
        "quality_vs_other", _against(Against.roulette), _MORE,
    ),
    _ratio(
        "panorama", _ARTICLE, "A sky that is found by both ways shortens the time to an error.", "shorter",
        "Variance times time with a sky found by chance alone over those with both, above 1.",
        "quality_vs_other", _against(Against.environment, environment=Environment.mis.value), _MORE,
    ),
    _ratio(
        "light-grid", _ARTICLE, "A grid of lights shortens the time to an error.", "shorter",
        "Variance times time with any light as likely over those with the grid, of the most lamps, above 1.",
        "quality_vs_other", _against(Against.lights, lamps=256), _MORE,
    ),
    _ratio(
        "opaque", _ARTICLE, "Opaque scenes pay nothing for translucency.", "nothing",
        "Time with code for it, of the same scene but for one face that is not quite opaque, over that of the code "
        "which opaque scenes run, at most 1.03.",
        "speedup_vs_other", _against(Against.translucency), Bound(high=1.03),
    ),
    Claim(
        "no-waiting", _ARTICLE, "There are no points at which all must wait.", "none",
        "Share of a round outside of all its stages, at most 1 % (our reading); on all scenes but one.",
        {"": partial(judge_shares, share=partial(_share_of, stages=("other",)),
                     which=_plain(Compaction.bounces), bound=Bound(high=0.01))},
    ),
    Claim(
        "culling-map", _OURS, "Visible-first rays find what a view shows 1.5 times sooner than packets.",
        "1.5", "Median seconds of packets over those of visible-first rays; on all scenes but one.",
        {"": judge_culling_map},
    ),
    Claim(
        "gpu", _ARTICLE, "GPUs are an order of magnitude faster than CPUs (a goal).", "10", "",
        {"": partial(_not_measured, why="there is no GPU here")},
    ),
    _ratio(
        "target-texels", _OURS, "Lanes for lit texels alone: 1.15 times the rays/s on the emptiest map.", "1.15",
        "Rays/s over those with a lane for every texel, at least 1.15.",
        "rays_speedup_vs_other", _emptiest(_plain(Compaction.texels)), Bound(low=1.15),
    ),
    _ratio(
        "target-bounces", _OURS, "Lanes that go on alone: 1.15 times as fast, with an albedo of 0.5.", "1.15",
        "Time with lit lanes over that of lanes that go on, at least 1.15.",
        "speedup_vs_other", _dark, Bound(low=1.15),
    ),
    _ratio(
        "target-view", _OURS, "What is seen, half the map at most, reaches its error 1.6 times sooner.",
        "1.6", "A round of the whole map over one of seen texels, at least 1.6.",
        "view_speedup", _half_seen, Bound(low=1.6),
    ),
    _ratio(
        "target-whole-map", _OURS, "The whole map takes at most 1.05 times as long with seen texels first.", "1.05",
        "Time of the whole map, seen first over in rows, at most 1.05.", "whole_map_cost", _view, Bound(high=1.05),
    ),
    _ratio(
        "target-denoised", _OURS, "Denoised at a quarter of the samples a map is no worse than raw.", "1.0",
        "Error denoised over the raw one of four times the samples, against a map of other random numbers, at most 1.",
        "denoised_over_raw", lambda rows: _where(rows, denoise=True), Bound(high=1.0),
    ),
    Claim(
        "target-seams", _OURS, "Stitching leaves a quarter of the difference at seams.", "0.25",
        "Root mean square after over before, at most 0.25; on all scenes but one.",
        {"": partial(judge_shares, share=lambda rows: numbers(rows, "seam_step_ratio"),
                     which=lambda rows: _where(rows, denoise=True), bound=Bound(high=0.25))},
    ),
    Claim(
        "target-mitsuba", _OURS, "As many paths a second as Mitsuba 3, in one thread.", "1.0", "",
        {"": partial(_not_measured, why="no sweep measures it")},
    ),
)  # fmt: skip
