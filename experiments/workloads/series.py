"""Series of methods in figures: their rows, styles and ratios, and what was not measured."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pandas as pd

from experiments.drawing.missing import missing_points
from experiments.drawing.style import BLACK, DASHED, GREY, TIMES
from experiments.drawing.values import column
from experiments.methods import METHODS, find_method
from experiments.methods.naming import say_split
from experiments.methods.pixel import PIXEL
from experiments.workloads.images import say_holes


def series_of(rows: pd.DataFrame) -> Iterator[tuple[str, int | None, pd.DataFrame]]:
    """Method, packet width (None where no row tells) and rows of every series, in the order of `METHODS`.

    A point that was not measured may lack its packet width: it belongs to the method's first series.
    """
    present = set(rows["method"].dropna())
    for method in METHODS:
        if method.name not in present:
            continue
        of_method = rows[rows["method"].eq(method.name).fillna(False).astype(bool)]
        widths = sorted((int(width) for width in column(of_method, "packet_width").dropna().unique()), reverse=True)
        if not method.has_packets or len(widths) <= 1:
            yield method.name, widths[0] if widths else None, of_method
            continue
        for width in widths:
            same = of_method["packet_width"].eq(width)
            yield method.name, width, of_method[same.fillna(width == widths[0]).astype(bool)]


def style_of(name: str, packet_width: int | None) -> dict[str, Any]:
    """Colour, marker and line of a series: single rays have their method's colour, dashed and hollow."""
    if name == PIXEL.name and packet_width == 1:
        return {"color": BLACK, "marker": "^", "linestyle": DASHED}
    style = vars(find_method(name).style)
    return style | ({"linestyle": DASHED, "markerfacecolor": "white"} if packet_width == 1 else {})


def say_ratio(row: pd.Series) -> str:
    """`speedup_vs_packets` with its interval."""
    value, low, high = (row.get(f"speedup_vs_packets{end}") for end in ("", "_low", "_high"))
    # A peer may be a hundred times slower.
    digits = 2 if pd.isna(value) or value >= 0.095 else 3
    text = "" if pd.isna(value) else f"{value:.{digits}f}{TIMES}"
    if text and not (pd.isna(low) or pd.isna(high)):
        text += f" [{low:.{digits}f}, {high:.{digits}f}]"
    return text


def say_wrong(rows: pd.DataFrame, name: str) -> list[str]:
    """A line for each row with pixels that are wrong."""
    wrong = rows[column(rows, "pixels_wrong").gt(0).fillna(False).astype(bool)]
    return [
        f"{', '.join(filter(None, [name, say_split(row)]))}: {row['pixels_wrong']:,} pixels wrong{say_holes(row)}"
        for _, row in wrong.iterrows()
    ]


def say_unmeasured(rows: pd.DataFrame, name: str, whole: bool = False) -> list[str]:
    """A line for each status other than "ok": which points of a series, and the first one's reason.

    whole: the reason in full, and a line for each reason, for a figure that has the room.
    """
    lines = []
    told = rows[["status", "error"]].assign(split_x=rows["split_x"].fillna(0))
    for one in missing_points(told, "split_x", name, GREY):
        status = one.reason.partition(",")[0]
        points = rows[rows["status"].eq(status).fillna(False).astype(bool)]
        splits = list(dict.fromkeys(filter(None, (say_split(row) for _, row in points.iterrows()))))
        where = ", ".join(splits) if len(splits) <= 3 else f"{len(points)} points from {splits[0]} to {splits[-1]}"
        title = f"{TIMES} {', '.join(filter(None, [name, where]))}"
        errors = [str(error) for error in points["error"].dropna().unique()] if whole else []
        lines += [f"{title}: {status}, {error}" for error in errors] or [f"{title}: {one.reason}"]
    return lines
