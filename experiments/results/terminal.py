"""What the terminal shows: one point, or a sweep in short."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from atra.errors import printable
from experiments.harness.configuration import Geometry, Method, Quantity
from experiments.harness.messages import say
from experiments.harness.records import Record
from experiments.results.settings import FRAMES, GEOMETRY, SPLIT, say_setting, settings_that_vary
from experiments.workloads.agreement.agreement import agreement_lines
from experiments.workloads.multiframe.frame_tracing import SEPARATE
from experiments.workloads.planner.measure import say_regrets
from experiments.workloads.quantities import BUILD, OWN, PLAN, SINGLE

_SAID = (*FRAMES, *GEOMETRY, *SPLIT, "packet_width", "threads")
"""Settings that the tables name anyway, or of which they show the best."""


def say_outcome(record: Record) -> str:
    """One line on a record, for the progress display."""
    if record.status != "ok":
        return f"{record.status}: {record.error}"
    if OWN in record.samples:
        own, single = np.asarray(record.samples[OWN]), np.asarray(record.samples[SINGLE])
        told = f"{np.median(own) * 1e3:.1f} ms, {np.median(single / own):.2f}x rtcIntersect1"
        separate = record.samples.get(SEPARATE)
        return told if separate is None else f"{told}, {np.median(np.asarray(separate) / own):.2f}x separate frames"
    if BUILD in record.samples:
        plan, build = (np.median(record.samples[name]) for name in (PLAN, BUILD))
        return f"plan {_ms(plan)}, build {_ms(build)}"
    if "disagreements" in record.results:
        told = "{pixels_wrong} pixels wrong; by float64 {method_wrong} to {baseline_wrong}".format(**record.results)
        return f"{told}; depths off by up to {record.results['depth_error_max']:.1e}"
    if "regret" in record.results:
        return f"{record.results['plan']}, regret {record.results['regret']:.2f}"
    parts = [f"{_mib(record.results['embree_bytes'])} in Embree"] if "embree_bytes" in record.results else []
    if "pixels_wrong" in record.results:
        parts.append(f"{record.results['pixels_wrong']} pixels wrong")
    return ", ".join(parts) or f"{_mib(record.results['rss_bytes'])} resident"  # a peer does not tell what is Embree's


def print_point(row: pd.Series, console: Console) -> None:
    """A measured row of the table, in groups a reader wants together."""
    title = escape(printable(f"{row['scene']}, {row['width']} x {row['height']}"))
    shown = Table(title=title, show_header=False, title_justify="left")
    shown.add_column(style="bold")
    shown.add_column()
    method = f"{_describe(row)}, packets of {row['packet_width']}"
    threads = "every core" if pd.isna(row["threads"]) else str(row["threads"])
    lines = [
        ("method", f"{method}, threads {threads}, build quality {row['build_quality']}"),
        ("triangles", f"{row['triangles']:,}, traced {row['triangles_traced']:,}"),
    ]
    if not pd.isna(row["plan_time_s"]):
        lines.append(("plan, build", f"{_ms(row['plan_time_s'])}, {_ms(row['build_time_s'])}"))
    if not pd.isna(row["render_time_s"]):
        lines += [
            (
                "frame" if pd.isna(row["motion"]) else f"all {row['frames']} frames",
                f"{_time(row, 'render_time')}  ({row['rounds']} rounds)",
            ),
            ("rtcIntersect1 per pixel", _time(row, "baseline_render_time")),
            (f"packets of {row['packets_width']} per pixel", _time(row, "packets_render_time")),
            ("speed-up over rtcIntersect1", f"{row['speedup']:.2f}x"),
            ("speed-up over packets", f"{row['speedup_vs_packets']:.2f}x"),
        ]
        if not pd.isna(row["separate_render_time_s"]):
            lines += [
                ("one tracer a frame", _time(row, "separate_render_time")),
                ("visible-first, one a frame", _time(row, "visible_first_render_time")),
                ("speed-up over one a frame", f"{row['speedup_vs_separate']:.2f}x"),
                ("speed-up over visible-first", f"{row['speedup_vs_visible_first']:.2f}x"),
            ]
    if not pd.isna(row["pixels_wrong"]):
        counts = ", ".join(f"{kind} {row[f'pixels_{kind}']:,}" for kind in ("equal", "tied", "edge", "wrong"))
        lines.append(("pixels", counts))
    if not pd.isna(row["depth_error_max"]):
        lines.append(("largest depth error", f"{_depth_errors(row)} (99.9 % below {_depth_errors(row, 'p999')})"))
    if not pd.isna(row["method_wrong"]):
        errors = f"{row['method_wrong']:,} where they differ, rtcIntersect1 {row['baseline_wrong']:,}"
        sampled = f"{row['sampled_method_wrong']:,} and {row['sampled_baseline_wrong']:,}"
        lines.append(("wrong by float64", f"{errors}; of {row['rays_sampled']:,} sampled rays {sampled}"))
    memory = f"{_mib(row['rss_bytes'])}, peak {_mib(row['peak_rss_bytes'])}"
    if not pd.isna(row["embree_bytes"]):
        memory += f", Embree {_mib(row['embree_bytes'])}"
    lines += [("memory", memory), ("machine", str(row["cpu"]))]
    if not pd.isna(row["doubts"]):
        lines.append(("doubts", str(row["doubts"])))
    for name, text in lines:
        shown.add_row(name, escape(printable(text)))
    console.print(shown)


def _depth_errors(row: pd.Series, which: str = "max") -> str:
    """Relative, against float64."""
    own, single = row[f"depth_error_{which}"], row[f"baseline_depth_error_{which}"]
    return f"{own:.1e}, rtcIntersect1 {single:.1e}"


def _kind(row: pd.Series) -> str:
    """A method with what distinguishes it but the split."""
    kind = str(row["method"])
    if row["method"] == Method.aligned.value:
        instanced = row["geometry"] == Geometry.instanced.value
        kind += ", instanced" if instanced else f", culling {'on' if row['culling'] else 'off'}"
    several = not pd.isna(row["motion"])
    return f"{kind}, {row['frames']} frames, {row['motion']}" if several else kind


def _kind_and_threads(row: pd.Series) -> str:
    one = pd.isna(row["threads"]) or row["threads"] == 1
    return _kind(row) if one else f"{_kind(row)}, {row['threads']} threads"


def _describe(row: pd.Series) -> str:
    split = f", split {row['split_x']} x {row['split_y']}" if Method(row["method"]).has_cells else ""
    return _kind(row) + split


def print_sweep(table: pd.DataFrame, folder: Path, console: Console) -> None:
    """The best split of each scene with culling off and on, wrong pixels, and every row that is missing."""
    timed = table[(table["status"] == "ok") & (table["quantity"] == Quantity.time.value)]
    measured = timed[timed["motion"].isna()]
    best = Table(title="best split of each scene", title_justify="left")
    for name in ("scene", "method", "packets of", "split", "frame", "vs rtcIntersect1", "vs packets", "pixels wrong"):
        best.add_column(name, justify="left" if name in ("scene", "method") else "right")
    kinds = _kinds(measured, _kind_and_threads)
    for (scene, kind, width), rows in measured.groupby(["scene", kinds, "packet_width"], sort=False):
        row = rows.loc[rows["render_time_s"].astype(float).idxmin()]
        best.add_row(
            escape(printable(str(scene))),
            kind,
            str(width),
            f"{row['split_x']} x {row['split_y']}",
            _ms(row["render_time_s"]),
            f"{row['speedup']:.2f}x",
            f"{row['speedup_vs_packets']:.2f}x",
            str(rows["pixels_wrong"].sum()),
        )
    if len(measured):
        console.print(best)
    if len(measured) < len(timed):
        console.print(_best_of_frames(timed[timed["motion"].notna()]))
    for line in [*agreement_lines(table), *say_regrets(table)]:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    missing = table[table["status"] != "ok"]
    reasons = missing["error"].map(_kind_of_error)
    for (scene, status, _), rows in missing.groupby(["scene", "status", reasons], sort=False):
        points = "; ".join(
            f"{kind} "
            + ", ".join(dict.fromkeys(f"{x}x{y}" for x, y in zip(some["split_x"], some["split_y"], strict=True)))
            for kind, some in rows.groupby(rows.apply(_kind_and_threads, axis=1), sort=False)
        )
        say(console, f"{status}: {scene}, {points}")
        say(console, f"    {rows['error'].iloc[0]}")
    counts = ", ".join(f"{count} {status}" for status, count in table["status"].value_counts().items())
    files = ", ".join(path.name for path in sorted(folder.iterdir()) if path.is_file() and path.name[0] != ".")
    say(console, f"{counts or 'nothing measured'}; in {folder}: {files}")


def _kinds(rows: pd.DataFrame, kind_of: Callable[[pd.Series], str]) -> pd.Series:
    """What `kind_of` says of each row, and every other setting that varies."""
    varying = settings_that_vary(rows, _SAID)
    return pd.Series(
        [", ".join([kind_of(row), *(say_setting(name, row[name]) for name in varying)]) for _, row in rows.iterrows()],
        index=rows.index,
        dtype="object",
    )


def _best_of_frames(timed: pd.DataFrame) -> Table:
    """The split at which all frames together gain most over packets, and how many times as fast they are there."""
    best = Table(title="best split of all frames together, and speed-up over", title_justify="left")
    left, ratios = ("scene", "motion"), ("separate", "visible-first", "packets", "rtcIntersect1")
    for name in (*left, "frames", "split", "all frames", *ratios, "pixels wrong"):
        best.add_column(name, justify="left" if name in left else "right")
    others = ("speedup_vs_separate", "speedup_vs_visible_first", "speedup_vs_packets", "speedup")
    motions = _kinds(timed, lambda row: str(row["motion"]))
    for (scene, motion, frames), rows in timed.groupby(["scene", motions, "frames"], sort=False):
        row = rows.loc[rows["speedup_vs_packets"].astype(float).idxmax()]
        best.add_row(
            escape(str(scene)),
            motion,
            str(frames),
            f"{row['split_x']} x {row['split_y']}",
            _ms(row["render_time_s"]),
            *(f"{row[name]:.2f}x" for name in others),
            str(rows["pixels_wrong"].sum()),
        )
    return best


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
