"""What is shown of frame times: lines on the terminal, and figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from rich.table import Table

from experiments.drawing.figure import FigureKind, of_table
from experiments.drawing.values import column, varies
from experiments.methods import METHODS
from experiments.methods.naming import aligned_rows, best_of, say_point
from experiments.methods.pixel import PIXEL
from experiments.results.settings import say_setting, settings, settings_that_vary
from experiments.results.statistics import Estimate, decide_greater
from experiments.results.statistics import best_of as best_candidate
from experiments.results.table import workload_rows
from experiments.workloads.frame import FRAME
from experiments.workloads.frame.break_even import draw_break_even_figure
from experiments.workloads.frame.grid_figure import draw_grid_ratios, draw_grid_times
from experiments.workloads.frame.growth import draw_growth_figure, growing_rows, growth_lines
from experiments.workloads.frame.peers_figure import draw_peers_figure
from experiments.workloads.frame.threads_figure import draw_threads_figure
from experiments.workloads.frame_figures import draw_methods_figure, draw_split_ratios, draw_split_times
from experiments.workloads.tables import best_split_table


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """The best splits, how times grow, where triangles or pixels do, and the price of Embree's robust setting, where
    both were measured. rows: those of this workload that were measured."""
    yield best_split_table(rows, "pixels_wrong")
    yield from growth_lines(rows)
    yield from price_lines(rows)


def process_lines(rows: pd.DataFrame) -> Iterator[str]:
    """Which packets per pixel are the fastest, where several were tried. rows: of every process that measured."""
    yield from baseline_lines(rows)


_POINT = ("scene", "method", "packet_width", "split_x", "split_y")


def price_lines(rows: pd.DataFrame) -> Iterator[str]:
    """One line for each point that was measured in both settings: how many times as long a frame takes when no ray
    slips through between triangles.

    Each time is taken as a multiple of the fastest packets of its own rounds, in the fast setting, so that what slows
    down both settings cancels. rows: measured, of one workload; those without the column have the fast setting.
    """
    robust = column(rows, "robust").fillna(False).astype(bool)
    if not robust.any():
        return
    names = [name for name in dict.fromkeys([*_POINT, *settings()]) if name in rows and name != "robust"]
    key = rows[names].astype(object).where(rows[names].notna(), "none").apply(tuple, axis=1)
    fast = rows[~robust].groupby(key[~robust], sort=False)["speedup_vs_packets"].median()
    for place in rows.index[robust]:
        before, row = fast.get(key[place]), rows.loc[place]
        if before is not None and pd.notna(before) and pd.notna(row["speedup_vs_packets"]):
            price = float(before) / float(row["speedup_vs_packets"])
            yield f"{row['scene']}: {say_point(row)}: {price:.2f} times as long as in Embree's fast setting"


_AXES = ("split_x", "split_y")


def _rows(table: pd.DataFrame) -> pd.DataFrame:
    return workload_rows(table, FRAME.name)


def _over(axes: tuple[str, ...], table: pd.DataFrame) -> pd.DataFrame:
    """Aligned rows, if exactly these of the splits' axes vary."""
    rows = aligned_rows(_rows(table))
    return rows if {axis for axis in _AXES if varies(rows, axis)} == set(axes) else rows[:0]


def _over_all(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """All rows, if this column varies."""
    rows = _rows(table)
    return rows if varies(rows, name) else rows[:0]


def _peers(table: pd.DataFrame) -> pd.DataFrame:
    rows = _rows(table)
    others = [method.name for method in METHODS if not method.is_ours]
    return rows if rows["method"].isin(others).any() else rows[:0]


_OVER_SPLITS = (
    ("figure4", "Figure 4: render time over the splits of both axes, culling off and on", _AXES, draw_grid_times),
    ("figure4_speedup", "Figure 4 as speed-up, over the nearest hit and over all hits", _AXES, draw_grid_ratios),
    ("figure5", "Figure 5: render time over horizontal splits, culling off and on", ("split_x",), draw_split_times),
    (
        "figure5_speedup", "Figure 5 as speed-up: over horizontal splits, culling off and on", ("split_x",),
        draw_split_ratios,
    ),
    (
        "figure5_vertical", "As figure 5, over vertical splits: render time, culling off and on", ("split_y",),
        partial(draw_split_times, axis_name="split_y"),
    ),
    (
        "figure5_vertical_speedup", "As figure 5, over vertical splits: speed-up, culling off and on", ("split_y",),
        partial(draw_split_ratios, axis_name="split_y"),
    ),
)  # fmt: skip
"""Name, caption, the splits' axes that vary, and what draws it."""

_TELLING = (
    *(
        FigureKind(name, caption, partial(_over, axes), of_table(draw), per_packet_width=True)
        for name, caption, axes, draw in _OVER_SPLITS
    ),
    FigureKind(
        "methods", "Speed-up over packets of every method at its best split", partial(_over_all, name="method"),
        of_table(draw_methods_figure),
    ),
    FigureKind(
        "break_even", "What a view costs in all, from frame 1 to frame 1,000", partial(_over_all, name="method"),
        of_table(draw_break_even_figure),
    ),
    FigureKind(
        "threads", "Speed-up over one thread", partial(_over_all, name="threads"), of_table(draw_threads_figure)
    ),
    FigureKind(
        "growth", "Time, preparation and bytes over triangles and pixels",
        lambda table: growing_rows(_rows(table)), of_table(draw_growth_figure),
    ),
    FigureKind("peers", "Rays per second beside other ray tracers", _peers, of_table(draw_peers_figure)),
)  # fmt: skip


def _untold(table: pd.DataFrame) -> pd.DataFrame:
    """All rows, where no other figure has anything to show: a sweep over scenes, views, packets or pixels alone."""
    rows = _rows(table)
    return rows[:0] if len(rows) < 2 or any(len(kind.rows(table)) for kind in _TELLING) else rows


FIGURES = (*_TELLING, FigureKind("rates", "Rays per second", _untold, of_table(draw_peers_figure)))


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
