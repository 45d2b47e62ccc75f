"""Records -> table: one row a point."""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Mapping, Sequence
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files import write_atomically
from atra.planner.choice import PACKETS as PLANNER_PACKETS
from experiments.harness.configuration import Quantity
from experiments.harness.environment import BUSY_LOAD, describe_difference
from experiments.harness.records import Record
from experiments.workloads.multiframe.frame_tracing import SEPARATE, SEPARATE_VISIBLE
from experiments.workloads.quantities import BASELINE_BUILD, BUILD, OWN, PACKETS, PLAN, SINGLE
from scenes.built_in import BUILT_IN

_TEXT, _WHOLE, _REAL, _TRUTH = "string", "Int64", "Float64", "boolean"

COLUMNS = {
    "scene": _TEXT,
    "triangles": _WHOLE,
    "triangles_traced": _WHOLE,
    "width": _WHOLE,
    "height": _WHOLE,
    "split_x": _WHOLE,
    "split_y": _WHOLE,
    "culling": _TRUTH,
    "method": _TEXT,
    "packet_width": _WHOLE,
    "threads": _WHOLE,
    "build_quality": _TEXT,
    "plan_time_s": _REAL,
    "build_time_s": _REAL,
    "render_time_s": _REAL,
    "baseline_render_time_s": _REAL,
    "packets_render_time_s": _REAL,
    "speedup": _REAL,
    "speedup_vs_packets": _REAL,
    "rss_bytes": _WHOLE,
    "peak_rss_bytes": _WHOLE,
    "embree_bytes": _WHOLE,
    "pixels_equal": _WHOLE,
    "pixels_tied": _WHOLE,
    "pixels_edge": _WHOLE,
    "pixels_wrong": _WHOLE,
    "status": _TEXT,
    "error": _TEXT,
    "quantity": _TEXT,
    "geometry": _TEXT,
    "grids": _TEXT,
    "stands_for": _TEXT,
    "rounds": _WHOLE,
    "render_time_q1_s": _REAL,
    "render_time_q3_s": _REAL,
    "first_frame_time_s": _REAL,
    "render_time_spread_s": _REAL,
    "render_time_low_s": _REAL,
    "render_time_high_s": _REAL,
    "baseline_render_time_q1_s": _REAL,
    "baseline_render_time_q3_s": _REAL,
    "baseline_render_time_low_s": _REAL,
    "baseline_render_time_high_s": _REAL,
    "packets_render_time_q1_s": _REAL,
    "packets_render_time_q3_s": _REAL,
    "packets_render_time_low_s": _REAL,
    "packets_render_time_high_s": _REAL,
    "speedup_q1": _REAL,
    "speedup_q3": _REAL,
    "speedup_low": _REAL,
    "speedup_high": _REAL,
    "speedup_vs_packets_q1": _REAL,
    "speedup_vs_packets_q3": _REAL,
    "speedup_vs_packets_low": _REAL,
    "speedup_vs_packets_high": _REAL,
    "packets_width": _WHOLE,
    **{
        f"{name}_render_time{part}_s": _REAL
        for name in PACKETS.values()
        for part in ("", "_q1", "_q3", "_low", "_high")
    },
    "frames": _WHOLE,
    "motion": _TEXT,
    "separate_render_time_s": _REAL,
    "separate_render_time_q1_s": _REAL,
    "separate_render_time_q3_s": _REAL,
    "separate_render_time_low_s": _REAL,
    "separate_render_time_high_s": _REAL,
    "visible_first_render_time_s": _REAL,
    "visible_first_render_time_q1_s": _REAL,
    "visible_first_render_time_q3_s": _REAL,
    "visible_first_render_time_low_s": _REAL,
    "visible_first_render_time_high_s": _REAL,
    "speedup_vs_separate": _REAL,
    "speedup_vs_separate_q1": _REAL,
    "speedup_vs_separate_q3": _REAL,
    "speedup_vs_separate_low": _REAL,
    "speedup_vs_separate_high": _REAL,
    "speedup_vs_visible_first": _REAL,
    "speedup_vs_visible_first_q1": _REAL,
    "speedup_vs_visible_first_q3": _REAL,
    "speedup_vs_visible_first_low": _REAL,
    "speedup_vs_visible_first_high": _REAL,
    "separate_embree_bytes": _WHOLE,
    "plan_time_q1_s": _REAL,
    "plan_time_q3_s": _REAL,
    "plan_time_low_s": _REAL,
    "plan_time_high_s": _REAL,
    "build_time_q1_s": _REAL,
    "build_time_q3_s": _REAL,
    "build_time_low_s": _REAL,
    "build_time_high_s": _REAL,
    "baseline_build_time_s": _REAL,
    "baseline_build_time_q1_s": _REAL,
    "baseline_build_time_q3_s": _REAL,
    "baseline_build_time_low_s": _REAL,
    "baseline_build_time_high_s": _REAL,
    "rss_start_bytes": _WHOLE,
    "rss_mesh_bytes": _WHOLE,
    "depth_error_max": _REAL,
    "depth_error_p999": _REAL,
    "baseline_depth_error_max": _REAL,
    "baseline_depth_error_p999": _REAL,
    "images": _WHOLE,
    "method_wrong": _WHOLE,
    "baseline_wrong": _WHOLE,
    "rays_sampled": _WHOLE,
    "sampled_method_wrong": _WHOLE,
    "sampled_baseline_wrong": _WHOLE,
    "mesh_sha256": _TEXT,
    "view": _TEXT,
    "eye": _TEXT,
    "target": _TEXT,
    "up": _TEXT,
    "fov_y_degrees": _REAL,
    "packet_rows": _TEXT,
    "ties": _TEXT,
    "best_plan": _TEXT,
    "best_frame_plan": _TEXT,
    "packets_regret": _REAL,
    "plan": _TEXT,
    "regret": _REAL,
    "frame_regret": _REAL,
    "vs_packets": _REAL,
    "predicted_time_s": _REAL,
    "planning_time_s": _REAL,
    "load_average": _REAL,
    "doubts": _TEXT,
    "cpu": _TEXT,
    "measured_at": _TEXT,
    "point_id": _TEXT,
}
"""Columns in order, with their pandas types. Times are seconds and medians over rounds; `_q1`, `_q3` are quartiles,
`_low`, `_high` the 95 % confidence interval of the median, `_spread` the distance between the quartiles. `speedup` is
rtcIntersect1 / this and `speedup_vs_packets` packets / this, each the median of the ratios of single rounds. Packets
are the fastest of the native widths, of `packets_width` rays; `packets_8_*` and so on are of each that was measured.
`quantity` says what was measured at the point (`experiments.harness.configuration.Quantity`), `grids` of which grids of
the sweep it is part, `stands_for` which scene of the paper a procedural stand-in replaces without being it. `pixels_*`
are sums over `images`, one an offset; of the pixels that are not equal the oracle finds the point's method wrong at
`method_wrong` and rtcIntersect1 at `baseline_wrong`; `sampled_*_wrong` are the same of `rays_sampled`, drawn from all
pixels. `depth_error_*` are the largest and the 99.9th percentile of the relative errors of stored depths against
float64, of the worst image; `baseline_*` those of rtcIntersect1. At a point of several `frames` times, bytes and pixels
are of all frames together; `separate_*` and `visible_first_*` are of one aligned and one visible-first tracer a frame
with the same split, one frame after the other, and the speed-ups over them are paired, too. `packet_rows` is what was
asked for. What was not measured is missing, never zero."""

CONFIDENCE = 0.95

_OUT_OF_PROPORTION = 10.0
"""A sample so many times longer or shorter than the median of its method is doubted."""

_CLOCK_JUMP_S = 2.0
"""What the wall clock may move apart from the steady one during a point before it is a doubt; slewing does less."""


def make_table(records: Sequence[Record], grids: Mapping[str, Sequence[str]] | None = None) -> pd.DataFrame:
    """One row a record, in the order given.

    grids: names of the grids each `point_id` is part of.
    Raises InputError as `check_one_environment`.
    """
    check_one_environment(records)
    rows = [_row(record) | {"grids": ",".join((grids or {}).get(record.point_id, ())) or None} for record in records]
    return pd.DataFrame({name: pd.array([row.get(name) for row in rows], dtype=kind) for name, kind in COLUMNS.items()})


def check_one_environment(records: Iterable[Record]) -> None:
    """Raise InputError when two records come from different machines or software, naming the field: their ratio would
    mean nothing."""
    first: Record | None = None
    for record in records:
        first = first or record
        difference = describe_difference(first.environment, record.environment)
        if difference is not None:
            raise InputError(
                f"records {first.point_id} and {record.point_id} are from two environments: {difference}; "
                "measure both on one machine with one version, or keep them in two results_dir"
            )


def csv_bytes(table: pd.DataFrame) -> bytes:
    """The content of `table.csv`.

    A spreadsheet runs a text that starts like a formula, and a scene is called what its file is called: such a text
    gets an apostrophe in front, which spreadsheets take for "text follows". A lone carriage return, which would break a
    row in two, is escaped. Parquet keeps every text as it is.
    """
    shown = table.copy()
    for name in shown.columns:
        if pd.api.types.is_string_dtype(shown[name].dtype):
            shown[name] = shown[name].map(_csv_text, na_action="ignore").astype(shown[name].dtype)
    return shown.to_csv(index=False).encode()


def _csv_text(text: str) -> str:
    return re.sub(r"\r(?!\n)", r"\\r", f"'{text}" if text.startswith(("=", "+", "-", "@")) else text)


def write_table(folder: Path, table: pd.DataFrame) -> None:
    """Write `table.csv` and `table.parquet` into `folder`."""
    write_atomically(folder / "table.csv", csv_bytes(table))
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    write_atomically(folder / "table.parquet", buffer.getvalue())


def read_table(folder: Path) -> pd.DataFrame | None:
    """The table in `folder`, or None if there is none. Raises InputError for a file that is not one of ours."""
    path = folder / "table.parquet"
    if not path.exists():
        return None
    try:
        table = pd.read_parquet(path)
        return table[list(COLUMNS)].astype(COLUMNS)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} cannot be read as a table of this version ({error}); run the sweep again") from None


def rows_of(table: pd.DataFrame, *grids: str) -> pd.DataFrame:
    """The rows of points that are part of any of the named grids."""
    of_points = table["grids"].fillna("").str.split(",")
    return table[of_points.map(lambda names: not set(grids).isdisjoint(names)).astype(bool)]


def _row(record: Record) -> dict[str, Any]:
    row: dict[str, Any] = {name: record.configuration.get(name) for name in COLUMNS}
    # The number of rounds asked for is configuration; the column holds how many ran.
    row["rounds"] = None
    # Results come second: the packet width and threads that ran, where the configuration leaves them to the machine.
    row |= {name: value for name, value in record.results.items() if name in COLUMNS}
    stand_in = BUILT_IN.get(str(row["scene"])) if record.configuration.get("scene_source") == "procedural" else None
    load = record.environment.get("load_average")
    row |= {name: _say_vector(row[name]) for name in ("eye", "target", "up")}
    row["packet_rows"] = "automatic" if row["packet_rows"] is None else str(row["packet_rows"])
    row |= {
        "stands_for": stand_in.stands_for if stand_in else None,
        "status": record.status,
        "error": record.error,
        "point_id": record.point_id,
        "cpu": record.environment.get("cpu"),
        "measured_at": record.environment.get("taken_at"),
        "load_average": load[0] if load else None,
    }
    if record.status == "ok" and record.samples:
        samples = {name: np.asarray(values, np.float64) for name, values in record.samples.items()}
        if OWN in samples:
            own, single, packets = samples[OWN], samples[SINGLE], samples[PACKETS[record.results["packets_width"]]]
            row |= _statistics("render_time{}_s", own)
            row["first_frame_time_s"] = float([*record.warmup_samples.get(OWN, []), *own][0])
            row["render_time_spread_s"] = row["render_time_q3_s"] - row["render_time_q1_s"]
            row |= _statistics("baseline_render_time{}_s", single)
            row |= _statistics("packets_render_time{}_s", packets)
            row |= _statistics("speedup{}", single / own)
            row |= _statistics("speedup_vs_packets{}", packets / own)
            for name in PACKETS.values():
                if name in samples:
                    row |= _statistics(name + "_render_time{}_s", samples[name])
            for name in (SEPARATE, SEPARATE_VISIBLE):
                if name in samples:
                    row |= _statistics(name + "_render_time{}_s", samples[name])
                    row |= _statistics("speedup_vs_" + name + "{}", samples[name] / own)
            judged = own
        elif record.configuration.get("quantity") == Quantity.planner.value:  # its ratios are among the results
            judged = samples[PLANNER_PACKETS]
        else:
            row |= _statistics("plan_time{}_s", samples[PLAN])
            row |= _statistics("build_time{}_s", samples[BUILD])
            row |= _statistics("baseline_build_time{}_s", samples[BASELINE_BUILD])
            judged = samples[BUILD]
        row["doubts"] = "; ".join(_doubts(record, judged)) or None
    return row


def _say_vector(vector: Sequence[float] | None) -> str | None:
    """ "0, 1, 3.5", every digit kept; None where a record holds none."""
    return None if vector is None else ", ".join(repr(float(value)).removesuffix(".0") for value in vector)


def _statistics(name: str, values: NDArray[np.float64]) -> dict[str, float]:
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    low, high = median_interval(values)
    named = {"": median, "_q1": q1, "_q3": q3, "_low": low, "_high": high}
    return {name.format(suffix): float(value) for suffix, value in named.items()}


def median_interval(values: NDArray[np.float64], confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Confidence interval of the median from order statistics, which assumes no distribution.

    The k-th smallest and k-th largest value enclose the median unless fewer than k samples fall on one side of it,
    which is binomial; k is the largest that keeps the confidence. Below 6 samples even k = 1 does not reach 95 %: the
    interval is then their whole range.
    """
    ordered = np.sort(values)
    count, miss, k = len(ordered), 0.0, 1
    for fewer in range(count // 2):
        miss += 2 * comb(count, fewer) / 2**count
        if miss > 1 - confidence:
            break
        k = fewer + 1
    return float(ordered[k - 1]), float(ordered[-k])


def _doubts(record: Record, own: NDArray[np.float64]) -> list[str]:
    """Reasons to distrust the times of a point."""
    doubts = []
    q1, median, q3 = np.quantile(own, [0.25, 0.5, 0.75])
    if q3 - q1 >= 0.1 * median:
        doubts.append(f"spread is {(q3 - q1) / median:.0%} of the median")
    if own.min() < 1e-3:
        doubts.append("shortest sample is below 1 ms")
    longest = max(max(values) / np.median(values) for values in record.samples.values())
    if longest > _OUT_OF_PROPORTION:
        doubts.append(f"longest sample is {longest:,.0f} times the median")
    shortest = max(np.median(values) / min(values) for values in record.samples.values())
    if shortest > _OUT_OF_PROPORTION:
        doubts.append(f"median is {shortest:,.0f} times the shortest sample")
    jump_s = record.results.get("clock_jump_s", 0.0)
    if abs(jump_s) > _CLOCK_JUMP_S:
        doubts.append(f"the wall clock jumped by {abs(jump_s):,.0f} s (set, or the machine slept)")
    asked = record.configuration.get("rounds")
    if asked is not None and len(own) < asked:
        doubts.append(f"{len(own)} of {asked} rounds")
    load, threads = record.environment.get("load_average"), record.results.get("threads")
    # The point measured just before leaves a load of its own threads.
    if load and threads and load[0] > threads + BUSY_LOAD:
        doubts.append(f"the machine was busy (load {load[0]:.1f})")
    return doubts
