"""What the figures that compare methods share: names, colours, splits in words, bars, reference lines, notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from experiments.drawing.figure_parts import (
    BLACK,
    BLUE,
    DASHED,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    TIME_BASELINES,
    TIMES,
    VERMILLION,
    column,
    describe_measurement,
    drawable,
    missing_points,
    numbers,
    tidy_axis,
)
from experiments.methods.peers import PEERS
from experiments.results.settings import GEOMETRY, SPLIT
from experiments.workloads.frame.price import BASELINE_METHOD

OWN_METHODS = ("visible_first", "aligned", "tiles")
"""The methods other than one ray per pixel, in the order of panels and legends."""

BEST_OF = (*GEOMETRY, *SPLIT)
"""The settings of which a method is shown at its best."""

_NAMES = {
    "visible_first": "visible-first", "aligned": "aligned", "tiles": "culled tiles", "embreex": "embreex",
    "trimesh": "trimesh", "mitsuba3": "Mitsuba 3", "open3d": "Open3D",
}  # fmt: skip
_STYLES: dict[str, dict[str, Any]] = {
    "visible_first": {"color": VERMILLION, "marker": "D"},
    "aligned": {"color": BLUE, "marker": "o"},
    "tiles": {"color": ORANGE, "marker": "s"},
    "pixel": {"color": GREEN, "marker": "v"},
}
_PEER_STYLE: dict[str, Any] = {"color": PURPLE, "marker": "P"}


def series_of(rows: pd.DataFrame) -> Iterator[tuple[str, int | None, pd.DataFrame]]:
    """Method, packet width (None where no row tells) and rows of every series: own methods, one ray per pixel, peers.

    A point that was not measured may lack its packet width: it belongs to the method's first series.
    """
    present = list(rows["method"].dropna().unique())
    order = [*OWN_METHODS, BASELINE_METHOD, *PEERS]
    order += [str(name) for name in present if name not in order]
    for method in order:
        of_method = rows[rows["method"].eq(method).fillna(False).astype(bool)]
        if len(of_method) == 0:
            continue
        widths = sorted((int(width) for width in column(of_method, "packet_width").dropna().unique()), reverse=True)
        if method in PEERS or len(widths) <= 1:
            yield method, widths[0] if widths else None, of_method
            continue
        for width in widths:
            same = of_method["packet_width"].eq(width)
            yield method, width, of_method[same.fillna(width == widths[0]).astype(bool)]


def say_series(method: str, packet_width: int | None) -> str:
    """The name of a series, with the width of its packets where that is known and ours to choose."""
    if method == BASELINE_METHOD:
        if packet_width is None:
            return "one ray per pixel"
        return "rtcIntersect1 per pixel" if packet_width == 1 else f"packets of {packet_width} per pixel"
    name = _NAMES.get(method, method)
    if method in PEERS or packet_width is None:
        return name
    return f"{name}, single rays" if packet_width == 1 else f"{name}, packets of {packet_width}"


def style_of(method: str, packet_width: int | None) -> dict[str, Any]:
    """Colour, marker and line of a series: single rays have their method's colour, dashed and hollow."""
    style = _STYLES.get(method, _PEER_STYLE)
    if method == BASELINE_METHOD and packet_width == 1:
        return {"color": BLACK, "marker": "^", "linestyle": DASHED}
    return style | ({"linestyle": DASHED, "markerfacecolor": "white"} if packet_width == 1 else {})


def say_split(row: pd.Series) -> str:
    """The split of a row and what is unusual about its geometry; "" for a method without cells."""
    if row["method"] not in OWN_METHODS or pd.isna(row["split_x"]) or pd.isna(row["split_y"]):
        return ""
    words = [f"{row['split_x']} {TIMES} {row['split_y']}"]
    instanced = row.get("geometry") == "instanced"
    if instanced:
        words.append("instanced")
    elif row["method"] == "aligned" and not pd.isna(row["culling"]) and not row["culling"]:
        words.append("culling off")
    return ", ".join(words)


def say_ratio(row: pd.Series) -> str:
    """`speedup_vs_packets` with its interval and, should there be any, the pixels that are wrong."""
    value, low, high = (row.get(f"speedup_vs_packets{end}") for end in ("", "_low", "_high"))
    # A peer may be a hundred times slower.
    digits = 2 if pd.isna(value) or value >= 0.095 else 3
    text = "" if pd.isna(value) else f"{value:.{digits}f}{TIMES}"
    if text and not (pd.isna(low) or pd.isna(high)):
        text += f" [{low:.{digits}f}, {high:.{digits}f}]"
    wrong = row.get("pixels_wrong")
    return text if pd.isna(wrong) or wrong == 0 else f"{text}, {wrong:,} pixels wrong"


@dataclass(frozen=True)
class Bar:
    """value, low (lower quartile), high (upper): in units of the axis, NaN where missing. text: stands behind it."""

    label: str
    value: float
    low: float
    high: float
    color: str
    text: str
    faint: bool = False


def draw_bars(axis: Axes, bars: Sequence[Bar]) -> None:
    """Horizontal bars from the top down with whiskers from quartile to quartile; one without a value is its text."""
    for place, bar in enumerate(bars):
        shown = isfinite(bar.value) and bar.value > 0
        if shown:
            alpha = 0.5 if bar.faint else 1.0
            axis.barh(place, bar.value, height=0.62, color=bar.color, alpha=alpha, zorder=2, label=bar.label)
            axis.plot([bar.low, bar.high], [place, place], color=BLACK, linewidth=1.1, zorder=3, label="_bars")
        end = float(np.nanmax([bar.value, bar.high])) if shown else 0.0
        axis.annotate(
            bar.text, (end, place), xytext=(6, 0), textcoords="offset points", va="center", fontsize=8.5,
            color=BLACK if shown else GREY, zorder=4,
            bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
        )  # fmt: skip
    axis.set_yticks(range(len(bars)), [bar.label for bar in bars])
    axis.tick_params(axis="y", length=0)
    axis.set_ylim(len(bars) - 0.45, -0.55)


def finish_bar_axes(axis: Axes, bars: Sequence[Bar], quantity: str, furthest: float = 0.0) -> None:
    """Abscissa from zero with room for the text behind the longest bar and for a line at `furthest`."""
    ends = [end for bar in bars for end in (bar.value, bar.high) if isfinite(end)]
    axis.set_xlim(0, max([1.95 * end for end in ends] + [1.04 * furthest]) or 1)
    axis.set_xlabel(quantity)
    tidy_axis(axis, "x", frame=("bottom",))


def draw_upright_baselines(axis: Axes, rows: pd.DataFrame, factor: float) -> float:
    """Both baselines as upright lines at the median of all rows, with a band from quartile to quartile.

    factor: seconds -> the units of the axis. Returns where the last one stands, 0 without any.
    """
    furthest = 0.0
    for label, (name, style) in TIME_BASELINES.items():
        values = numbers(rows, name) * factor
        values = values[drawable(values)]
        if len(values) == 0:
            continue
        q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
        if q3 > q1:
            axis.axvspan(q1, q3, color=style["color"], alpha=0.15, linewidth=0, zorder=1)
        axis.axvline(median, linewidth=1.5, zorder=2.5, label=label, **style)
        furthest = max(furthest, float(q3))
    return furthest


def say_number(value: float) -> str:
    """Three digits, or all before the point."""
    if value == 0:
        return "0"
    return f"{value:,.0f}" if value >= 99.95 else f"{value:#.3g}".rstrip(".")


def say_unmeasured(rows: pd.DataFrame, name: str, whole: bool = False) -> list[str]:
    """A line for each status other than "ok": which points of a series, and the first one's reason.

    whole: the reason in full, and a line for each reason, for a figure that has the room.
    """
    lines = []
    for one in missing_points(rows.assign(split_x=rows["split_x"].fillna(0)), "split_x", name, GREY):
        status = one.reason.partition(",")[0]
        points = rows[rows["status"].eq(status).fillna(False).astype(bool)]
        splits = list(dict.fromkeys(filter(None, (say_split(row) for _, row in points.iterrows()))))
        where = ", ".join(splits) if len(splits) <= 3 else f"{len(points)} points from {splits[0]} to {splits[-1]}"
        title = f"{TIMES} {', '.join(filter(None, [name, where]))}"
        errors = [str(error) for error in points["error"].dropna().unique()] if whole else []
        lines += [f"{title}: {status}, {error}" for error in errors] or [f"{title}: {one.reason}"]
    return lines


def write_notes(axis: Axes, notes: Sequence[str], drop: float = 36) -> None:
    """Lines below a panel, from `drop` points under its lower edge, folded to its width."""
    if notes:
        axis.annotate(
            "\n".join(fill(note, 80, subsequent_indent="   ") for note in notes), (0, 0), xytext=(0, -drop),
            xycoords="axes fraction", textcoords="offset points", ha="left", va="top", fontsize=7.5, color=GREY,
        )  # fmt: skip


def write_foot(figure: Figure, rows: pd.DataFrame, *lines: str) -> None:
    """`describe_measurement` below all panels, and lines of the figure's own under it."""
    text = "\n".join(filter(None, [describe_measurement(rows), *lines]))
    figure.supxlabel(text, fontsize=8, color=GREY)


def spread(values: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
    """The values moved apart until none are closer than `gap`, for labels that must not overlap; order is kept.

    values: (N,). Values that crowd each other are laid out evenly around their mean; the others stay.
    """
    order = np.argsort(values, kind="stable")
    crowds: list[list[float]] = []
    for value in values[order]:
        crowds.append([float(value)])
        while len(crowds) > 1 and _places(crowds[-1], gap)[0] - _places(crowds[-2], gap)[-1] < gap:
            crowds[-2:] = [crowds[-2] + crowds[-1]]
    result = np.empty(len(values))
    result[order] = [place for crowd in crowds for place in _places(crowd, gap)]
    return result


def _places(crowd: Sequence[float], gap: float) -> NDArray[np.float64]:
    return np.mean(crowd) + gap * (np.arange(len(crowd)) - (len(crowd) - 1) / 2)
