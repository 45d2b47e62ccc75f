"""Records -> table: one row a point."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.records import Record, write_atomically
from experiments.worker import OWN, PACKETS, SINGLE

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
    # From here on beyond what was asked for.
    "rounds": _WHOLE,
    "render_time_q1_s": _REAL,
    "render_time_q3_s": _REAL,
    "render_time_spread_s": _REAL,
    "baseline_render_time_q1_s": _REAL,
    "baseline_render_time_q3_s": _REAL,
    "packets_render_time_q1_s": _REAL,
    "packets_render_time_q3_s": _REAL,
    "speedup_q1": _REAL,
    "speedup_q3": _REAL,
    "speedup_vs_packets_q1": _REAL,
    "speedup_vs_packets_q3": _REAL,
    "packets_width": _WHOLE,
    "baseline_build_time_s": _REAL,
    "rss_start_bytes": _WHOLE,
    "rss_mesh_bytes": _WHOLE,
    "doubts": _TEXT,
    "cpu": _TEXT,
    "measured_at": _TEXT,
    "point_id": _TEXT,
}
"""Columns in order, with their pandas types. Times are seconds and medians over rounds; `_q1`, `_q3` are quartiles and
`_spread` the distance between them. `speedup` is rtcIntersect1 / this and `speedup_vs_packets` packets / this, each the
median of the ratios of single rounds. What was not measured is missing, never zero."""


def make_table(records: Sequence[Record]) -> pd.DataFrame:
    """One row a record, in the order given."""
    rows = [_row(record) for record in records]
    return pd.DataFrame({name: pd.array([row.get(name) for row in rows], dtype=kind) for name, kind in COLUMNS.items()})


def write_table(folder: Path, table: pd.DataFrame) -> None:
    """Write `table.csv` and `table.parquet` into `folder`."""
    write_atomically(folder / "table.csv", table.to_csv(index=False).encode())
    buffer = io.BytesIO()
    table.to_parquet(buffer, index=False)
    write_atomically(folder / "table.parquet", buffer.getvalue())


def _row(record: Record) -> dict[str, Any]:
    row: dict[str, Any] = {name: record.configuration.get(name) for name in COLUMNS}
    # The number of rounds asked for is configuration; the column holds how many ran.
    row["rounds"] = None
    # Results come second: the packet width and threads that ran, where the configuration leaves them to the machine.
    row |= {name: value for name, value in record.results.items() if name in COLUMNS}
    row |= {
        "status": record.status,
        "error": record.error,
        "point_id": record.point_id,
        "cpu": record.environment.get("cpu"),
        "measured_at": record.environment.get("taken_at"),
    }
    if record.status == "ok":
        own, single, packets = (np.asarray(record.samples[name], np.float64) for name in (OWN, SINGLE, PACKETS))
        row |= _quartiles("render_time{}_s", own)
        row["render_time_spread_s"] = row["render_time_q3_s"] - row["render_time_q1_s"]
        row |= _quartiles("baseline_render_time{}_s", single)
        row |= _quartiles("packets_render_time{}_s", packets)
        row |= _quartiles("speedup{}", single / own)
        row |= _quartiles("speedup_vs_packets{}", packets / own)
        row["doubts"] = "; ".join(_doubts(record, own)) or None
    return row


def _quartiles(name: str, values: NDArray[np.float64]) -> dict[str, float]:
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    return {name.format(""): float(median), name.format("_q1"): float(q1), name.format("_q3"): float(q3)}


def _doubts(record: Record, own: NDArray[np.float64]) -> list[str]:
    """Reasons to distrust the times of a point."""
    doubts = []
    q1, median, q3 = np.quantile(own, [0.25, 0.5, 0.75])
    if q3 - q1 >= 0.1 * median:
        doubts.append(f"spread is {(q3 - q1) / median:.0%} of the median")
    if own.min() < 1e-3:
        doubts.append("shortest sample is below 1 ms")
    asked = record.configuration.get("rounds")
    if asked is not None and len(own) < asked:
        doubts.append(f"{len(own)} of {asked} rounds")
    return doubts
