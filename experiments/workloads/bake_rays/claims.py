"""Predictions of what alignment does for a bake, written before anything was measured, and what became of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pandas as pd

from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED, Claim, Judgement
from experiments.results.table import workload_rows
from experiments.workloads.bake_rays import BAKE_RAYS, Use

_BOX = "cornell_box"
_FEW = 16
_HOW = (
    "Coherent packets over aligned rays, plan and build included, in the same rounds; its 95 % interval over "
    "processes. Above 1: aligned rays are faster."
)

Which = Callable[[pd.DataFrame], pd.Series]


def judge_ratio(table: pd.DataFrame | None, use: Use, which: Which, gains: bool) -> Judgement:
    """Whether aligned rays gain (or lose) at every point of a use: by its whole interval at each to hold, and at one
    the other way round to fail."""
    rows = None if table is None else workload_rows(table, BAKE_RAYS.name)
    if rows is None or "use" not in rows:
        return Judgement(NOT_MEASURED, why="no point of it is in the table")
    rows = rows[rows["use"].eq(use.value) & which(rows) & rows["packets_over_aligned_low"].notna()]
    if not len(rows):
        return Judgement(NOT_MEASURED, why="no point of it was measured by three processes")
    low, high = rows["packets_over_aligned_low"].min(), rows["packets_over_aligned_high"].max()
    told = f"{rows['packets_over_aligned'].min():.2g} to {rows['packets_over_aligned'].max():.2g}"
    above, below = rows["packets_over_aligned_low"] > 1, rows["packets_over_aligned_high"] < 1
    right, wrong = (above, below) if gains else (below, above)
    if right.all():
        return Judgement(HOLDS, told, f"{low:.2g} to {high:.2g}")
    verdict = DOES_NOT_HOLD if wrong.any() else UNDECIDED
    why = f"{int(wrong.sum())} of {len(rows)} points lie the other way by their whole interval"
    return Judgement(verdict, told, f"{low:.2g} to {high:.2g}", why)


def _all(rows: pd.DataFrame) -> pd.Series:
    return rows["scene"].notna()


CLAIMS = tuple(
    Claim(name, "predictions", text, "", _HOW, {"": partial(judge_ratio, use=use, which=which, gains=gains)})
    for name, text, use, which, gains in (
        (
            "sun-gains-in-the-box", "Rays to the sun from many positions of each texel, aligned once, gain in the box.",
            Use.sun, lambda rows: rows["scene"].eq(_BOX) & (rows["positions"] >= _FEW), True,
        ),
        (
            "sun-gains-nothing-in-deep-scenes", "In deep scenes they do not: nothing stops an aligned ray early.",
            Use.sun, lambda rows: rows["scene"].ne(_BOX), False,
        ),
        (
            "sky-loses-below-16", "Rays into the sky along shared directions lose with fewer than 16 positions a plan.",
            Use.sky, lambda rows: rows["positions"] < _FEW, False,
        ),
        (
            "bundles-gain", "Bundles, all of whose hits are wanted, are traced faster when they are aligned.",
            Use.bundle, _all, True,
        ),
    )
)  # fmt: skip
