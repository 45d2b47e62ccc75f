"""Cost of a method over many frames of one view, and from which frame on it is ahead of packets per pixel."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from math import floor

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.figure import Axis, Figure, Line, Mark, Panel
from experiments.drawing.style import DOTTED, GREEN, TIMES
from experiments.drawing.values import MILLISECONDS, column, say_number
from experiments.methods import METHODS
from experiments.methods.naming import best_of, say_series, say_split
from experiments.methods.pixel import PIXEL, SAME
from experiments.workloads.frame import FRAME
from experiments.workloads.frame_figures import ring
from experiments.workloads.panels import figure_of, make_panels, read_panels
from experiments.workloads.series import OVER_PACKETS, best_rows, choosing, say_unmeasured, series_of, style_of


@dataclass(frozen=True)
class Cost:
    """Seconds a method takes on one scene, and the bytes of its Embree scenes; None where unknown.

    first_frame_time_s: the first frame after the build, with cold caches. frame_time_s: every further frame.
    embree_bytes: Embree's own account. packets_frame_time_s: a frame of packets per pixel in the same rounds.
    """

    method: str
    plan_time_s: float
    build_time_s: float
    first_frame_time_s: float
    frame_time_s: float
    embree_bytes: int | None = None
    packets_frame_time_s: float | None = None

    @property
    def once_s(self) -> float:
        """Plan and build."""
        return self.plan_time_s + self.build_time_s


def time_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of timed frames, measured or not; a row that does not say what it measured counts as one."""
    if "workload" not in table:
        return table
    return table[table["workload"].fillna(FRAME.name).eq(FRAME.name).astype(bool)]


def cost_of(row: pd.Series) -> Cost | None:
    """The cost of one row of the table, or None where a time is missing. Rays per pixel need no plan: it takes 0."""
    names = ("plan_time_s", "build_time_s", "first_frame_time_s", "render_time_s")
    times = {name: row.get(name) for name in names}
    if row["method"] == PIXEL.name and pd.isna(times["plan_time_s"]):
        times["plan_time_s"] = 0.0
    if any(pd.isna(value) for value in times.values()):
        return None
    stored = row.get("embree_bytes")
    plan_s, build_s, first_s, frame_s = (float(times[name]) for name in names)
    embree_bytes = None if pd.isna(stored) else int(stored)
    packets = row.get("packets_render_time_s")
    packets_s = None if pd.isna(packets) else float(packets)
    return Cost(str(row["method"]), plan_s, build_s, first_s, frame_s, embree_bytes, packets_s)


def baseline_costs(rows: pd.DataFrame) -> dict[str, Cost]:
    """The fastest packets per pixel on one scene for each build quality, the usual one ("same") first.

    A cheap build suits few frames, a good one many.
    """
    chosen = rows["method"].eq(PIXEL.name) & rows["packet_width"].gt(1)
    packets = rows[chosen.fillna(False).astype(bool)]
    qualities = column(packets, "own_build_quality").fillna(SAME).astype(str)
    fastest: dict[str, Cost] = {}
    for quality in sorted(qualities.unique(), key=lambda name: (name != SAME, name)):
        costs = [cost_of(row) for _, row in best_rows(packets[(qualities == quality).to_numpy(bool)]).iterrows()]
        known = [cost for cost in costs if cost is not None]
        if known:
            fastest[quality] = min(known, key=lambda cost: cost.frame_time_s)
    return fastest


def cumulative_time_s(cost: Cost, frames: NDArray[np.integer]) -> NDArray[np.float64]:
    """Seconds from the start of the plan to the end of the n-th frame.

    frames: (N,) whole numbers from 1. Returns (N,) float64.
    """
    return cost.once_s + cost.first_frame_time_s + (np.asarray(frames, np.float64) - 1) * cost.frame_time_s


def break_even_frames(cost: Cost, baselines: Iterable[Cost]) -> int | None:
    """The smallest number of frames after which `cost` stays below every baseline (at least one) in total time.

    1 = ahead from the first frame on; None = never, which includes a lead that further frames use up.
    """
    frames = [_ahead_of(cost, baseline) for baseline in baselines]
    return None if None in frames else max(count for count in frames if count is not None)


def break_even_interval(cost: Cost, gains: Iterable[float], baselines: Collection[Cost]) -> list[int | None]:
    """`break_even_frames` for each of some speed-ups over packets, such as both ends of an interval."""
    packets_s = cost.packets_frame_time_s
    assert packets_s is not None
    return [break_even_frames(replace(cost, frame_time_s=packets_s / gain), baselines) for gain in gains]


def _ahead_of(cost: Cost, baseline: Cost) -> int | None:
    """As `break_even_frames`, of one baseline."""
    # The two were timed in different processes, each in rounds with the same packets: their ratio removes drift.
    baseline_frame_s = baseline.frame_time_s
    if cost.packets_frame_time_s and baseline.packets_frame_time_s:
        baseline_frame_s *= cost.packets_frame_time_s / baseline.packets_frame_time_s
    # After n frames it is behind by `behind_s` - (n - 1) * `gain_s`.
    behind_s = cost.once_s + cost.first_frame_time_s - baseline.once_s - baseline.first_frame_time_s
    gain_s = baseline_frame_s - cost.frame_time_s
    if gain_s < 0 or (gain_s == 0 and behind_s >= 0):
        return None
    if behind_s < 0:
        return 1
    return floor(behind_s / gain_s) + 2


LAST_FRAME = 1000

_BASELINE = "fastest packets per pixel"
_HEADINGS = ("ms, bytes over those of packets", "plan", "build", "first frame", "further ones", "bytes", "ahead from")


def break_even_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene (and a value of any other setting that varies); seconds over frames.

    Both axes are logarithmic. A line is a method at its best split and packet width: plan, build and first frame, then
    further frames. A ring marks the frame from which on it is ahead of packets per pixel of any build quality; their
    line shows the cheapest. Beside each panel stand the parts of the cost.
    """
    rows = time_rows(table)
    rows = rows[rows["method"].isin([*_prepared(), PIXEL.name])]
    panels = read_panels(make_panels(rows, (*best_of(), "packet_width")), _panel)
    return figure_of(
        "lines", panels, rows, f"ring: ahead of {_BASELINE} from this frame on, whatever their build",
        x=Axis("frames of one view"), y=Axis("time in s, plan and build included"),
        legend=[*(say_series(method, None) for method in _prepared()), _BASELINE], headings=_HEADINGS,
    )  # fmt: skip


def _prepared() -> list[str]:
    """All methods but peers and the baseline."""
    return [method.name for method in METHODS if not method.is_peer and method.name != PIXEL.name]


def _panel(rows: pd.DataFrame) -> Panel:
    notes: list[str] = []
    lines: list[Line] = []
    rings: list[Mark] = []
    table: list[tuple[str, ...]] = []
    baselines = baseline_costs(rows)
    packets = list(baselines.values())
    for method in _prepared():
        points = rows[rows["method"].eq(method).fillna(False).astype(bool)]
        for _, width, of_width in series_of(points):
            notes += say_unmeasured(of_width, say_series(method, width))
        row = _best_of_all(points)
        cost = cost_of(row) if row is not None else None
        if row is None or cost is None:
            if points["status"].eq("ok").any():
                notes.append(f"{TIMES} {say_series(method, None)}: plan, build or first frame not measured")
            continue
        color = style_of(method, None)["color"]
        lines.append(_line(say_series(method, None), [cost], {"color": color}))
        width = None if pd.isna(row["packet_width"]) else int(row["packet_width"])
        table.append(_parts(", ".join(filter(None, [say_series(method, width), say_split(row)])), cost, packets))
        even = break_even_frames(cost, packets) if packets else None
        if even is not None and even <= LAST_FRAME:
            rings.append(ring(even, float(cumulative_time_s(cost, np.array([even]))[0]), color, drop=True))
    if packets:
        lines.append(_line(_BASELINE, packets, {"color": GREEN, "linestyle": DOTTED}))
    else:
        notes.append(f"{TIMES} {_BASELINE}: not measured in full, so no break-even")
    for quality, baseline in baselines.items():
        name = _BASELINE if baseline is packets[0] else f"the same, {quality} build quality"
        table.append(_parts(name, baseline, packets))
    return Panel(lines=lines, marks=rings, notes=notes, table=table)


def _best_of_all(points: pd.DataFrame) -> pd.Series | None:
    """The best split at the best packet width."""
    best = best_rows(points)
    if len(best) == 0:
        return None
    return best.iloc[int(np.argmax(choosing(best, OVER_PACKETS)))]


def _line(label: str, costs: list[Cost], style: dict[str, object]) -> Line:
    """The least of these costs over the number of frames."""
    frames = np.unique(np.geomspace(1, LAST_FRAME, 200).round().astype(np.int64))
    times_s = np.min([cumulative_time_s(cost, frames) for cost in costs], axis=0)
    return Line(label, frames.astype(np.float64), times_s, style)


def _parts(name: str, cost: Cost, baselines: list[Cost]) -> tuple[str, ...]:
    """The parts of a cost: times in ms, bytes over those of the usual packets, the break-even."""
    times = (cost.plan_time_s, cost.build_time_s, cost.first_frame_time_s, cost.frame_time_s)
    said = (say_number(time_s * MILLISECONDS) for time_s in times)
    return (name, *said, _say_bytes(cost, baselines), _say_even(cost, baselines))


def _say_bytes(cost: Cost, baselines: list[Cost]) -> str:
    stored = baselines[0].embree_bytes if baselines else None
    return f"{cost.embree_bytes / stored:.2f}{TIMES}" if cost.embree_bytes and stored else "-"


def _say_even(cost: Cost, baselines: list[Cost]) -> str:
    if not baselines or cost in baselines:
        return "-"
    even = break_even_frames(cost, baselines)
    return "never" if even is None else f"frame {even:,}"
