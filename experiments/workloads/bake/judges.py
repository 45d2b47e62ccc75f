"""Judges of claims on lightmaps: what a table of `bake` says of ratios, of shares, and of points that differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np
import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.methods.pixel import PIXEL
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, UNDECIDED, Judgement, NotMeasuredError
from experiments.results.table import workload_rows
from experiments.workloads.bake import BAKE

_FORECAST = 1.5
"""Forecast of packets over visible-first rays, written down before anything was measured."""

Which = Callable[[pd.DataFrame], pd.Series]


@dataclass(frozen=True)
class Bound:
    """Between which numbers a ratio is to lie."""

    low: float = -inf
    high: float = inf


def _rows(table: pd.DataFrame | None, which: Which = lambda rows: rows["scene"].notna()) -> pd.DataFrame:
    """The measured rows of bakes. Raises NotMeasuredError where there are none."""
    if table is not None:
        rows = workload_rows(table, BAKE.name)
        rows = rows[which(rows) & rows["status"].eq("ok")]
        if len(rows):
            return rows
    raise NotMeasuredError("no point of it is in the table")


def judge_ratio(table: pd.DataFrame | None, name: str, which: Which, bound: Bound) -> Judgement:
    """Whether a ratio lies within its bound on all scenes but one, by its whole interval on each; it fails where it
    lies outside on more than one."""
    rows = _rows(table, which)
    rows = rows[column(rows, f"{name}_low").notna()]
    if not len(rows):
        raise NotMeasuredError("no point of it was measured by three processes")
    low, high = numbers(rows, f"{name}_low"), numbers(rows, f"{name}_high")
    right = pd.Series((low >= bound.low) & (high <= bound.high), rows["scene"]).groupby(level=0).all()
    wrong = pd.Series((high < bound.low) | (low > bound.high), rows["scene"]).groupby(level=0).any()
    told = "; ".join(_span(scene, same[name]) for scene, same in rows.groupby("scene", sort=False, observed=True))
    spanned = f"{low.min():.2f} to {high.max():.2f}"
    if _on_all_but_one(right):
        return Judgement(HOLDS, told, spanned)
    verdict = UNDECIDED if _on_all_but_one(~wrong) else DOES_NOT_HOLD
    return Judgement(verdict, told, spanned, f"inside on {int(right.sum())} of {len(right)} scenes")


def _on_all_but_one(so: pd.Series) -> bool:
    """Whether it is so on all scenes but one; of a single scene, on that. so: of each scene."""
    return int((~so).sum()) <= int(len(so) > 1)


def _span(scene: object, values: pd.Series) -> str:
    """ "sponza 1.20", or "sponza 1.20 to 1.31" of several points."""
    low, high = f"{values.min():.2f}", f"{values.max():.2f}"
    return f"{scene} {low}" if low == high else f"{scene} {low} to {high}"


def judge_shares(
    table: pd.DataFrame | None, share: Callable[[pd.DataFrame], object], which: Which, bound: Bound
) -> Judgement:
    """Whether what every process finds alike lies within its bound, on all scenes but one."""
    rows = _rows(table, which)
    values = pd.Series(np.asarray(share(rows), np.float64), rows["scene"])
    values = values[np.isfinite(values)].groupby(level=0, sort=False).median()
    if not len(values):
        raise NotMeasuredError("no point tells")
    return _judge_scenes(values, bound, "{:.2g}")


def _judge_scenes(values: pd.Series, bound: Bound, form: str) -> Judgement:
    """Whether a value of each scene lies within the bound, on all but one."""
    told = "; ".join(f"{scene} {form.format(value)}" for scene, value in values.items())
    inside = values.between(bound.low, bound.high)
    if _on_all_but_one(inside):
        return Judgement(HOLDS, told)
    return Judgement(DOES_NOT_HOLD, told, None, f"outside on {int((~inside).sum())} of {len(values)} scenes")


def judge_buffers(table: pd.DataFrame | None) -> Judgement:
    """Bytes of rays in flight on the largest map over those on the smallest, with equal batches."""
    rows = _rows(table, lambda rows: ~rows["priority"].eq(True) & rows["buffer_bytes"].notna())
    ratios = {}
    for _, same in rows.groupby(["scene", "batch_rays"], observed=True):
        if same["size"].nunique() > 1:
            of_size = same.groupby("size")["buffer_bytes"].max()
            ratios[same["scene"].iloc[0]] = float(of_size.iloc[-1]) / float(of_size.iloc[0])
    if not ratios:
        raise NotMeasuredError("no two sizes of a map with equal batches are in the table")
    told = "; ".join(f"{scene} {ratio:.3f}" for scene, ratio in ratios.items())
    if max(ratios.values()) <= 1.02:
        return Judgement(HOLDS, told)
    return Judgement(DOES_NOT_HOLD, told, None, "larger maps take more")


def judge_culling_map(table: pd.DataFrame | None) -> Judgement:
    """Seconds in which packets find what a view shows over those of the visible-first method, on all scenes but one."""
    rows = _rows(table)
    packets, first = (
        rows[rows["method"].eq(method.name)].groupby("scene")["culling_map_s"].median().reindex(rows["scene"].unique())
        for method in (PIXEL, VISIBLE_FIRST)
    )
    ratios = (packets / first).dropna()
    if not len(ratios):
        raise NotMeasuredError("no scene was searched by both methods")
    return _judge_scenes(ratios, Bound(low=_FORECAST), "{:.2f}")
