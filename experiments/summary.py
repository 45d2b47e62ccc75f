"""What the terminal shows: one point, or a sweep in short."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from atra.records import Record
from experiments.worker import OWN, SINGLE


def say_outcome(record: Record) -> str:
    """One line on a record, for the progress display."""
    if record.status != "ok":
        return f"{record.status}: {record.error}"
    own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
    return f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x rtcIntersect1"


def print_point(row: pd.Series, console: Console) -> None:
    """A measured row of the table, in groups a reader wants together."""
    shown = Table(title=f"{row['scene']}, {row['width']} x {row['height']}", show_header=False, title_justify="left")
    shown.add_column(style="bold")
    shown.add_column()
    split = f", split {row['split_x']} x {row['split_y']}, culling {'on' if row['culling'] else 'off'}"
    method = f"{row['method']}{split if row['method'] == 'aligned' else ''}, packets of {row['packet_width']}"
    threads = "every core" if pd.isna(row["threads"]) else str(row["threads"])
    lines = [
        ("method", f"{method}, threads {threads}, build quality {row['build_quality']}"),
        ("triangles", f"{row['triangles']:,}, traced {row['triangles_traced']:,}"),
        ("plan, build", f"{_ms(row['plan_time_s'])}, {_ms(row['build_time_s'])}"),
        ("frame", f"{_time(row, 'render_time')}  ({row['rounds']} rounds)"),
        ("rtcIntersect1 per pixel", _time(row, "baseline_render_time")),
        (f"packets of {row['packets_width']} per pixel", _time(row, "packets_render_time")),
        ("speed-up over rtcIntersect1", f"{row['speedup']:.2f}x"),
        ("speed-up over packets", f"{row['speedup_vs_packets']:.2f}x"),
        ("memory", f"{_mib(row['rss_bytes'])}, peak {_mib(row['peak_rss_bytes'])}, Embree {_mib(row['embree_bytes'])}"),
        (
            "pixels",
            f"equal {row['pixels_equal']:,}, tied {row['pixels_tied']:,}, edge {row['pixels_edge']:,}, "
            f"wrong {row['pixels_wrong']:,}",
        ),
        ("machine", str(row["cpu"])),
    ]
    if not pd.isna(row["doubts"]):
        lines.append(("doubts", str(row["doubts"])))
    for name, text in lines:
        shown.add_row(name, escape(text))
    console.print(shown)


def print_sweep(table: pd.DataFrame, folder: Path, console: Console) -> None:
    """The best split of each scene with culling off and on, wrong pixels, and every row that is missing."""
    measured = table[table["status"] == "ok"]
    best = Table(title="best split of each scene", title_justify="left")
    for name in ("scene", "culling", "split", "frame", "vs rtcIntersect1", "vs packets", "pixels wrong"):
        best.add_column(name, justify="left" if name in ("scene", "culling") else "right")
    for (scene, culling), rows in measured.groupby(["scene", "culling"], sort=False):
        row = rows.loc[rows["render_time_s"].astype(float).idxmin()]
        best.add_row(
            escape(str(scene)),
            "on" if culling else "off",
            f"{row['split_x']} x {row['split_y']}",
            _ms(row["render_time_s"]),
            f"{row['speedup']:.2f}x",
            f"{row['speedup_vs_packets']:.2f}x",
            str(rows["pixels_wrong"].sum()),
        )
    if len(measured):
        console.print(best)
    missing = table[table["status"] != "ok"]
    for (scene, status, _), rows in missing.groupby(
        ["scene", "status", missing["error"].map(_kind_of_error)], sort=False
    ):
        points = "; ".join(
            f"culling {'on' if culling else 'off'} "
            + ", ".join(f"{x}x{y}" for x, y in zip(some["split_x"], some["split_y"], strict=True))
            for culling, some in rows.groupby("culling")
        )
        console.print(f"{status}: {scene}, {points}", markup=False, highlight=False, soft_wrap=True)
        console.print(f"    {rows['error'].iloc[0]}", markup=False, highlight=False, soft_wrap=True)
    counts = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    files = ", ".join(path.name for path in sorted(folder.iterdir()) if path.is_file() and path.name[0] != ".")
    console.print(
        f"{counts or 'nothing measured'}; in {folder}: {files}", markup=False, highlight=False, soft_wrap=True
    )


def _kind_of_error(error: str) -> str:
    """The text without its numbers: errors that differ in nothing else are one kind."""
    return re.sub(r"\d+(?:[.,]\d+)*", "#", error)


def results_console() -> Console:
    """Where results are printed; wide enough for the tables where there is no terminal to ask."""
    console = Console()
    return console if console.is_terminal else Console(width=120)


def _ms(seconds: Any) -> str:
    return f"{seconds * 1e3:,.1f} ms"


def _time(row: pd.Series, name: str) -> str:
    """Median and quartiles of a time."""
    low, high = row[f"{name}_q1_s"] * 1e3, row[f"{name}_q3_s"] * 1e3
    return f"{_ms(row[f'{name}_s'])}  quartiles {low:,.1f} to {high:,.1f}"


def _mib(count: Any) -> str:
    return f"{count / 2**20:,.1f} MiB"
