"""Points without a value: crosses on the upper edge, and their reasons in words."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from experiments.drawing.pages import write_notes
from experiments.drawing.style import TIMES
from experiments.drawing.values import drawable


@dataclass(frozen=True)
class Missing:
    """Points of one series that have nothing to draw. reason: one for all of them, in words."""

    series: str
    color: str
    splits: list[int]
    reason: str


def missing_points(rows: pd.DataFrame, axis_name: str, series: str, color: str) -> list[Missing]:
    """The points among `rows` that were skipped or failed, by status."""
    without = rows[[axis_name, "status", "error"]][rows["status"] != "ok"]
    return [
        Missing(series, color, _whole(points[axis_name]), f"{status}, {_shorten(points['error'], status)}")
        for status, points in without.groupby("status", sort=False)
    ]


def undrawable_points(
    rows: pd.DataFrame, values: NDArray[np.float64], axis_name: str, series: str, color: str
) -> list[Missing]:
    """The measured points whose value is missing or not above zero; `values` belong to `rows`."""
    measured = (rows["status"] == "ok").to_numpy(bool)
    listed = []
    for reason, chosen in (
        ("not measured", measured & np.isnan(values)),
        ("not above zero", measured & ~np.isnan(values) & ~drawable(values)),
    ):
        if chosen.any():
            listed.append(Missing(series, color, _whole(rows[axis_name][chosen]), reason))
    return listed


def without_value(
    rows: pd.DataFrame, values: NDArray[np.float64], axis_name: str, series: str, color: str
) -> list[Missing]:
    """Both: what was not measured, and what was and cannot be drawn."""
    skipped = missing_points(rows, axis_name, series, color)
    return [*skipped, *undrawable_points(rows, values, axis_name, series, color)]


def absent_points(
    rows: pd.DataFrame, expected: Collection[int], axis_name: str, series: str, color: str
) -> list[Missing]:
    """The expected splits of which a series has no row at all."""
    absent = sorted(set(expected) - set(_whole(rows[axis_name].dropna())))
    return [Missing(series, color, absent, "not in the table")] if absent else []


def mark_missing(axis: Axes, missing: Sequence[Missing], above: int = 0, notes: Sequence[str] = ()) -> None:
    """A cross on the upper edge for each point without a value, and the reason in words below the panel.

    above: lines that were written there before. notes: further lines about what is missing.
    """
    # Each series has its own height, so that one cross does not hide another.
    heights = {series: 0.985 - 0.04 * i for i, series in enumerate(dict.fromkeys(one.series for one in missing))}
    reasons = []
    for one in missing:
        axis.plot(
            one.splits, [heights[one.series]] * len(one.splits), "x", color=one.color, markersize=6,
            markeredgewidth=1.8, transform=axis.get_xaxis_transform(), clip_on=False, zorder=5,
        )  # fmt: skip
        reasons.append(f"{TIMES} {one.series}, {_say_splits(one.splits)}: {one.reason}")
    write_notes(axis, [*reasons, *notes], above)


def _whole(splits: pd.Series) -> list[int]:
    return sorted({int(split) for split in splits})


def _say_splits(splits: Sequence[int]) -> str:
    """A long list is told by its ends, so that a note stays as wide as its panel; the crosses show which ones."""
    if len(splits) <= 6:
        return ", ".join(str(split) for split in splits)
    return f"{splits[0]} to {splits[-1]} ({len(splits)} points)"


def _shorten(errors: pd.Series, status: str) -> str:
    known = errors.dropna()
    if len(known) == 0:
        return "no reason given"
    text = str(known.iloc[0])
    # Only what was foreseen has a short form; a failure is told in its own words.
    if status == "skipped" and "memory" in text.lower():
        return "needs more memory than its budget"
    if status == "skipped" and "does not divide" in text:
        return "does not divide the image"
    return text if len(text) <= 60 else text[:59] + "…"
