"""Judges of claims on lightmaps that compare points with each other, or with Mitsuba."""

from __future__ import annotations

import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.methods.pixel import PIXEL
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import UNDECIDED, Judgement
from experiments.results.verdicts import (
    Bounds,
    Outcome,
    Which,
    case_of,
    known_values,
    measured_rows,
    on_cases,
    ratio_of,
    value_judge,
)

_FORECAST = Bounds(low=1.5)
"""Speed-up of visible-first rays over packets, forecast before anything was measured."""

_DEVIATIONS = 4.0
"""Standard errors between the light of two that find the same."""


def judge_mitsuba(processes: pd.DataFrame | None, which: Which, ratio: str, least: float) -> Judgement:
    """By points in one thread, a ratio that is at least `least`; undecided where any of them finds other light than
    Mitsuba."""
    judged = value_judge(lambda rows: numbers(rows, ratio), which, Bounds(low=least))(processes)
    rows = measured_rows(processes, which)
    off, error = numbers(rows, "other_light_ratio") - 1.0, numbers(rows, "other_light_error")
    other = rows["scene"][~(abs(off) <= _DEVIATIONS * error)].unique()
    if not len(other):
        return judged
    return Judgement(UNDECIDED, judged.value, judged.interval, f"both find other light on {', '.join(map(str, other))}")


def judge_buffers(processes: pd.DataFrame | None) -> Judgement:
    """Bytes of rays in flight on the largest map over those on the smallest, with equal batches."""
    rows = measured_rows(processes, lambda rows: ~rows["priority"].eq(True) & rows["buffer_bytes"].notna())
    cases = []
    for (scene, _), same in rows.groupby(["scene", "batch_rays"], sort=False, observed=True):
        of_size = same.groupby("size")["buffer_bytes"].max()
        if len(of_size) > 1:
            cases.append((str(scene), _counted(float(of_size.iloc[-1]) / float(of_size.iloc[0]), Bounds(high=1.02))))
    return on_cases(cases)


def _counted(value: float, bounds: Bounds) -> Outcome:
    holds = bounds.decide(value)
    return Outcome(holds, f"{value:.3f}", None, None if holds else "outside of what was claimed")


def judge_culling_map(processes: pd.DataFrame | None) -> Judgement:
    """Seconds in which packets find what a view shows over those of the visible-first method."""
    rows = measured_rows(processes, lambda rows: column(rows, "culling_map_s").notna())
    known = known_values(rows, numbers(rows, "culling_map_s"))
    cases = []
    for scene, of_scene in rows.groupby("scene", sort=False, observed=True):
        packets, first = (
            [known.get(name) for name in of_scene["point_id"][of_scene["method"].eq(method.name)].unique()]
            for method in (PIXEL, VISIBLE_FIRST)
        )
        ratios = [ratio for one in packets for other in first if (ratio := ratio_of(one, other)) is not None]
        if ratios:
            cases.append((str(scene), case_of(ratios, _FORECAST)))
    return on_cases(cases)
