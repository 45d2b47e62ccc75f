"""Figure 5 of the paper: render time over the splits of one axis, culling off and on, against both baselines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter

# Okabe and Ito's palette, told apart by the colour-blind too; shapes and dashes say the same again.
_SERIES: dict[bool, dict[str, Any]] = {
    False: {"color": "#D55E00", "marker": "s", "label": "aligned, culling off"},
    True: {"color": "#0072B2", "marker": "o", "label": "aligned, culling on"},
}
_BASELINES: tuple[tuple[str, dict[str, Any]], ...] = (
    ("baseline_render_time_s", {"color": "#333333", "linestyle": (0, (6, 2)), "label": "rtcIntersect1 per pixel"}),
    ("packets_render_time_s", {"color": "#009E73", "linestyle": (0, (1, 1.2)), "label": "packets per pixel"}),
)
_PANEL_FIELDS = ("width", "height", "packet_width", "threads", "build_quality")
_MILLISECONDS = 1e3
_TIMES = "\N{MULTIPLICATION SIGN}"


def draw_split_figure(table: pd.DataFrame, axis_name: str = "split_x") -> Figure:
    """One panel a scene (and a value of any other field that varies); milliseconds over splits, both logarithmic.

    axis_name: the column on the abscissa, `split_x` (horizontal splits, the paper's figure 5) or `split_y` (vertical).
    Points are medians with bars from the lower to the upper quartile over rounds. A baseline is measured again with
    every point: its line is the median over all of them, its band reaches from lower to upper quartile.
    """
    panels = _panels(table, axis_name)
    columns = 1 if len(panels) == 1 else 2
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(7.2 if columns == 1 else 11.5, 4.1 * rows + 1.1), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for axis, (title, rows_of_panel) in zip(axes, panels, strict=False):
        _draw_panel(axis, title, rows_of_panel, axis_name)
    for axis in axes[len(panels) :]:
        axis.set_visible(False)
    handles: dict[str, Any] = {}
    for axis in axes[: len(panels)]:
        handles |= {label: handle for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    order = [series["label"] for series in _SERIES.values()] + [style["label"] for _, style in _BASELINES]
    labels = [label for label in order if label in handles]
    legend_columns = len(labels) if columns > 1 else 2
    shown = [handles[label] for label in labels]
    figure.legend(shown, labels, loc="outside upper center", ncols=legend_columns, frameon=False)
    figure.supxlabel(
        describe_measurement(table, "best speed-up over rtcIntersect1 in bold"), fontsize=8, color="#555555"
    )
    return figure


def _panels(table: pd.DataFrame, axis_name: str) -> list[tuple[str, pd.DataFrame]]:
    aligned = table[table["method"] == "aligned"]
    aligned = aligned if len(aligned) else table
    fields = (*_PANEL_FIELDS, "split_y" if axis_name == "split_x" else "split_x")
    varying = [name for name in fields if _varies(aligned, name)]
    panels = []
    for key, rows in aligned.groupby(["scene", *varying], sort=False, dropna=False):
        scene, *values = key if isinstance(key, tuple) else (key,)
        details = [f"{name} {value}" for name, value in zip(varying, values, strict=True)]
        triangles = rows["triangles"].iloc[0]
        panels.append((", ".join([f"{scene} ({triangles:,} triangles)", *details]), rows))
    return panels


def _varies(table: pd.DataFrame, name: str) -> bool:
    return bool(table[name].nunique() > 1)


def _draw_panel(axis: Axes, title: str, rows: pd.DataFrame, axis_name: str) -> None:
    axis.set_title(title, fontsize=11, loc="left")
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    measured = rows[rows["status"] == "ok"]
    for culling, style in _SERIES.items():
        series = measured[measured["culling"] == culling].sort_values(axis_name)
        if len(series) == 0:
            continue
        time_ms, low_ms, high_ms = (
            series[name].to_numpy(float) * _MILLISECONDS
            for name in ("render_time_s", "render_time_q1_s", "render_time_q3_s")
        )
        axis.errorbar(
            series[axis_name].to_numpy(float), time_ms, yerr=[time_ms - low_ms, high_ms - time_ms],
            linewidth=1.6, markersize=5, capsize=2.5, elinewidth=1.1, zorder=3, **style,
        )  # fmt: skip
        _mark_best(axis, series, str(style["color"]), axis_name)
    for column, style in _BASELINES:
        _draw_baseline(axis, measured[column].astype(float) * _MILLISECONDS, style)
    splits = sorted(int(split) for split in rows[axis_name].unique())
    _mark_missing(axis, rows[rows["status"] != "ok"], axis_name)
    axis.set_xticks(splits, [str(split) for split in splits])
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.minorticks_off()
    axis.set_xlim(splits[0] / 1.35, splits[-1] * 1.35)
    low, high = axis.get_ylim()
    axis.set_ylim(low / 1.25, high * 1.1)
    axis.set_yticks(_ticks(*axis.get_ylim()))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_xlabel("horizontal splits" if axis_name == "split_x" else "vertical splits")
    axis.set_ylabel("time per frame in ms")
    axis.grid(True, which="major", color="#DDDDDD", linewidth=0.6)
    axis.set_axisbelow(True)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)


def _draw_baseline(axis: Axes, times_ms: pd.Series, style: dict[str, Any]) -> None:
    if len(times_ms) == 0:
        return
    q1, median, q3 = (float(times_ms.quantile(q)) for q in (0.25, 0.5, 0.75))
    axis.axhspan(q1, q3, color=style["color"], alpha=0.15, linewidth=0, zorder=1)
    axis.axhline(median, linewidth=1.5, zorder=2, **style)


def _mark_best(axis: Axes, series: pd.DataFrame, color: str, axis_name: str) -> None:
    best = series.loc[series["render_time_s"].astype(float).idxmin()]
    offset = (0, -13) if best["culling"] else (0, 8)
    axis.annotate(
        f"{best['speedup']:.2f}{_TIMES}",
        (float(best[axis_name]), float(best["render_time_s"]) * _MILLISECONDS),
        xytext=offset, textcoords="offset points", ha="center", fontsize=8.5, color=color, fontweight="bold",
        bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}, zorder=4,
    )  # fmt: skip


def _mark_missing(axis: Axes, missing: pd.DataFrame, axis_name: str) -> None:
    """A cross on the upper edge for each point without a time, and the reason in words."""
    notes = []
    for (culling, status), rows in missing.groupby(["culling", "status"], sort=False):
        style = _SERIES[bool(culling)]
        splits = sorted(int(split) for split in rows[axis_name])
        # Off and on apart, so that one cross does not hide the other.
        height = 0.985 if culling else 0.945
        axis.plot(
            splits, [height] * len(splits), "x", color=style["color"], markersize=6, markeredgewidth=1.8,
            transform=axis.get_xaxis_transform(), clip_on=False, zorder=5,
        )  # fmt: skip
        listed = ", ".join(str(split) for split in splits)
        notes.append(f"{_TIMES} culling {'on' if culling else 'off'}, {listed}: {status}, {_reason(rows['error'])}")
    if notes:
        axis.text(
            0.0, -0.17, "\n".join(notes), transform=axis.transAxes, ha="left", va="top", fontsize=7.5, color="#555555"
        )


def _reason(errors: pd.Series) -> str:
    text = str(errors.iloc[0])
    lowered = text.lower()
    if "budget" in lowered or "memory" in lowered:
        return "needs more memory than its budget"
    if "does not divide" in lowered:
        return "does not divide the image"
    return text if len(text) <= 60 else text[:59] + "…"


def _ticks(low: float, high: float) -> list[float]:
    ticks: list[float] = []
    for steps in ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(range(10, 100, 5))):
        ticks = [step * 10.0**power for power in range(-4, 7) for step in steps]
        ticks = sorted({tick for tick in ticks if low <= tick <= high})
        if len(ticks) >= 4:
            break
    return ticks


def describe_measurement(table: pd.DataFrame, mark: str) -> str:
    """Two lines for the foot of a figure: what is common to its points, the machine, the day, the doubts.

    mark: what the figure sets apart, in words.
    """
    measured = table[table["status"] == "ok"]
    size = _common(measured, ("width", "height"), f"{{}} {_TIMES} {{}} pixels")
    threads = _common(measured, ("threads",), "threads {}")
    packets = _common(measured, ("packet_width",), "packet width {}")
    rounds = f"median and quartiles of {measured['rounds'].min()} to {measured['rounds'].max()} rounds"
    if measured["rounds"].nunique() == 1:
        rounds = f"median and quartiles of {measured['rounds'].iloc[0]} rounds"
    cpus = " / ".join(sorted(measured["cpu"].dropna().unique()))
    days = sorted({str(moment)[:10] for moment in measured["measured_at"].dropna()})
    date = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
    doubtful = int(measured["doubts"].notna().sum())
    doubts = f"{doubtful} of {len(measured)} points carry doubts (see table)" if doubtful else ""
    first = ", ".join(filter(None, [size, threads, packets, rounds]))
    second = ", ".join(filter(None, [cpus, date, mark, doubts]))
    return f"{first}\n{second}"


def _common(table: pd.DataFrame, names: Sequence[str], form: str) -> str:
    """`form` with the values of `names`, or "" if one of them varies or is missing."""
    if any(table[name].isna().any() or _varies(table, name) for name in names):
        return ""
    return form.format(*(table[name].iloc[0] for name in names))
