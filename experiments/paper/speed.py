"""Claims on render time that no query says: where the minimum is, whether more splits are faster, the cost model."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise

from experiments.paper.evidence import (
    SPLITS,
    NotMeasuredError,
    SceneRows,
    best,
    estimate,
    measured_at,
    read_number,
)
from experiments.paper.judging import TOO_WIDE
from experiments.paper.readings import Reading, best_gain, relative_to_baseline
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, UNDECIDED, Judgement
from experiments.results.statistics import FEWEST_FITTED, fit_exponent
from experiments.results.verdicts import Bounds, Outcome, decide_greater

LARGEST_LOSS = 1.05
"""More splits keep gaining where none is slower than fewer by more than this. Our reading."""

MODEL_EXPONENT = Bounds(0.9, 1.1)
MODEL_R_SQUARED = 0.9
"""Time grows like the cost model where the fitted exponent may lie in this range and the fit explains this much."""


def too_many_splits_slow_down(scene: SceneRows, reading: Reading) -> Outcome:
    """Whether time over horizontal splits, culling off, has its minimum inside: faster than the baseline, then slower
    again at the largest split."""
    speedups, missing = scene.over_splits(culling=False, workload=reading.workload)
    most = max(speedups, default=1)
    splits, value = best({count: speedups[count] for count in speedups if 1 < count < most})
    gain, loss = relative_to_baseline(value, scene, reading), value.over(estimate(speedups[most]))
    said = f"{gain.value:.2f} at {splits:,} splits over none, {loss.value:.2f} over {most:,} splits"
    gains, loses = decide_greater(gain), decide_greater(loss)
    if gains and loses:
        return Outcome(True, said, loss)
    if missing:
        raise NotMeasuredError(next(iter(missing.values())))
    if gains is False:
        return Outcome(False, said, gain, f"no minimum inside: {splits:,} splits are {gain} times as fast as none")
    if loses is False:
        return Outcome(False, said, loss, f"{most:,} splits are faster than any fewer: {loss}")
    return Outcome(None, said, loss, TOO_WIDE)


def more_splits_faster(scene: SceneRows, reading: Reading) -> Outcome:
    """Whether no number of horizontal splits, culling on, is slower than a smaller one, and 1,024 gain."""
    speedups, missing = scene.over_splits(culling=True, workload=reading.workload)
    most = SPLITS[-1]
    if missing:
        raise NotMeasuredError(next(iter(missing.values())))
    gain = relative_to_baseline(estimate(speedups[most]), scene, reading)
    # The worst of many differences is mostly noise, so it is chosen on some processes and judged on others.
    pairs = {
        (fewer, more): speedups[fewer].over(speedups[more]) for fewer in speedups for more in speedups if fewer < more
    }
    (fewer, more), loss = best(pairs)
    value = f"{gain.value:.2f} at {most:,} splits over none; largest loss {loss.value:.2f}, {more:,} against {fewer:,}"
    loses = decide_greater(loss, LARGEST_LOSS)
    if loses:
        return Outcome(False, value, gain, f"{more:,} splits are slower than {fewer:,}, by a factor of {loss}")
    if loses is None:
        return Outcome(None, value, gain, f"{more:,} splits may be slower than {fewer:,}, by a factor of {loss}")
    gains = decide_greater(gain)
    slower = f"{most:,} splits are {gain} times as fast as none"
    return Outcome(gains, value, gain, {True: None, False: slower, None: TOO_WIDE}[gains])


def larger_scenes_gain_less(scenes: Mapping[str, SceneRows], reading: Reading) -> Judgement:
    """Best speed-ups of the scenes, smallest scene first: each above the next."""
    best_gains = {name: best_gain(scene, reading) for name, scene in scenes.items()}
    for name, of_scene in best_gains.items():
        if of_scene.missing:
            raise NotMeasuredError(f"{name}: {of_scene.missing}")
    gains = {name: of_scene.gain for name, of_scene in best_gains.items()}
    names = list(gains)
    value = "; ".join(f"{name}: {gains[name].value:.2f}" for name in names)
    interval = "; ".join(f"{name} {gains[name].interval()}" for name in names)
    pairs = [(smaller, larger) for at, smaller in enumerate(names) for larger in names[at + 1 :]]
    against = [
        f"{larger} gains more than {smaller}"
        for smaller, larger in pairs
        if decide_greater(gains[larger].over(gains[smaller]))
    ]
    if against:
        return Judgement(DOES_NOT_HOLD, value, interval, "; ".join(against))
    unclear = [
        f"{smaller} and {larger}"
        for smaller, larger in pairwise(names)
        if not decide_greater(gains[smaller].over(gains[larger]))
    ]
    if unclear:
        return Judgement(UNDECIDED, value, interval, f"not told apart: {'; '.join(unclear)}")
    return Judgement(HOLDS, value, interval)


def time_follows_cost_model(scene: SceneRows, reading: Reading) -> Outcome:
    """The exponent of time over log(N_p) N_r on the single-ray points without culling (paper, section 3.2)."""

    def model_and_time(splits: int) -> tuple[float, float]:
        speedup = estimate(scene.speedups((splits, 1), culling=False, workload=reading.workload))
        row = scene.processes(reading.workload, (splits, 1), culling=False, packet_width=1)[0]  # all are alike in it
        rays = read_number(row, "width") * read_number(row, "height") / splits
        return math.log(read_number(row, "triangles_traced")) * rays, 1 / speedup.value

    points, missing = measured_at(SPLITS, model_and_time)
    if len(points) < FEWEST_FITTED:
        raise NotMeasuredError(f"{len(points)} points, {FEWEST_FITTED} are needed; {next(iter(missing.values()))}")
    model, time = zip(*points.values(), strict=True)
    fit = fit_exponent(model, time)
    value = f"exponent {fit.exponent.value:.2f}, R2 {fit.r_squared:.2f}, {len(points)} points"
    state = MODEL_EXPONENT.decide(fit.exponent)
    if state is False:
        below = "below 1: however few the rays, they must find the hits of all cells"
        why = f"the exponent lies {below if fit.exponent.value < 1 else 'above 1'}"
    elif fit.r_squared < MODEL_R_SQUARED:
        state, why = None, f"R2 {fit.r_squared:.2f} is below {MODEL_R_SQUARED}"
    else:
        why = f"the interval reaches beyond {MODEL_EXPONENT.low:g} to {MODEL_EXPONENT.high:g}"
    return Outcome(state, value, fit.exponent, None if state else why)
