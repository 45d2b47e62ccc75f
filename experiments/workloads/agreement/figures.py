"""Who is wrong where a method and rtcIntersect1 differ: counts of the oracle, method beside baseline."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from atra.judge.compare import Verdict
from experiments.drawing.axes import tidy_axis
from experiments.drawing.pages import write_notes
from experiments.drawing.style import BLACK, BLUE, GREY, SMALL, TIMES
from experiments.drawing.values import column, numbers
from experiments.methods.naming import say_kind
from experiments.results.settings import settings
from experiments.workloads.agreement import AGREEMENT
from experiments.workloads.agreement.results import TARGET, errs_too_often
from experiments.workloads.images import HOLES, say_holes
from experiments.workloads.panels import make_panels, panels_figure, workload_figure
from experiments.workloads.series import say_unmeasured

_SERIES = {"method": ("method_wrong", BLUE), "rtcIntersect1": ("baseline_wrong", BLACK)}
"""Label -> column and colour, from the top down."""

_BAR = 0.2


def draw_agreement_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene, one pair of bars a method: pixels at which it and rtcIntersect1 are wrong by the oracle.

    Counts pixels where the two differ, over all splits, offsets and image sizes. The axis is linear from 0 to 1 and
    logarithmic beyond.
    """
    panels = make_panels(table, settings())
    tallest = max((panel.rows.apply(say_kind, axis=1).nunique() for panel in panels), default=1)
    images = int(numbers(table, "images")[column(table, "images").notna().to_numpy(bool)].sum())
    foot = f"{images:,} images, every pixel compared; wrong by float64 where the images differ"
    return panels_figure(panels, _draw_panel, columns, table, foot, legend=list(_SERIES), height=1.6 + 0.65 * tallest)


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    notes, kinds = [], rows.apply(say_kind, axis=1)
    names = list(dict.fromkeys(kinds))
    counted = rows["status"].eq("ok") & column(rows, "method_wrong").notna() & column(rows, "baseline_wrong").notna()
    highest = 1
    for place, name in enumerate(names):
        notes += say_unmeasured(rows[kinds == name], name)
        of_kind = rows[(kinds == name) & counted]
        if len(of_kind) == 0:
            _write(axis, place, f"{name}: not measured", GREY)
            continue
        counts = {label: int(of_kind[source].sum()) for label, (source, _) in _SERIES.items()}
        for offset, (label, (_, color)) in zip((-0.5, 0.5), _SERIES.items(), strict=True):
            axis.barh(place + 0.25 + offset * _BAR, counts[label], height=_BAR, color=color, label=label, zorder=2)
        highest = max(highest, *counts.values())
        _write(axis, place, f"{name}: {_say(of_kind, counts)}", BLACK)
    axis.set_yticks([])
    axis.set_ylim(max(len(names), 1) - 0.5, -0.5)
    _finish(axis, highest)
    sampled = rows[counted]
    if len(sampled):
        wrong = " and ".join(f"{sampled[f'sampled_{who}_wrong'].sum():,}" for who in ("method", "baseline"))
        notes.append(
            f"of {sampled['rays_sampled'].sum():,} rays drawn from all pixels and tested with every triangle, the "
            f"methods and rtcIntersect1 are wrong at {wrong}"
        )
    write_notes(axis, notes)


def _say(rows: pd.DataFrame, counts: dict[str, int]) -> str:
    verdicts = {kind: int(rows[f"pixels_{kind.name.lower()}"].sum()) for kind in Verdict}
    told = ", ".join(f"{verdicts[kind]:,} {kind.name.lower()}" for kind in (Verdict.WRONG, Verdict.EDGE, Verdict.TIED))
    told = told.replace(" wrong", f" wrong{say_holes({name: column(rows, name).sum() for name in HOLES})}", 1)
    beyond = f", over {TARGET}{TIMES}" if errs_too_often(rows) else ""
    method, baseline = counts.values()
    return f"{method:,} : {baseline:,}{beyond}\nof {sum(verdicts.values()) / 1e6:.3g} M pixels; {told}"


def _write(axis: Axes, place: int, text: str, color: str) -> None:
    axis.text(
        0, place - 0.18, text, transform=axis.get_yaxis_transform(), va="center", fontsize=SMALL, color=color, zorder=4,
        bbox={"boxstyle": "square,pad=0", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _finish(axis: Axes, highest: int) -> None:
    axis.set_xscale("symlog", linthresh=1, linscale=0.4)
    ticks = [0, *(10**power for power in range(len(str(highest)) + 1) if 10**power <= 10 * highest)]
    axis.set_xticks(ticks)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set_xlim(0, 1.2 * highest)
    axis.set_xlabel("pixels")
    tidy_axis(axis, "x", frame=("bottom",))


FIGURES = (
    workload_figure(
        "agreement", "Who is wrong, by float64, where a method and single rays per pixel differ", AGREEMENT,
        draw_agreement_figure,
    ),
)  # fmt: skip
