"""What is shown of rays that share their directions: predictions and what became of them, lines, and a figure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes
from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import say_number
from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    UNDECIDED,
    Claim,
    Judgement,
    NotMeasuredError,
)
from experiments.results.table import workload_rows
from experiments.workloads.bake_rays import BAKE_RAYS, Use
from experiments.workloads.panels import bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.tables import claim_lines, points_table

_BOX = "cornell_box"
_FEW = 16
_HOW = (
    "Coherent packets over aligned rays, plan and build included, in the same rounds; its 95 % interval over "
    "processes. Above 1: aligned rays are faster."
)

Which = Callable[[pd.DataFrame], pd.Series]


def judge_ratio(table: pd.DataFrame | None, use: Use, which: Which, gains: bool) -> Judgement:
    """Whether aligned rays gain (or lose) at every point of a use: by its whole interval at each to hold, and at one
    the other way round to fail."""
    if table is None or "use" not in (rows := workload_rows(table, BAKE_RAYS.name)):
        raise NotMeasuredError("no point of it is in the table")
    rows = rows[rows["use"].eq(use.value) & which(rows) & rows["packets_over_aligned_low"].notna()]
    if not len(rows):
        raise NotMeasuredError("no point of it was measured by three processes")
    low, high = rows["packets_over_aligned_low"].min(), rows["packets_over_aligned_high"].max()
    told = f"{rows['packets_over_aligned'].min():.2g} to {rows['packets_over_aligned'].max():.2g}"
    above, below = rows["packets_over_aligned_low"] > 1, rows["packets_over_aligned_high"] < 1
    right, wrong = (above, below) if gains else (below, above)
    if right.all():
        return Judgement(HOLDS, told, f"{low:.2g} to {high:.2g}")
    verdict = DOES_NOT_HOLD if wrong.any() else UNDECIDED
    why = f"{int(wrong.sum())} of {len(rows)} points lie the other way by their whole interval"
    return Judgement(verdict, told, f"{low:.2g} to {high:.2g}", why)


def _all(rows: pd.DataFrame) -> pd.Series:
    return rows["scene"].notna()


CLAIMS_FILE = "predictions/claims"

CLAIMS = tuple(
    Claim(name, "predictions", text, "", _HOW, {"": partial(judge_ratio, use=use, which=which, gains=gains)})
    for name, text, use, which, gains in (
        (
            "sun-gains-in-the-box", "Rays to the sun from many positions of each texel, aligned once, gain in the box.",
            Use.sun, lambda rows: rows["scene"].eq(_BOX) & (rows["positions"] >= _FEW), True,
        ),
        (
            "sun-gains-nothing-in-deep-scenes", "In deep scenes they do not: nothing stops an aligned ray early.",
            Use.sun, lambda rows: rows["scene"].ne(_BOX), False,
        ),
        (
            "sky-loses-below-16", "Rays into the sky along shared directions lose with fewer than 16 positions a plan.",
            Use.sky, lambda rows: rows["positions"] < _FEW, False,
        ),
        (
            "bundles-gain", "Bundles, all of whose hits are wanted, are traced faster when they are aligned.",
            Use.bundle, _all, True,
        ),
    )
)  # fmt: skip


_COLUMNS = {
    "aligned\nms": ("aligned_time_ms", "{:,.1f}"),
    "vs\nsingle": ("single_over_aligned", "{:.2f}x"),
    "vs\npackets": ("packets_over_aligned", "{:.2f}x"),
    "other\nrays": ("rays_different", "{}"),
}


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table | str]:
    """A line a point, then the verdict on each prediction. rows: measured, of this workload."""
    milliseconds = rows.assign(aligned_time_ms=rows["aligned_time_s"] * 1e3)
    yield points_table("aligned rays of a bake, plan and build included", milliseconds, _COLUMNS)
    yield from claim_lines(CLAIMS, rows)


_COLOURS = {Use.sun.value: ORANGE, Use.sky.value: BLUE, Use.bundle.value: GREEN}
_SETTINGS = ("use", "map_size", "directions", "positions")


def _with_a_use(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["use"].isin(_COLOURS)] if "use" in rows else rows


def draw_alignment(rows: pd.DataFrame, columns: int) -> Figure:
    """A panel a scene: packets over aligned rays, with intervals, a bar for each use and number of positions."""
    panels = make_panels(rows, _SETTINGS)
    rows = rows.assign(width=pd.NA, height=pd.NA)  # no image is shown
    foot = "right of a label: aligned rays' time, plan and build included, and packets / aligned"
    return panels_figure(panels, _draw_ratios, columns, rows, foot, height=bars_height(panels, len))


def _draw_ratios(axis: Axes, rows: pd.DataFrame) -> None:
    place = rows["use"].map({use: number for number, use in enumerate(_COLOURS)})
    ordered = rows[rows["status"].eq("ok")].assign(_place=place).sort_values(["_place", *_SETTINGS[1:]], kind="stable")
    bars = []
    for _, row in ordered.iterrows():
        value, low, high = (
            float(pd.to_numeric(row[f"packets_over_aligned{end}"], errors="coerce")) for end in ("", "_low", "_high")
        )
        text = f"{say_number(1e3 * float(row['aligned_time_s']))} ms, {value:.2g}{TIMES}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["use"]], text))
    draw_bars(axis, bars)
    axis.axvline(1.0, color=BLACK, linewidth=1.0, zorder=1)
    finish_bar_axes(axis, bars, "coherent packets / aligned rays", 1.0)


def _label(row: pd.Series) -> str:
    ways = "" if row["use"] == Use.sun.value else f", {_counted(row['directions'], 'direction')}"
    positions = _counted(row["positions"], "position")
    return f"{row['use']}{ways}, {positions}, {row['map_size']}\N{SUPERSCRIPT TWO}"


def _counted(count: int, thing: str) -> str:
    return f"{count} {thing}" + "s" * (count != 1)


FIGURES = (
    workload_figure(
        "bake_alignment", "Rays of a bake of shared directions: packets over aligned rays, plan and build included",
        BAKE_RAYS, draw_alignment, _with_a_use,
    ),
)  # fmt: skip
