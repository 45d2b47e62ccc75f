"""Claims on render time (the paper's figures 4 and 5, and its cost model), judged scene by scene."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from itertools import pairwise

from experiments.paper.evidence import SPLITS, NotMeasuredError, SceneRows, read_number
from experiments.paper.judging import DOES_NOT_HOLD, HOLDS, UNDECIDED, Judgement, Outcome, SceneJudge
from experiments.results.estimates import (
    FEWEST_FITTED,
    NOTICEABLE,
    Estimate,
    decide_at_most,
    decide_greater,
    fit_exponent,
    geometric_mean,
)
from experiments.workloads.frame import FRAME

GRID_SPLITS = (2, 4, 8, 16)
"""Splits of one axis in the paper's figure 4, beside none."""

LITTLE = 1.2
"""Render times within this factor differ little. Our reading: the paper gives no number."""

SLIGHTLY = 1.01
"""A gain whose interval ends below this factor is not even slight."""

FEW_SPLITS = (2, 4, 8)

MODEL_EXPONENT = (0.9, 1.1)
MODEL_R_SQUARED = 0.9
"""Time grows like the cost model where the fitted exponent may lie in this range and the fit explains this much."""

_TOO_WIDE = "the interval is wider than the difference"


def one_axis_beats_both(scene: SceneRows) -> Outcome:
    """The fastest one-axis split over the fastest two-axis split, at 4, 8 and 16 cells."""
    ratios = {}
    for cells in GRID_SPLITS[1:]:
        one_axis = [_single_rays(scene, split) for split in ((cells, 1), (1, cells))]
        both = [(across, cells // across) for across in GRID_SPLITS if cells // across >= 2]
        ratios[cells] = _best(one_axis).over(_best([_single_rays(scene, split) for split in both]))
    return _judge_ratios(ratios, "cells", "splitting both axes is faster")


def axes_differ_little(scene: SceneRows) -> Outcome:
    """Whether horizontal splits are as fast as as many vertical ones to within LITTLE."""
    ratios = _horizontal_over_vertical(scene)
    mean = geometric_mean(list(ratios.values()))
    value = _spell(mean, ratios)
    for splits, ratio in ratios.items():
        if ratio.low > LITTLE or ratio.high < 1 / LITTLE:
            return Outcome(False, value, mean, f"{ratio} at {splits} splits")
    if mean.low >= 1 / LITTLE and mean.high <= LITTLE:
        return Outcome(True, value, mean)
    return Outcome(None, value, mean, f"the interval reaches beyond a factor of {LITTLE}")


def horizontal_slightly_better(scene: SceneRows) -> Outcome:
    """Whether horizontal splits are faster on average than as many vertical ones."""
    ratios = _horizontal_over_vertical(scene)
    mean = geometric_mean(list(ratios.values()))
    return _gain(mean, _spell(mean, ratios), f"horizontal is {mean} times as fast", SLIGHTLY)


def few_splits_gain(scene: SceneRows) -> Outcome:
    """The fastest of 2, 4 and 8 horizontal splits over none, culling off."""
    found, missing = scene.speedups(culling=False)
    start = _require(found, missing, 1)
    few = {splits: found[splits] for splits in FEW_SPLITS if splits in found}
    if not few:
        raise NotMeasuredError(missing[FEW_SPLITS[0]])
    best = max(few, key=lambda splits: few[splits].value)
    gain = few[best].over(start)
    outcome = _gain(gain, f"{gain.value:.2f} at {best} splits", f"{best} splits are {gain} times as fast as none")
    if outcome.holds is not True and len(few) < len(FEW_SPLITS):
        raise NotMeasuredError(next(missing[splits] for splits in FEW_SPLITS if splits in missing))
    return outcome


def too_many_splits_slow_down(scene: SceneRows) -> Outcome:
    """Whether time over horizontal splits, culling off, has its minimum inside: faster than none, then slower again."""
    found, missing = scene.speedups(culling=False)
    start = _require(found, missing, 1)
    splits = [one for one in found if one > 1]
    if not splits:
        raise NotMeasuredError(missing[SPLITS[1]])
    best = max(splits, key=lambda one: found[one].value)
    gain = found[best].over(start)
    later = [one for one in splits if one > best]
    if not later:
        if missing:
            raise NotMeasuredError(f"fastest at {best:,}, the most splits measured; {next(iter(missing.values()))}")
        return Outcome(False, f"fastest at {best:,} splits", gain, "fastest at the most splits, no slowing down seen")
    worst = min(later, key=lambda one: found[one].value)
    loss = found[best].over(found[worst])
    value = f"{gain.value:.2f} at {best:,} splits over none, {loss.value:.2f} over {worst:,} splits"
    gains, loses = decide_greater(gain), decide_greater(loss)
    if gains and loses:
        return Outcome(True, value, loss)
    if missing:
        raise NotMeasuredError(next(iter(missing.values())))
    if gains is False:
        return Outcome(False, value, gain, f"no minimum inside: {best:,} splits are {gain} times as fast as none")
    if loses is False:
        return Outcome(False, value, loss, f"{best:,} splits are only {loss} times as fast as {worst:,}")
    return Outcome(None, value, loss, _TOO_WIDE)


def too_many_splits_fall_below_start(scene: SceneRows) -> Outcome:
    """No split over the slowest of the splits beyond the fastest, culling off."""
    found, missing = scene.speedups(culling=False)
    start = _require(found, missing, 1)
    best = max(found, key=lambda one: found[one].value)
    later = [one for one in found if one > best]
    if later:
        worst = min(later, key=lambda one: found[one].value)
        ratio = start.over(found[worst])
        outcome = _gain(
            ratio, f"{ratio.value:.2f} at {worst:,} splits", f"{worst:,} splits are as fast as none or faster"
        )
        if outcome.holds or not missing:
            return outcome
    if missing:
        raise NotMeasuredError(next(iter(missing.values())))
    return Outcome(False, f"fastest at {best:,} splits", None, "fastest at the most splits")


def more_splits_faster(scene: SceneRows) -> Outcome:
    """Whether no number of horizontal splits, culling on, is slower than a smaller one beyond their intervals."""
    found, missing = scene.speedups(culling=True)
    losses = [
        (found[fewer].over(found[more]), fewer, more)
        for fewer in found
        for more in found
        if fewer < more and found[fewer].low > found[more].high
    ]
    most = SPLITS[-1]
    gain = found[most].over(found[1]) if 1 in found and most in found else None
    value = ""
    if found:
        best = max(found, key=lambda one: found[one].value)
        value = f"fastest at {best:,} splits"
    if gain is not None:
        value = f"{gain.value:.2f} at {most:,} splits over none, {value}"
    if losses:
        loss, fewer, more = max(losses, key=lambda one: one[0].value)
        return Outcome(False, value, gain, f"{more:,} splits are slower than {fewer:,}, by a factor of {loss}")
    if gain is None or missing:
        raise NotMeasuredError(next(iter(missing.values())))
    return _gain(gain, value, f"{most:,} splits are only {gain} times as fast as none")


def best_speedup_reaches(paper_value: float, column: str, *, packets: bool) -> SceneJudge:
    """Whether the best speed-up over horizontal splits, culling on, reaches the paper's within its interval.

    packets: of the widest that were measured, instead of single rays.
    """

    def judge(scene: SceneRows) -> Outcome:
        packet_width = scene.widest_packets if packets else 1
        found, missing = scene.speedups(culling=True, packet_width=packet_width, column=column)
        if not found:
            raise NotMeasuredError(next(iter(missing.values())))
        splits = max(found, key=lambda one: found[one].value)
        best = found[splits]
        value = f"{best.value:.2f} at {splits:,} x 1"
        if best.high >= paper_value:
            return Outcome(True, value, best)
        if missing:
            raise NotMeasuredError(f"best so far {best} at {splits:,} x 1; {next(iter(missing.values()))}")
        why = f"the interval ends at {best.high:.2f}, below {paper_value:.2f}"
        with suppress(NotMeasuredError):
            against_single = scene.speedup((splits, 1), culling=True, packet_width=packet_width).value
            if against_single != best.value:
                why += (
                    f"; against single rays {against_single:.2f}: packets alone bring {against_single / best.value:.2f}"
                )
        return Outcome(False, value, best, why)

    return judge


def larger_scenes_gain_less(scenes: Mapping[str, SceneRows]) -> Judgement:
    """Best speed-ups of the scenes, smallest scene first: each above the next."""
    best: dict[str, Estimate] = {}
    for name, scene in scenes.items():
        found, missing = scene.speedups(culling=True)
        if missing:
            raise NotMeasuredError(f"{name}: {next(iter(missing.values()))}")
        best[name] = _best(list(found.values()))
    names = list(best)
    value = "; ".join(f"{name}: {best[name].value:.2f}" for name in names)
    interval = "; ".join(f"{name} {best[name].interval()}" for name in names)
    pairs = [(smaller, larger) for at, smaller in enumerate(names) for larger in names[at + 1 :]]
    against = [
        f"{larger} gains more than {smaller}" for smaller, larger in pairs if best[larger].low > best[smaller].high
    ]
    if against:
        return Judgement(DOES_NOT_HOLD, value, interval, "; ".join(against))
    unclear = [
        f"{smaller} and {larger}" for smaller, larger in pairwise(names) if not best[smaller].low > best[larger].high
    ]
    if unclear:
        return Judgement(UNDECIDED, value, interval, f"the intervals overlap: {'; '.join(unclear)}")
    return Judgement(HOLDS, value, interval)


def time_follows_cost_model(scene: SceneRows) -> Outcome:
    """The exponent of time over log(N_p) N_r on the single-ray points without culling (paper, section 3.2)."""
    model, time, missing = [], [], []
    for splits in SPLITS:
        try:
            estimate = _single_rays(scene, (splits, 1), culling=False)
            row = scene.row(FRAME.name, (splits, 1), culling=False, packet_width=1)
            triangles = read_number(row, "triangles_traced")
            rays = read_number(row, "width") * read_number(row, "height") / splits
        except NotMeasuredError as error:
            missing.append(str(error))
            continue
        model.append(math.log(triangles) * rays)
        time.append(1 / estimate.value)
    if len(time) < FEWEST_FITTED:
        raise NotMeasuredError(f"{len(time)} points, {FEWEST_FITTED} are needed; {missing[0]}")
    fit = fit_exponent(model, time)
    value = f"exponent {fit.exponent.value:.2f}, R2 {fit.r_squared:.2f}, {len(time)} points"
    low, high = MODEL_EXPONENT
    if fit.exponent.high < low or fit.exponent.low > high:
        below = "the exponent lies below 1: however few the rays, they must find the hits of all cells"
        why = below if fit.exponent.high < low else "the exponent lies above 1"
        return Outcome(False, value, fit.exponent, why)
    if fit.r_squared < MODEL_R_SQUARED:
        return Outcome(None, value, fit.exponent, f"R2 {fit.r_squared:.2f} is below {MODEL_R_SQUARED}")
    return Outcome(True, value, fit.exponent)


def _single_rays(scene: SceneRows, split: tuple[int, int], culling: bool = True) -> Estimate:
    return scene.speedup(split, culling=culling, packet_width=1)


def _horizontal_over_vertical(scene: SceneRows) -> dict[int, Estimate]:
    return {splits: _single_rays(scene, (splits, 1)).over(_single_rays(scene, (1, splits))) for splits in GRID_SPLITS}


def _judge_ratios(ratios: Mapping[int, Estimate], unit: str, opposite: str) -> Outcome:
    mean = geometric_mean(list(ratios.values()))
    value = _spell(mean, ratios)
    for count, ratio in ratios.items():
        if decide_at_most(ratio, 1):
            return Outcome(False, value, mean, f"{opposite} at {count} {unit}: ratio {ratio}")
    return _gain(mean, value, f"no noticeable gain: {mean}")


def _gain(ratio: Estimate, value: str, otherwise: str, noticeable: float = NOTICEABLE) -> Outcome:
    """Holds when the whole interval is above 1; otherwise: why it fails where it ends below `noticeable`."""
    holds = decide_greater(ratio, noticeable)
    return Outcome(holds, value, ratio, {True: None, False: otherwise, None: _TOO_WIDE}[holds])


def _spell(mean: Estimate, ratios: Mapping[int, Estimate]) -> str:
    """The mean, and what it is the mean of: "1.08 (2: 1.10, 4: 1.06)"."""
    return f"{mean.value:.2f} ({', '.join(f'{count}: {ratio.value:.2f}' for count, ratio in ratios.items())})"


def _best(estimates: list[Estimate]) -> Estimate:
    return max(estimates, key=lambda one: one.value)


def _require(found: Mapping[int, Estimate], missing: Mapping[int, str], splits: int) -> Estimate:
    if splits not in found:
        raise NotMeasuredError(missing[splits])
    return found[splits]
