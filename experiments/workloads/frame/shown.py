"""What is shown of frame times: lines on the terminal, and figures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.methods.naming import best_of, say_point
from experiments.methods.pixel import PIXEL
from experiments.results.settings import say_setting, settings_that_vary
from experiments.results.statistics import Estimate
from experiments.results.statistics import best_of as best_candidate
from experiments.results.verdicts import decide_greater
from experiments.workloads.frame import FRAME
from experiments.workloads.frame.grid_figure import grid_ratios, grid_times
from experiments.workloads.frame_figures import SPLIT_AXES, methods_figure, rows_over, split_ratios, split_times
from experiments.workloads.panels import where_varies, workload_figure

_AXES = tuple(SPLIT_AXES)
_FIGURE5 = "Figure 5 as speed-up: over horizontal splits, culling off and on"
_UPRIGHT = "As figure 5, over vertical splits"
_paper_ratios = partial(split_ratios, with_paper=True)
_upright_times, _upright_ratios = (partial(draw, axis_name="split_y") for draw in (split_times, split_ratios))

_OVER_SPLITS = (
    ("figure4", "Figure 4: render time over the splits of both axes, culling off and on", grid_times, _AXES),
    ("figure4_speedup", "Figure 4 as speed-up, over the nearest hit and over all hits", grid_ratios, _AXES),
    ("figure5", "Figure 5: render time over horizontal splits, culling off and on", split_times, _AXES[:1]),
    ("figure5_speedup", _FIGURE5, _paper_ratios, _AXES[:1]),
    ("figure5_vertical", f"{_UPRIGHT}: render time, culling off and on", _upright_times, _AXES[1:]),
    ("figure5_vertical_speedup", f"{_UPRIGHT}: speed-up, culling off and on", _upright_ratios, _AXES[1:]),
)
"""Name, caption, what draws it, and the splits' axes that vary."""

FIGURES = (
    *(
        workload_figure(name, caption, FRAME, draw, rows_over(*axes), per_packet_width=True)
        for name, caption, draw, axes in _OVER_SPLITS
    ),
    workload_figure(
        "methods", "Speed-up over packets of every method at its best split", FRAME, methods_figure,
        where_varies("method"),
    ),
)  # fmt: skip


class BestBaseline(NamedTuple):
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
        points = [of_point for _, of_point in some.groupby("point_id", sort=False)]
        values = {place: of_point["speedup_vs_packets"].tolist() for place, of_point in enumerate(points)}
        if len(values) < 2:
            continue
        try:
            chosen, margin = best_candidate(values)
        except ValueError:  # too few processes
            chosen, margin = max(values, key=lambda place: float(np.log(values[place]).mean())), None
        words = [say_setting(name, value) for name, value in zip(varying, key[1:], strict=True)]
        yield BestBaseline(", ".join([str(key[0]), *words]), say_point(points[chosen].iloc[0]), margin, len(values))


def process_lines(processes: pd.DataFrame) -> Iterator[str]:
    """Which ray packets are the fastest, where several were tried. processes: rows of all that measured."""
    best = list(best_baselines(processes))
    for baseline in best:
        margin = "" if baseline.margin is None else f", {baseline.margin} times as fast as the usual packets"
        warning = "" if baseline.is_faster else " (not decided)" if baseline.margin is None else " (no more than noise)"
        yield f"best of {baseline.tried} ray packets, {baseline.scene}: {baseline.name}{margin}{warning}"
    is_decided = best and all(baseline.margin is not None for baseline in best)
    if is_decided and not any(baseline.is_faster for baseline in best):
        yield "nowhere are ray packets faster than the usual ones by more than noise"
