"""The one rule of verdict, of the paper's claims and of all others.

A number is inside its bounds when its whole 95 % interval is, outside when the whole interval is, and otherwise open;
what is counted has no interval. A claim about every case, a scene or a point of one, holds when all cases are inside
and fails when one is outside. A claim that something happens on some scene holds when one is inside and fails when all
are outside. Else it was not measured where that is so of a case, and is undecided.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    NOT_MEASURED,
    UNDECIDED,
    Judge,
    Judgement,
)
from experiments.results.statistics import FEWEST_PROCESSES, Estimate, Interval, NotMeasuredError, Pool

Known = Estimate | Interval | float
"""A number with its interval, or one that is counted."""


def ends_of(known: Known) -> tuple[float, float]:
    """Both ends of the interval."""
    return (known.low, known.high) if isinstance(known, Estimate | Interval) else (float(known), float(known))


@dataclass(frozen=True)
class Bounds:
    """Between which numbers something is to lie, ends included."""

    low: float = -math.inf
    high: float = math.inf

    def decide(self, known: Known) -> bool | None:
        """Whether it does: True inside, False outside, None = open."""
        low, high = ends_of(known)
        if self.low <= low and high <= self.high:
            return True
        return False if high < self.low or low > self.high else None


def decide_greater(known: Known, limit: float = 1.0) -> bool | None:
    """Whether a number is above `limit`; an interval that ends there leaves it open."""
    return None if limit in ends_of(known) else Bounds(low=limit).decide(known)


@dataclass(frozen=True)
class Outcome:
    """What one case says: holds None = the measurement leaves it open, or there is none and then no value either.
    why: for every outcome that is not True. stand_in: "atrium for sponza" where it is of a stand-in."""

    holds: bool | None
    value: str = ""
    estimate: Estimate | Interval | None = None
    why: str | None = None
    stand_in: str | None = None

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if self.holds is None:
            return UNDECIDED if self.value else NOT_MEASURED
        return HOLDS if self.holds else DOES_NOT_HOLD


def on_cases(cases: Iterable[tuple[str, Outcome]], every: bool = True) -> Judgement:
    """What becomes of a claim by the rule. cases: names, of a scene most often, and what they say. every: it is about
    all of them, otherwise about some. Raises NotMeasuredError without cases."""
    cases = list(cases)
    if not cases:
        raise NotMeasuredError("no point of it is in the table")
    verdicts = [outcome.verdict for _, outcome in cases]
    settling = (DOES_NOT_HOLD, NOT_MEASURED, UNDECIDED) if every else (HOLDS, NOT_MEASURED, UNDECIDED)
    verdict = next((name for name in settling if name in verdicts), verdicts[0])
    names_by_reason: dict[str, list[str]] = {}
    for name, outcome in cases:
        # A claim that fails is explained by what fails; what else is missing does not matter any more.
        relevant = verdict != DOES_NOT_HOLD or outcome.verdict == DOES_NOT_HOLD
        if outcome.why is not None and outcome.verdict != HOLDS and relevant:
            names_by_reason.setdefault(outcome.why, []).append(name)
    told = any(outcome.value for _, outcome in cases)
    values = [f"{name}: {outcome.value or '-'} ({outcome.verdict})" for name, outcome in cases]
    intervals = [f"{name} {outcome.estimate.interval()}" for name, outcome in cases if outcome.estimate is not None]
    reasons = "; ".join(f"{', '.join(names)}: {why}" for why, names in names_by_reason.items())
    return Judgement(
        verdict,
        "; ".join(values) if told else "",
        "; ".join(intervals) or None,
        None if verdict == HOLDS else reasons,
        tuple(outcome.stand_in for _, outcome in cases if outcome.stand_in and outcome.value),
    )


Which = Callable[[pd.DataFrame], "pd.Series[bool]"]
"""Rows -> which of them a claim is about."""


def measured_rows(processes: pd.DataFrame | None, which: Which | None = None) -> pd.DataFrame:
    """The rows that were measured and that a claim is about. Raises NotMeasuredError where there are none."""
    rows = None if processes is None else processes[processes["status"].eq("ok").fillna(False).astype(bool)]
    if rows is not None and which is not None and len(rows):
        rows = rows[which(rows).fillna(False).astype(bool)]
    if rows is None or not len(rows):
        raise NotMeasuredError("no point of it is in the table")
    return rows


def known_values(processes: pd.DataFrame, values: ArrayLike, counted: bool = False) -> dict[Hashable, Known]:
    """By `point_id`, what its processes say. values: one for each row, NaN where a row has none. counted: there is no
    noise in it, and the middle is told.

    What all processes of a point find alike is counted. Few processes have the interval of a pooled variance, of these
    values; a point without one is left out.
    """
    numbers = pd.Series(np.asarray(values, np.float64), index=processes["point_id"].to_numpy())
    of_points = numbers[np.isfinite(numbers)].groupby(level=0, sort=False)
    if counted:
        return dict(of_points.median().items())
    groups = {name: of_point.tolist() for name, of_point in of_points}
    pool = Pool.of(groups.values())
    by_point: dict[Hashable, Known] = {}
    for name, of_point in groups.items():
        if len(of_point) > 1 and len(set(of_point)) == 1:
            by_point[name] = of_point[0]
        elif min(of_point) > 0 and (pool is not None or len(of_point) >= FEWEST_PROCESSES):
            by_point[name] = Estimate.of(of_point, pool)
    return by_point


def ratio_of(numerator: Known | None, denominator: Known | None) -> Estimate | None:
    """Ratio of the values of two points that share no process; None where one of them is not known."""
    above, below = (exact(known) if isinstance(known, float) else known for known in (numerator, denominator))
    return above.over(below) if isinstance(above, Estimate) and isinstance(below, Estimate) else None


def exact(value: float) -> Estimate:
    """What is counted, as an estimate that has no error."""
    return Estimate(math.log(value), 0.0, 1.0)


def case_of(numbers: Sequence[Known], bounds: Bounds) -> Outcome:
    """What the points of one case say: the worst of them decides, and its interval is told."""
    states = [bounds.decide(number) for number in numbers]
    worst = next(state for state in (False, None, True) if state in states)
    decisive = numbers[states.index(worst)]
    middles = [number.value if isinstance(number, Estimate | Interval) else number for number in numbers]
    low, high = say(min(middles)), say(max(middles))
    estimate = decisive if isinstance(decisive, Estimate | Interval) else None
    why = {True: None, False: "outside of what was claimed", None: "the interval reaches beyond what was claimed"}
    return Outcome(worst, low if low == high else f"{low} to {high}", estimate, why[worst])


def say(value: float) -> str:
    """ "1.25", and three digits of what is small."""
    return f"{value:.2f}" if value == 0 or abs(value) >= 0.095 else f"{value:.3g}"


def value_judge(
    values: Callable[[pd.DataFrame], Any], which: Which, bounds: Bounds, counted: bool = False, every: bool = True
) -> Judge:
    """A judge of a value of each row: all points of a scene that say something must lie inside. counted: there is no
    noise in it."""

    def judge(processes: pd.DataFrame | None) -> Judgement:
        rows = measured_rows(processes, which)
        known = known_values(rows, values(rows), counted)
        of_scenes = (
            (str(scene), [known[name] for name in of_scene["point_id"].unique() if name in known])
            for scene, of_scene in rows.groupby("scene", sort=False, observed=True)
        )
        cases = [(scene, case_of(numbers, bounds)) for scene, numbers in of_scenes if numbers]
        if not cases:
            raise NotMeasuredError("too few processes for an interval")
        return on_cases(cases, every)

    return judge
