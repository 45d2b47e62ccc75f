"""What README and docs/methods.md quote of the sweeps that compare methods."""

from __future__ import annotations

import pandas as pd

from experiments.methods import find_method
from experiments.workloads.frame.break_even import baseline_costs, break_even_frames, cost_of
from tests.quotations.quotation import (
    SCENES,
    TIMES,
    Kept,
    Quoted,
    best,
    digits,
    interval,
    milliseconds,
    of,
    split_of,
    table_row,
)

_COMPARED = ("raster", "visible_first", "aligned")


def frames_of_each_method(kept: Kept) -> Quoted:
    """Scene, triangles, packets in ms, and over packets: aligned, visible-first, from which frame on, raster."""
    table, rows = of(kept.points, workload="frame"), []
    for scene in SCENES:
        aligned, visible_first, raster = (
            best(table, scene=scene, method=name) for name in ("aligned", "visible_first", "raster")
        )
        cost, packets = cost_of(visible_first), baseline_costs(of(table, scene=scene))
        ahead = None if cost is None else break_even_frames(cost, packets.values())
        rows.append(
            table_row(
                f"`{scene}`",
                f"{aligned['triangles']:,}",
                milliseconds(aligned["packets_render_time_s"]),
                interval(aligned, "speedup_vs_packets"),
                interval(visible_first, "speedup_vs_packets"),
                "never" if ahead is None else f"{ahead:,}",
                interval(raster, "speedup_vs_packets"),
            )
        )
    assert set(table["pixels_wrong"].dropna()) == {0}
    return Quoted(rows=tuple(rows), phrases=(f"none of the {int(table['pixels_equal'].notna().sum())} images",))


def methods_in_detail(kept: Kept) -> Quoted:
    table, rows = of(kept.points, workload="frame"), []
    for name in _COMPARED:
        chosen = [best(table, scene=scene, method=name) for scene in SCENES]
        splits = ["" if pd.isna(row["split_x"]) else f" ({split_of(row)})" for row in chosen]
        gains = (digits(row["speedup_vs_packets"]) + split for row, split in zip(chosen, splits, strict=True))
        rows.append(table_row(f"{find_method(name).label}, {TIMES} packets", *gains))
        rows.append(
            table_row(
                f"{find_method(name).label}, {TIMES} `rtcIntersect1`", *(digits(row["speedup"]) for row in chosen)
            )
        )
    return Quoted(rows=tuple(rows))


def surfaces(kept: Kept) -> Quoted:
    """A frame with u, v and normals over one without, and over packets that store them."""
    rows = []
    for method in kept.points["method"].unique():
        chosen = [of(kept.points, scene=scene, method=method).iloc[0] for scene in SCENES]
        label = find_method(method).label
        asked = (interval(row, "surface_over_frame") for row in chosen)
        rows.append(table_row(f"{label}: a frame with `u`, `v` and normals ÷ without", *asked))
        gains = (interval(row, "speedup_vs_packets_with_surface") for row in chosen)
        rows.append(table_row(f"{label}: {TIMES} packets that store them", *gains))
    return Quoted(rows=tuple(rows))
