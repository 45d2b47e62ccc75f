"""What is shown of rays that share their directions: predictions and what became of them, lines, and a figure."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.style import BLUE, GREEN, ORANGE, TIMES
from experiments.drawing.values import row_interval, say_number, say_things
from experiments.light.bake_rays import BAKE_RAYS
from experiments.results.queries import read_claims
from experiments.workloads.panels import ONE, figure_of, make_panels, read_panels, workload_figure

CLAIMS_FILE = "predictions/claims"

CLAIMS = read_claims(Path(__file__).with_name("claims.toml"), {})


_COLOURS = {"sun": ORANGE, "sky": BLUE, "bundle": GREEN}
_SETTINGS = ("use", "map_size", "directions", "positions")


def _with_a_use(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[rows["use"].isin(_COLOURS)] if "use" in rows else rows


def alignment_figure(rows: pd.DataFrame) -> Figure:
    """A panel a scene: packets over aligned rays, with intervals, a bar for each use and number of positions."""
    panels = read_panels(make_panels(rows, _SETTINGS), _ratios)
    rows = rows.assign(width=pd.NA, height=pd.NA)  # no image is shown
    told = ("", "aligned rays' time, plan and build included, and packets / aligned")
    return figure_of("bars", panels, rows, x=Axis("coherent packets / aligned rays", "linear"), headings=told)


def _ratios(rows: pd.DataFrame) -> Panel:
    place = rows["use"].map({use: number for number, use in enumerate(_COLOURS)})
    ordered = rows[rows["status"].eq("ok")].assign(_place=place).sort_values(["_place", *_SETTINGS[1:]], kind="stable")
    bars = []
    for _, row in ordered.iterrows():
        value, low, high = row_interval(row, "packets_over_aligned{}")
        text = f"{say_number(1e3 * float(row['aligned_time_s']))} ms, {value:.2g}{TIMES}"
        bars.append(Bar(_label(row), value, low, high, _COLOURS[row["use"]], text))
    return Panel(bars=bars, levels=[ONE])


def _label(row: pd.Series) -> str:
    ways = "" if row["use"] == "sun" else f", {say_things(row['directions'], 'direction')}"
    positions = say_things(row["positions"], "position")
    return f"{row['use']}{ways}, {positions}, {row['map_size']}\N{SUPERSCRIPT TWO}"


FIGURES = (
    workload_figure(
        "bake_alignment", "Rays of a bake of shared directions: packets over aligned rays, plan and build included",
        BAKE_RAYS, alignment_figure, _with_a_use,
    ),
)  # fmt: skip
