"""What the figures share: panels, titles, axes over splits, series, baselines, marks for missing points, the foot."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from experiments.results.settings import GEOMETRY, say_setting, settings_that_vary

# Okabe and Ito's palette, told apart by the colour-blind too; shapes and dashes say the same again.
BLACK, BLUE, GREEN, ORANGE, PURPLE, VERMILLION = "#333333", "#0072B2", "#009E73", "#E69F00", "#CC79A7", "#D55E00"
GREY = "#555555"
DASHED, DOTTED, DASH_DOTTED = (0, (6, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5))

MILLISECONDS = 1e3
MEBIBYTES = 2.0**-20
TIMES = "\N{MULTIPLICATION SIGN}"

_SPLITS = {"split_x": "horizontal splits", "split_y": "vertical splits"}

COPIED_OFF, COPIED_ON, INSTANCED = "aligned, culling off", "aligned, culling on", "aligned, instanced"
ALIGNED_STYLES: dict[str, dict[str, Any]] = {
    COPIED_OFF: {"color": VERMILLION, "marker": "s"},
    COPIED_ON: {"color": BLUE, "marker": "o"},
    INSTANCED: {"color": PURPLE, "marker": "^"},
}
"""The three forms of the aligned geometry, by their labels, in the order of the legends."""

TIME_BASELINES: dict[str, tuple[str, dict[str, Any]]] = {
    "rtcIntersect1 per pixel": ("baseline_render_time_s", {"color": BLACK, "linestyle": DASHED}),
    "fastest packets per pixel": ("packets_render_time_s", {"color": GREEN, "linestyle": DOTTED}),
}
"""Label -> column and line of what every time row was measured against."""


@dataclass(frozen=True)
class Panel:
    """The rows of one panel; `details` says in words what tells it from other panels of its scene."""

    scene: str
    details: str
    rows: pd.DataFrame

    @property
    def title(self) -> str:
        """The scene, its triangle count, the details."""
        triangles = self.rows["triangles"].dropna()
        counted = f"{self.scene} ({triangles.iloc[0]:,} triangles)" if len(triangles) else self.scene
        return ", ".join(filter(None, [counted, self.details]))

    @property
    def stands_for(self) -> str | None:
        """The scene of the paper that this one replaces, if it is a stand-in."""
        names = column(self.rows, "stands_for").dropna()
        return str(names.iloc[0]) if len(names) else None


def stand_in_note(stands_for: str | None) -> str:
    """What must stand at every picture and panel of a stand-in; "" for any other scene."""
    return f"stand-in for {stands_for}, not that scene" if stands_for else ""


def column(table: pd.DataFrame, name: str) -> pd.Series:
    """The column, or missing values where an older table has none."""
    return table[name] if name in table else pd.Series(pd.NA, index=table.index, dtype="object")


def numbers(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """The column as float64, NaN where missing."""
    return pd.to_numeric(column(table, name), errors="coerce").to_numpy(np.float64, na_value=np.nan)


def is_instanced(table: pd.DataFrame) -> pd.Series:
    """Rows with one instance a cell; a row that does not say is a sheared copy a cell."""
    return column(table, "geometry").eq("instanced").fillna(False).astype(bool)


def aligned_forms(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The aligned rows by the label of their geometry's form (`ALIGNED_STYLES`); forms without rows are left out."""
    aligned = table[table["method"] == "aligned"]
    instanced, culled = is_instanced(aligned), aligned["culling"].fillna(False).astype(bool)
    rows = {
        COPIED_OFF: aligned[~instanced & ~culled],
        COPIED_ON: aligned[~instanced & culled],
        INSTANCED: aligned[instanced],
    }
    return {form: rows[form] for form in ALIGNED_STYLES if len(rows[form])}


def make_panels(table: pd.DataFrame, shown: Collection[str]) -> list[Panel]:
    """One panel a scene, in the order of the table, and a value of every setting that varies, ascending.

    shown: the settings that the figure itself tells apart, or takes the best of: they make no panels.
    """
    varying = settings_that_vary(table, shown)
    panels = []
    for scene in table["scene"].unique():
        of_scene = table[table["scene"] == scene]
        if not varying:
            panels.append(Panel(str(scene), "", of_scene))
            continue
        for key, rows in of_scene.groupby(varying, sort=True, dropna=False):
            words = [say_setting(name, value) for name, value in zip(varying, key, strict=True)]
            panels.append(Panel(str(scene), ", ".join(words), rows))
    return panels


def panels_over_splits(table: pd.DataFrame, axis_name: str = "split_x") -> list[Panel]:
    """`make_panels` for a figure with `axis_name` on the abscissa and a line for each form of the geometry."""
    return make_panels(table, (axis_name, *GEOMETRY))


def varies(table: pd.DataFrame, name: str) -> bool:
    """The column holds more than one value."""
    return bool(column(table, name).nunique() > 1)


def make_figure(panel_count: int, columns: int | None = None, panel_height: float = 4.1) -> tuple[Figure, list[Axes]]:
    """An empty figure for files only, and its panels; two columns unless told otherwise or there is only one panel."""
    columns = columns or (1 if panel_count <= 1 else 2)
    rows = max(1, -(-panel_count // columns))
    figure = Figure(figsize=(7.2 if columns == 1 else 11.5, panel_height * rows + 1.1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for axis in axes[panel_count:]:
        axis.set_visible(False)
    if panel_count == 0:
        figure.text(0.5, 0.5, "no points", ha="center", va="center", color=GREY)
    return figure, axes[:panel_count]


def set_panel_title(axis: Axes, title: str, stands_for: str | None) -> None:
    """The title, and below it, smaller, whose stand-in the scene is."""
    note = stand_in_note(stands_for)
    axis.set_title(title, fontsize=11, loc="left", pad=18 if note else 6)
    if note:
        axis.annotate(
            note, (0, 1), xytext=(0, 4), xycoords="axes fraction", textcoords="offset points", ha="left", va="bottom",
            fontsize=8.5, color=GREY,
        )  # fmt: skip


def draw_series(
    axis: Axes, splits: NDArray[np.float64], values: NDArray[np.float64], style: dict[str, Any],
    quartiles: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None, label: str = "",
) -> None:  # fmt: skip
    """A line over splits with bars from the lower to the upper quartile; what is missing is left out.

    splits, values and each quartile: (N,) float64 in the units of the axis, in any order. Values that are not above
    zero have no place on a logarithmic axis and must not be handed in: see `drawable`.
    """
    shown = np.flatnonzero(drawable(values))
    if len(shown) == 0:
        return
    shown = shown[np.argsort(splits[shown], kind="stable")]
    axis.plot(splits[shown], values[shown], linewidth=1.6, markersize=5, zorder=3, label=label, **style)
    if quartiles is not None:
        low, high = (quartile[shown] for quartile in quartiles)
        axis.plot(*_bars(splits[shown], low, high), linewidth=1.1, zorder=2.9, color=style["color"], label="_bars")


def _bars(
    splits: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Abscissae and ordinates of bars with caps, one line broken by NaN: a third of an SVG with a path for each."""
    gap = np.full(len(splits), np.nan)
    # Caps as wide on every place of a logarithmic axis.
    left, right = splits / 1.06, splits * 1.06
    abscissae = np.stack([splits, splits, gap, left, right, gap, left, right, gap], axis=1)
    ordinates = np.stack([low, high, gap, low, low, gap, high, high, gap], axis=1)
    return abscissae.ravel(), ordinates.ravel()


def drawable(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values a logarithmic axis can show."""
    return np.isfinite(values) & (values > 0)


def draw_baseline(axis: Axes, values: NDArray[np.float64], style: dict[str, Any], label: str = "") -> None:
    """A line at the median of all that was measured of something without splits, a band from quartile to quartile."""
    values = values[drawable(values)]
    if len(values) == 0:
        return
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    if q3 > q1:
        axis.axhspan(q1, q3, color=style["color"], alpha=0.15, linewidth=0, zorder=1)
    axis.axhline(median, linewidth=1.5, zorder=2, label=label, **style)


@dataclass(frozen=True)
class Missing:
    """Points of one series that have nothing to draw. reason: one for all of them, in words."""

    series: str
    color: str
    splits: list[int]
    reason: str


def missing_points(rows: pd.DataFrame, axis_name: str, series: str, color: str) -> list[Missing]:
    """The points among `rows` that were skipped or failed, by status."""
    without = rows[rows["status"] != "ok"]
    return [
        Missing(series, color, _whole(points[axis_name]), f"{status}, {_shorten(points['error'], status)}")
        for status, points in without.groupby("status", sort=False)
    ]


def undrawable_points(
    rows: pd.DataFrame, values: NDArray[np.float64], axis_name: str, series: str, color: str
) -> list[Missing]:
    """The measured points whose value is missing or not above zero; `values` belong to `rows`."""
    measured = (rows["status"] == "ok").to_numpy(bool)
    listed = []
    for reason, chosen in (
        ("not measured", measured & np.isnan(values)),
        ("not above zero", measured & ~np.isnan(values) & ~drawable(values)),
    ):
        if chosen.any():
            listed.append(Missing(series, color, _whole(rows[axis_name][chosen]), reason))
    return listed


def mark_missing(axis: Axes, missing: Sequence[Missing]) -> None:
    """A cross on the upper edge for each point without a value, and the reason in words below the panel."""
    # Each series has its own height, so that one cross does not hide another.
    heights = {series: 0.985 - 0.04 * i for i, series in enumerate(dict.fromkeys(one.series for one in missing))}
    notes = []
    for one in missing:
        axis.plot(
            one.splits, [heights[one.series]] * len(one.splits), "x", color=one.color, markersize=6,
            markeredgewidth=1.8, transform=axis.get_xaxis_transform(), clip_on=False, zorder=5,
        )  # fmt: skip
        note = f"{TIMES} {one.series}, {_say_splits(one.splits)}: {one.reason}"
        # A line wider than its panel would make the layout shrink all of them.
        notes.append(fill(note, 80, subsequent_indent="   "))
    if notes:
        axis.annotate(
            "\n".join(notes), (0, 0), xytext=(0, -36), xycoords="axes fraction", textcoords="offset points",
            ha="left", va="top", fontsize=7.5, color=GREY,
        )  # fmt: skip


def finish_split_axes(axis: Axes, splits: Iterable[int], axis_name: str, quantity: str) -> None:
    """Both axes logarithmic with readable ticks, labels and a light grid. To be called once everything is drawn."""
    ordered = sorted({int(split) for split in splits}) or [1]
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    axis.set_xticks(ordered, [str(split) for split in ordered])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.set_xlim(ordered[0] / 1.35, ordered[-1] * 1.35)
    # The crosses of missing points hang on the edge and set no limits: without data these are infinite.
    if np.isfinite(axis.dataLim.intervaly).all() and axis.dataLim.intervaly[0] > 0:
        low, high = axis.get_ylim()
        # A single value has no range of its own.
        if high < 1.5 * low:
            low, high = low / 1.5, high * 1.5
        axis.set_ylim(low / 1.25, high * 1.1)
        axis.set_yticks(_ticks(*axis.get_ylim()))
    else:
        axis.set_yticks([])
        say_nothing_measured(axis)
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    axis.set_xlabel(_SPLITS[axis_name])
    axis.set_ylabel(quantity)
    tidy_axis(axis)


def tidy_axis(
    axis: Axes, lines: Literal["both", "x", "y"] = "both", frame: Collection[str] = ("left", "bottom")
) -> None:
    """A light grid of these lines behind all that is drawn, and no frame but on these sides."""
    axis.grid(True, axis=lines, color="#DDDDDD", linewidth=0.6)
    axis.set_axisbelow(True)
    for side, spine in axis.spines.items():
        spine.set_visible(side in frame)


def say_nothing_measured(axis: Axes) -> None:
    axis.text(0.5, 0.5, "nothing measured", transform=axis.transAxes, ha="center", va="center", color=GREY)


def add_legend(figure: Figure, axes: Sequence[Axes], order: Sequence[str], heading: str = "") -> None:
    """One legend above all panels, of the labels that occur, in this order; above it the heading, if there is one."""
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    labels = [label for label in order if label in handles]
    if not labels:
        figure.suptitle(heading, fontsize=12)
        return
    wide = figure.get_figwidth() > 8
    per_row = (len(labels) if len(labels) <= 5 else -(-len(labels) // 2)) if wide else 2
    # The heading is the legend's title: the layout would put a title of the figure on top of a legend outside.
    figure.legend(
        [handles[label] for label in labels], labels, loc="outside upper center", ncols=per_row, frameon=False,
        title=heading or None, title_fontsize=12,
    )  # fmt: skip


def add_foot(figure: Figure, table: pd.DataFrame, mark: str) -> None:
    """`describe_measurement` below all panels."""
    figure.supxlabel(describe_measurement(table, mark), fontsize=8, color=GREY)


def describe_measurement(table: pd.DataFrame, mark: str = "") -> str:
    """Two lines for the foot of a figure: what is common to its points, the machine, the day, the doubts.

    mark: what the figure sets apart, in words. Whatever the table does not tell is left out.
    """
    measured = table[table["status"] == "ok"]
    size = _common(measured, ("width", "height"), f"{{}} {TIMES} {{}} pixels")
    threads = _common(measured, ("threads",), "threads {}")
    packets = _common(measured, ("packet_width",), "packet width {}")
    widths = sorted({int(width) for width in column(measured, "packets_width").dropna()})
    fastest = f"fastest packets per pixel: of {' or '.join(map(str, widths))}" if widths else ""
    counts = column(measured, "rounds").dropna()
    rounds = ""
    if len(counts):
        fewest, most = int(counts.min()), int(counts.max())
        rounds = f"median and quartiles of {fewest if fewest == most else f'{fewest} to {most}'} rounds"
    cpus = " / ".join(sorted(str(cpu) for cpu in column(measured, "cpu").dropna().unique()))
    days = sorted({str(moment)[:10] for moment in column(measured, "measured_at").dropna()})
    date = " to ".join(dict.fromkeys([days[0], days[-1]])) if days else ""
    doubtful = int(column(measured, "doubts").notna().sum())
    doubts = f"{doubtful} of {len(measured)} points carry doubts (see table)" if doubtful else ""
    first = ", ".join(filter(None, [size, threads, packets, fastest, rounds]))
    second = ", ".join(filter(None, [cpus, date, mark, doubts]))
    return "\n".join(filter(None, [first, second]))


def _common(table: pd.DataFrame, names: Sequence[str], form: str) -> str:
    """`form` with the values of `names`, or "" if one of them varies or is missing."""
    if len(table) == 0 or any(column(table, name).isna().any() or varies(table, name) for name in names):
        return ""
    return form.format(*(table[name].iloc[0] for name in names))


def _whole(splits: pd.Series) -> list[int]:
    return sorted({int(split) for split in splits})


def _say_splits(splits: Sequence[int]) -> str:
    """A long list is told by its ends, so that a note stays as wide as its panel; the crosses show which ones."""
    if len(splits) <= 6:
        return ", ".join(str(split) for split in splits)
    return f"{splits[0]} to {splits[-1]} ({len(splits)} points)"


def _shorten(errors: pd.Series, status: str) -> str:
    known = errors.dropna()
    if len(known) == 0:
        return "no reason given"
    text = str(known.iloc[0])
    # Only what was foreseen has a short form; a failure is told in its own words.
    if status == "skipped" and "memory" in text.lower():
        return "needs more memory than its budget"
    if status == "skipped" and "does not divide" in text:
        return "does not divide the image"
    return text if len(text) <= 60 else text[:59] + "…"


def _ticks(low: float, high: float) -> list[float]:
    """The coarsest round values, at least four of them if possible, from `low` to `high`."""
    ticks: list[float] = []
    for steps in ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(step / 10 for step in range(10, 100, 5))):
        ticks = [step * 10.0**power for power in range(-4, 9) for step in steps]
        ticks = sorted({tick for tick in ticks if low <= tick <= high})
        if len(ticks) >= 4:
            break
    return ticks
