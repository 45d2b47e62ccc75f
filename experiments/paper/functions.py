"""Claims that no query says: where the minimum of time is, whether more splits are faster, the cost model, images."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations, pairwise
from typing import Any

import pandas as pd

from experiments.drawing.values import numbers, say_things
from experiments.paper.evidence import SPLITS, Scene, measured_at, read_numbers
from experiments.paper.ratios import TOO_WIDE
from experiments.paper.readings import Reading, baseline, best, best_gain, over_splits
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, UNDECIDED, Judgement
from experiments.results.statistics import FEWEST_FITTED, NotMeasuredError, fit_exponent
from experiments.results.verdicts import Bounds, Outcome, decide_greater

LARGEST_LOSS = 1.05
"""More splits keep gaining where none is slower than fewer by more than this. Our reading."""

MODEL_EXPONENT = Bounds(0.9, 1.1)
MODEL_R_SQUARED = 0.9
"""Time grows like the cost model where the fitted exponent may lie in this range and the fit explains this much."""


def too_many_splits_slow_down(scene: Scene, reading: Reading) -> Outcome:
    """Whether time over horizontal splits, culling off, has its minimum inside: faster than the baseline, then slower
    again at the largest split."""
    speedups, missing = over_splits(scene, reading, culling=False)
    most = max(speedups, default=1)
    splits, value = best({count: speedups[count] for count in speedups if 1 < count < most})
    gain, loss = value.over(baseline(scene, reading)), value.over(speedups[most].estimate())
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


def more_splits_faster(scene: Scene, reading: Reading) -> Outcome:
    """Whether no number of horizontal splits, culling on, is slower than a smaller one, and 1,024 gain."""
    speedups, missing = over_splits(scene, reading, culling=True)
    if missing:
        raise NotMeasuredError(next(iter(missing.values())))
    most = SPLITS[-1]
    gain = speedups[most].estimate().over(baseline(scene, reading))
    # The worst of many differences is mostly noise, so it is chosen on some processes and judged on others.
    pairs = combinations(speedups, 2)
    (fewer, more), loss = best({(fewer, more): speedups[fewer].over(speedups[more]) for fewer, more in pairs})
    value = f"{gain.value:.2f} at {most:,} splits over none; largest loss {loss.value:.2f}, {more:,} against {fewer:,}"
    gains, loses = decide_greater(gain), decide_greater(loss, LARGEST_LOSS)
    if loses is not False:
        are = "are" if loses else "may be"
        why = f"{more:,} splits {are} slower than {fewer:,}, by a factor of {loss}"
        return Outcome(False if loses else None, value, gain, why)
    slower = f"{most:,} splits are {gain} times as fast as none"
    return Outcome(gains, value, gain, {True: None, False: slower, None: TOO_WIDE}[gains])


def larger_scenes_gain_less(scenes: Mapping[str, Scene], reading: Reading) -> Judgement:
    """Best speed-ups of the scenes, smallest scene first: each above the next."""
    best_gains = {name: best_gain(scene, reading) for name, scene in scenes.items()}
    for name, gain in best_gains.items():
        if gain.missing:
            raise NotMeasuredError(f"{name}: {gain.missing}")
    gains = {name: gain.estimate for name, gain in best_gains.items()}
    value = "; ".join(f"{name}: {gain.value:.2f}" for name, gain in gains.items())
    interval = "; ".join(f"{name} {gain.interval()}" for name, gain in gains.items())
    against = [
        f"{larger} gains more than {smaller}"
        for smaller, larger in combinations(gains, 2)
        if decide_greater(gains[larger].over(gains[smaller]))
    ]
    if against:
        return Judgement(DOES_NOT_HOLD, value, interval, "; ".join(against))
    unclear = [
        f"{smaller} and {larger}"
        for smaller, larger in pairwise(gains)
        if not decide_greater(gains[smaller].over(gains[larger]))
    ]
    if unclear:
        return Judgement(UNDECIDED, value, interval, f"not told apart: {'; '.join(unclear)}")
    return Judgement(HOLDS, value, interval)


def time_follows_cost_model(scene: Scene, reading: Reading) -> Outcome:
    """The exponent of time over log(N_p) N_r on the single-ray points without culling (paper, section 3.2)."""

    def model_and_time(splits: int) -> tuple[float, float]:
        point: dict[str, Any] = {
            "workload": reading.workload,
            "split": (splits, 1),
            "culling": False,
            "packet_width": 1,
        }
        speedup = scene.sample("speedup", **point).estimate()
        rows = scene.processes(**point)[:1]  # all are alike in it
        width, height, triangles = (read_numbers(rows, name)[0] for name in ("width", "height", "triangles_traced"))
        return math.log(triangles) * width * height / splits, 1 / speedup.value

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


def any_divisor_works(scene: Scene, reading: Reading) -> Outcome:
    """Wrong pixels at every number of horizontal splits that divides an image of 1,024 pixels, culling on."""
    total, bad = 0, []
    for splits in SPLITS:
        rows = scene.processes(reading.workload, (splits, 1), culling=True, packet_width=1)
        counts = read_numbers(rows, "pixels_wrong")
        wrong, worst = int(counts.max()), rows.iloc[[counts.argmax()]]
        total += wrong
        if wrong:
            bad.append(f"{say_things(wrong, 'pixel')} wrong at {say_things(splits, 'split')}{_say_holes(worst)}")
    value = f"{total} wrong at 1 to {SPLITS[-1]:,} splits"
    return Outcome(not bad, value, None, bad[0] if bad else None)


def image_without_error(scene: Scene, reading: Reading) -> Outcome:
    """Wrong pixels over all aligned images of the scene that were compared with the per-pixel image."""
    images = scene.aligned[scene.aligned["pixels_wrong"].notna()]
    if images.empty:
        raise NotMeasuredError("no image was compared")
    wrong, edge, tied = (_total(images, f"pixels_{kind}") for kind in ("wrong", "edge", "tied"))
    value = f"{wrong:,} wrong, {edge:,} at an edge, {tied:,} tied in {len(images):,} images"
    depths = images[numbers(images, "depth_error_max") > 0]
    if len(depths):
        own, single = (depths[name].max() for name in ("depth_error_max", "baseline_depth_error_max"))
        value += f"; depths off by up to {own:.1e}, of single rays {single:.1e}"
    if wrong == 0:
        return Outcome(True, value)
    wrong_in = (images["pixels_wrong"] > 0).sum()
    told = f"{wrong:,} wrong pixels in {wrong_in:,} of {len(images):,} images"
    return Outcome(False, value, None, told + _say_holes(images))


def _total(images: pd.DataFrame, column: str) -> int:
    return int(images[column].fillna(0).sum())


def _say_holes(images: pd.DataFrame) -> str:
    """How many wrong pixels are rays that slip through between two triangles; "" where none is."""
    counts = (_total(images, "pixels_hole"), "aligned rays"), (_total(images, "baseline_pixels_hole"), "rtcIntersect1")
    said = [f"{count:,} of {rays}" for count, rays in counts if count]
    return f" (holes between triangles: {', '.join(said)})" if said else ""
