"""The fastest packets per pixel of those tried, and their margin over the usual ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from experiments.methods.naming import best_of, say_point
from experiments.methods.pixel import PIXEL
from experiments.results.estimates import Estimate, decide_greater
from experiments.results.estimates import best_of as best_candidate
from experiments.results.settings import say_setting, settings_that_vary


@dataclass(frozen=True)
class BestBaseline:
    """scene: with the settings its points share, in words. name: of the fastest packets in one half of the processes.
    margin: usual packets / these in the other half, None with too few processes. tried: number of candidates."""

    scene: str
    name: str
    margin: Estimate | None
    tried: int

    @property
    def is_faster(self) -> bool:
        """By more than noise."""
        return self.margin is not None and decide_greater(self.margin) is True


def best_baselines(processes: pd.DataFrame) -> Iterator[BestBaseline]:
    """One for each scene and value of a setting that varies, if several packets were tried.

    processes: rows of processes that timed frames.
    """
    of_pixels = processes["method"].eq(PIXEL.name) & processes["packet_width"].gt(1)
    measured = processes["status"].eq("ok") & processes["speedup_vs_packets"].notna()
    rows = processes[(of_pixels & measured).fillna(False).astype(bool)]
    varying = settings_that_vary(rows, (*best_of(), "packet_width", "packet_rows"))
    for key, some in rows.groupby(["scene", *varying], sort=False, dropna=False):
        values = {
            place: of_point["speedup_vs_packets"].to_numpy(np.float64)
            for place, (_, of_point) in enumerate(some.groupby("point_id", sort=False))
        }
        firsts = [of_point.iloc[0] for _, of_point in some.groupby("point_id", sort=False)]
        if len(values) < 2:
            continue
        chosen, margin = _best(values)
        scene = ", ".join([str(key[0]), *(say_setting(name, one) for name, one in zip(varying, key[1:], strict=True))])
        yield BestBaseline(scene, say_point(firsts[chosen]), margin, len(values))


def _best(values: dict[int, np.ndarray]) -> tuple[int, Estimate | None]:
    try:
        return best_candidate({place: list(one) for place, one in values.items()})
    except ValueError:  # too few processes
        return max(values, key=lambda place: float(np.log(values[place]).mean())), None


def baseline_lines(processes: pd.DataFrame) -> Iterator[str]:
    """The best baselines, a line each."""
    best = list(best_baselines(processes))
    for one in best:
        margin = "" if one.margin is None else f", {one.margin} times as fast as the usual packets"
        doubt = "" if one.is_faster else " (not decided)" if one.margin is None else " (no more than noise)"
        yield f"best of {one.tried} packets per pixel, {one.scene}: {one.name}{margin}{doubt}"
    if best and all(one.margin is not None for one in best) and not any(one.is_faster for one in best):
        yield "nowhere are packets per pixel faster than the usual ones by more than noise"
