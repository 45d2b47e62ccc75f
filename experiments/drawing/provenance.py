"""Rows of a table -> where its numbers come from: a line for the foot of a figure, and one for the page."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pandas as pd

from experiments.drawing.style import TIMES
from experiments.drawing.values import column, varies


def provenance(table: pd.DataFrame) -> str:
    """Machine, day, threads and pixels of the measured rows; whatever these do not share or tell is left out."""
    measured = table[table["status"] == "ok"]
    cpus = " / ".join(sorted(re.sub(r"\((R|TM)\)", "", cpu) for cpu in column(measured, "cpu").dropna().unique()))
    held = " and ".join(sorted(set(column(measured, "instruction_set").dropna()) - {"none"}))
    days = sorted({str(moment)[:10] for moment in column(measured, "measured_at").dropna()})
    told = [
        cpus,
        f"held to {held}" if held else "",
        " to ".join(dict.fromkeys([days[0], days[-1]])) if days else "",
        _common(measured, ("threads",), "threads {}"),
        _common(measured, ("width", "height"), f"{{}} {TIMES} {{}} pixels"),
    ]
    return ", ".join(filter(None, told))


def how_measured(table: pd.DataFrame, mark: str = "") -> str:
    """Packets, repeats, Embree's setting and warnings of a table's rows. mark: what the figure sets apart, in words."""
    measured = table[table["status"] == "ok"]
    widths = sorted({int(width) for width in column(measured, "packets_width").dropna()})
    given = set(column(measured, "robust").dropna().astype(bool))  # baselines are fast, as older tables are
    settings = [word for word, value in (("fast", False), ("robust", True)) if value in given]
    flagged = int(column(measured, "warnings").notna().sum())
    out = int(column(table, "processes_left_out").fillna(0).sum())
    told = [
        _common(measured, ("packet_width",), "packet width {}"),
        f"fastest ray packets: of {' or '.join(map(str, widths))}" if widths else "",
        _say_repeats(measured),
        f"{out} {'process' if out == 1 else 'processes'} left out as unsteady" if out else "",
        f"Embree {' and '.join(settings)}" if settings else "",
        mark,
        f"{flagged} of {len(measured)} points carry warnings (see table)" if flagged else "",
    ]
    return ", ".join(filter(None, told))


def _say_repeats(measured: pd.DataFrame) -> str:
    """What a value stands for, and its bars; "" where nothing was timed."""
    rounds, processes = (_range(column(measured, name)) for name in ("rounds", "processes"))
    if not rounds:
        return ""
    ends = [name for name in measured if name.endswith(("_low", "_low_s"))]
    has_bars = any(measured[name].notna().any() for name in ends)
    bars = "bars: 95 % confidence intervals over processes" if has_bars else "no intervals"
    of_processes = (
        f"geometric mean of {processes} {'process' if processes == '1' else 'processes'}" if processes else "processes"
    )
    return f"{of_processes}, of each the median of {rounds} rounds; {bars}"


def _range(counts: pd.Series) -> str:
    """ "3", "3 to 5", "" where nothing is counted."""
    counted = sorted({int(count) for count in counts.dropna()})
    return " to ".join(str(count) for count in dict.fromkeys([counted[0], counted[-1]])) if counted else ""


def _common(table: pd.DataFrame, names: Sequence[str], form: str) -> str:
    """`form` with the values of `names`, or "" if one of them varies or is missing."""
    if len(table) == 0 or any(column(table, name).isna().any() or varies(table, name) for name in names):
        return ""
    return form.format(*(table[name].iloc[0] for name in names))
