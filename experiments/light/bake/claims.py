"""Claims on lightmaps, and judges of those that no query of claims.toml says."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.light.bake import RARE, STAGES
from experiments.methods.pixel import PIXEL
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import UNDECIDED, Judge, Judgement
from experiments.results.queries import chosen, read_claims
from experiments.results.verdicts import (
    Bounds,
    Outcome,
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


def judge_mitsuba(processes: pd.DataFrame | None, where: dict[str, Any], ratio: str, least: float) -> Judgement:
    """By points in one thread, a ratio that is at least `least`; undecided where any of them finds other light than
    Mitsuba."""
    which = partial(chosen, where=where)
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
            grown = float(of_size.iloc[-1]) / float(of_size.iloc[0])
            why = None if grown <= 1.02 else "outside of what was claimed"
            cases.append((str(scene), Outcome(why is None, f"{grown:.3f}", None, why)))
    return on_cases(cases)


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


def judge_share(*stages: str, most: float) -> Judge:
    """By the share of a round's time that some stages take, of bakes that pack together all lanes."""

    def share(rows: pd.DataFrame) -> object:
        part, whole = (sum(numbers(rows, f"{stage}_s") for stage in some) for some in (stages, STAGES))
        return part / whole

    where = {"against": "compaction", "compaction": "bounces", "priority": False, "albedo": "own"}
    return value_judge(share, partial(chosen, where=where), Bounds(high=most))


_MITSUBA = {"against": "mitsuba", "threads": 1}

_JUDGES: dict[str, Judge] = {
    "buffers": judge_buffers,
    "rare-stages": judge_share(*RARE, most=0.05),
    "no-waiting": judge_share("other", most=0.01),
    "culling-map": judge_culling_map,
    "target-mitsuba": partial(judge_mitsuba, where=_MITSUBA, ratio="speedup_vs_best_other", least=1.0),
    "target-mitsuba-error": partial(
        judge_mitsuba, where=_MITSUBA | {"robust_rays": False}, ratio="quality_vs_other", least=2.0
    ),
}

CLAIMS = read_claims(Path(__file__).with_suffix(".toml"), {name: {"": judge} for name, judge in _JUDGES.items()})
