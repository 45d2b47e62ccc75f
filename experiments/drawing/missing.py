"""Points without a value: what is drawn as crosses, and their reasons in words."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.style import TIMES
from experiments.drawing.values import drawable


@dataclass(frozen=True)
class Missing:
    """Points of one series that have nothing to draw. reason: one for all of them, in words."""

    series: str
    color: str
    splits: list[int]
    reason: str

    @property
    def words(self) -> str:
        """A long list is told by its ends."""
        listed = ", ".join(map(str, self.splits))
        if len(self.splits) > 6:
            listed = f"{self.splits[0]} to {self.splits[-1]} ({len(self.splits)} points)"
        return f"{TIMES} {self.series}, {listed}: {self.reason}"


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
    reasons = {
        "not measured": measured & np.isnan(values),
        "not above zero": measured & ~np.isnan(values) & ~drawable(values),
    }
    return [
        Missing(series, color, _whole(rows[axis_name][chosen]), why) for why, chosen in reasons.items() if chosen.any()
    ]


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


def _whole(splits: pd.Series) -> list[int]:
    return sorted({int(split) for split in splits})


def _shorten(errors: pd.Series, status: str) -> str:
    known: Sequence[object] = errors.dropna().tolist()
    if len(known) == 0:
        return "no reason given"
    text = str(known[0])
    # Only what was foreseen has a short form; a failure is told in its own words.
    if status == "skipped" and "memory" in text.lower():
        return "needs more memory than its budget"
    if status == "skipped" and "does not divide" in text:
        return "does not divide the image"
    return text if len(text) <= 60 else text[:59] + "…"
