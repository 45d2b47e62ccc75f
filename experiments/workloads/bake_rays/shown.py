"""What is shown of rays that share their directions: predictions and what became of them, lines, and a figure."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table

from experiments.drawing.bars import Bar, draw_bars, finish_bar_axes
from experiments.drawing.style import BLACK, BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import column, say_number
from experiments.results.claims import Claim, Judge
from experiments.results.verdicts import Bounds, Which, ratio_judge
from experiments.workloads.bake_rays import BAKE_RAYS, Use
from experiments.workloads.panels import bars_height, make_panels, panels_figure, workload_figure
from experiments.workloads.tables import points_table

_BOX = "cornell_box"
_FEW = 16
_HOW = (
    "Coherent packets over aligned rays, plan and build included, in the same rounds; its 95 % interval over "
    "processes. Above 1: aligned rays are faster."
)


def _judge(use: Use, which: Which, gains: bool) -> Judge:
    def of_use(rows: pd.DataFrame) -> pd.Series:
        return column(rows, "use").eq(use.value).fillna(False).astype(bool) & which(rows)

    return ratio_judge("packets_over_aligned", of_use, Bounds(low=1.0) if gains else Bounds(high=1.0))


def _all(rows: pd.DataFrame) -> pd.Series:
    return rows["scene"].notna()


CLAIMS_FILE = "predictions/claims"

CLAIMS = tuple(
    Claim(name, "predictions", text, "", _HOW, {"": _judge(use, which, gains)})
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


def sweep_lines(rows: pd.DataFrame) -> Iterator[Table]:
    """A line a point. rows: measured, of this workload."""
    milliseconds = rows.assign(aligned_time_ms=rows["aligned_time_s"] * 1e3)
    yield points_table("aligned rays of a bake, plan and build included", milliseconds, _COLUMNS)


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
