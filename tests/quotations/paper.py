"""What the pages quote of the reference report, which is of an earlier version: its table is older than `workload`."""

from __future__ import annotations

from typing import Any

import pandas as pd

from tests.quotations.quotation import SCENES, TIMES, Kept, Quoted, digits, interval, split_of, table_row


def largest(table: pd.DataFrame, scene: str, by: str) -> pd.Series:
    """The aligned row with the largest ratio."""
    rows = table[table["scene"].eq(scene) & table["method"].eq("aligned") & table["status"].eq("ok")]
    return rows.loc[rows[by].idxmax()]


def paper_speedups(kept: Kept) -> Quoted:
    table = kept.points
    paper = {"cornell_box": "7.50", "mitsuba": "2.94", "fireplace_room": "1.85", "sponza": "1.71"}
    aligned = table[
        table["quantity"].eq("time")
        & table["geometry"].eq("copied")
        & table["culling"].eq(True)
        & table["split_y"].eq(1)
        & table["stands_for"].isna()
    ]
    rows = []
    for scene in SCENES:
        single = largest(aligned[aligned["packet_width"].eq(1)], scene, "speedup")
        packets = largest(aligned[aligned["packet_width"].eq(8)], scene, "speedup_vs_packets")
        cells = (
            f"{interval(row, name)} ({split_of(row)})"
            for row, name in ((single, "speedup"), (packets, "speedup_vs_packets"))
        )
        rows.append(table_row(f"`{scene}`", paper[scene], *cells))
    return Quoted(rows=tuple(rows))


def over_all_hits(kept: Kept) -> Quoted:
    table = kept.points
    single = table[table["quantity"].eq("time") & table["packet_width"].eq(1) & table["split_y"].eq(1)]
    gains = []
    for scene in SCENES:
        start = single[single["culling"].eq(False) & single["split_x"].eq(1) & single["scene"].eq(scene)]
        top = largest(single[single["culling"].eq(True)], scene, "speedup")
        gains.append(digits(top["speedup"] / start["speedup"].item()))
    return Quoted(phrases=(f"gain here {', '.join(gains[:-1])} and {gains[-1]} times",))


def paper_points(kept: Kept) -> Quoted:
    table = kept.points
    measured, skipped = (int(table["status"].eq(status).sum()) for status in ("ok", "skipped"))
    doubted = int(table["doubts"].notna().sum())
    counted = f"{len(table)} points, {measured} measured, {skipped} skipped"
    return Quoted(phrases=(counted, f"{doubted} points carry a doubt"))


def claim_verdicts(kept: Kept) -> Quoted:
    claims: list[dict[str, Any]] = kept.claims
    rows = [
        table_row(claim["text"], claim["section"], claim["verdict"])
        for claim in claims
        if not claim["id"].startswith("best-speedup")
    ]
    return Quoted(rows=tuple(rows))


def instances(kept: Kept) -> Quoted:
    table = kept.points
    kinds = (("copies, culling off", "copied", False), ("copies", "copied", True), ("instances", "instanced", False))
    rows = []
    for split_x in (64, 1024):
        of_split = table[
            table["quantity"].eq("time")
            & table["split_x"].eq(split_x)
            & table["split_y"].eq(1)
            & table["packet_width"].eq(8)
            & table["method"].eq("aligned")
        ]
        for kind, geometry, culling in kinds:
            chosen = of_split[of_split["geometry"].eq(geometry) & of_split["culling"].eq(culling)].set_index("scene")
            if set(chosen["status"]) != {"ok"}:
                continue  # skipped on some scene, for the memory it would need
            mebibytes = [f"{chosen.loc[scene, 'embree_bytes'] / 2**20:,.1f}" for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: Embree's bytes in MiB", *mebibytes))
            speedups = [digits(chosen.loc[scene, "speedup"]) for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: speed-up over `rtcIntersect1`", *speedups))
    return Quoted(rows=tuple(rows))
