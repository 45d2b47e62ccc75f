"""What the pages quote of the sweeps that compare methods."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.methods import find_method
from experiments.results.estimates import Estimate
from experiments.workloads.frame.best_baseline import best_baselines
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


def best_packets(kept: Kept) -> Quoted:
    rows = []
    for one in best_baselines(kept.processes):
        said = "more than noise" if one.is_faster else "no more than noise"
        margin = "too few processes" if one.margin is None else f"{one.margin}"
        rows.append(table_row(f"`{one.scene}`", one.tried, one.name, margin, said))
    return Quoted(rows=tuple(rows))


def place_of_the_reference_rays(kept: Kept) -> Quoted:
    """Time with the paper's place over time with ours, by split, packets and culling."""
    table = of(kept.points, workload="frame")
    rows = []
    for width, culling, split in (
        (width, culling, split)
        for width in sorted(table["packet_width"].unique())
        for culling in (True, False)
        for split in sorted(table["split_x"].unique())
        if split > 1
    ):
        ratios = []
        for scene in SCENES:
            ours, first = (
                of(table, scene=scene, split_x=split, culling=culling, packet_width=width, reference=place)["speedup"]
                for place in ("off_axis", "first_cell")
            )
            ratios.append(digits(ours.item() / first.item()) if len(ours) and len(first) else "not measured")
        rays = "single rays" if width == 1 else f"packets of {width}"
        rows.append(table_row(f"{split} {TIMES} 1, {rays}, culling {'on' if culling else 'off'}", *ratios))
    return Quoted(rows=tuple(rows))


def other_tracers(kept: Kept) -> Quoted:
    """Over rtcIntersect1 in the same rounds, and wrong pixels."""
    table, rows = of(kept.points, workload="frame"), []
    for method in table["method"].unique():
        of_scenes = [of(table, scene=scene, method=method) for scene in SCENES]
        cells = ["not measured" if one.empty else digits(one["speedup"].item()) for one in of_scenes]
        wrong = [0 if one.empty else int(one["pixels_wrong"].item()) for one in of_scenes]
        rows.append(table_row(find_method(method).label, *cells, f"{sum(wrong):,}"))
    return Quoted(rows=tuple(rows))


def other_instruction_sets(kept: Kept) -> Quoted:
    """The rasteriser over the packets that are native there; the width of packets tells the sets apart."""
    rows = []
    for width, name in ((8, "AVX2, packets of 8"), (4, "SSE4.2, packets of 4")):
        narrow = of(kept.points, packets_width=width)
        cells = (interval(best(narrow, scene=scene, method="raster"), "speedup_vs_packets") for scene in SCENES)
        rows.append(table_row(name, *cells))
    return Quoted(rows=tuple(rows))


def two_threads(kept: Kept) -> Quoted:
    rows = []
    for method in kept.points["method"].unique():
        ratios = []
        for scene in SCENES:
            one, two = (of(kept.points, scene=scene, method=method, threads=threads) for threads in (1, 2))
            ratios.append(digits(one["render_time_s"].item() / two["render_time_s"].item()))
        rows.append(table_row(find_method(method).label, *ratios))
    return Quoted(rows=tuple(rows))


def two_eyes(kept: Kept) -> Quoted:
    rows = []
    for scene in SCENES:
        row = best(kept.points, scene=scene)
        ratios = ("speedup_vs_separate", "speedup_vs_visible_first", "speedup_vs_packets")
        rows.append(
            table_row(
                f"`{scene}`, {split_of(row)}",
                milliseconds(row["render_time_s"]),
                *(interval(row, name) for name in ratios),
            )
        )
    return Quoted(rows=tuple(rows))


def several_frames(kept: Kept) -> Quoted:
    """Over each frame aligned alone / visible-first / packets."""
    rows = []
    for motion in ("walk", "turn"):
        for scene in SCENES:
            cells = []
            for frames in sorted(kept.points["frames"].unique()):
                row = best(kept.points, scene=scene, motion=motion, frames=frames)
                names = ("speedup_vs_separate", "speedup_vs_visible_first", "speedup_vs_packets")
                cells.append(" / ".join(digits(row[name]) for name in names))
            rows.append(table_row(f"`{scene}`, {motion}", *cells))
    return Quoted(rows=tuple(rows))


def regret(kept: Kept) -> Quoted:
    rows = []
    measured = of(kept.points)
    for scene, of_scene in measured.groupby("scene", sort=False):
        pays = of_scene["pays_from_frames"]
        rows.append(
            table_row(
                f"`{scene}`",
                len(of_scene),
                *(digits(of_scene["regret"].agg(name)) for name in ("median", "max")),
                *(digits(of_scene["regret_with_planning"].agg(name)) for name in ("median", "max")),
                digits(of_scene["packets_regret"].median()),
                f"{pays.median():,.0f}" if pays.notna().all() else f"{pays.notna().sum()} of {len(pays)} ever do",
            )
        )
    return Quoted(rows=tuple(rows))


def moving_cameras(kept: Kept) -> Quoted:
    """Over packets that build anew for every eye, and over those that keep a BVH in world space."""
    table, rows = of(kept.points, workload="moving"), []
    for name in ("raster", "visible_first", "aligned"):
        chosen = [best(table, scene=scene, method=name) for scene in SCENES]
        label = find_method(name).label
        rebuilt = (digits(row["speedup_vs_packets"]) for row in chosen)
        rows.append(table_row(f"{label}, {TIMES} packets built anew", *rebuilt))
        over_kept = (digits(row["speedup_vs_kept_packets"]) for row in chosen)
        rows.append(table_row(f"{label}, {TIMES} packets over a kept BVH", *over_kept))
    return Quoted(rows=tuple(rows))


_ROBUST: tuple[tuple[str, dict[str, Any]], ...] = (
    ("packets of 16", {"method": "pixel", "packet_width": 16}),
    ("single rays", {"method": "pixel", "packet_width": 1}),
    (f"aligned, 256 {TIMES} 1", {"method": "aligned", "split_x": 256}),
    (f"visible-first, 256 {TIMES} 1", {"method": "visible_first", "split_x": 256}),
)


def price_of_robust(kept: Kept) -> Quoted:
    """A frame in Embree's robust setting over one in its fast setting: time, each against packets of its own rounds."""

    def speed(**values: Any) -> Estimate:
        return Estimate.of(of(kept.processes, **values)["speedup_vs_packets"].astype(float).tolist())

    rows = []
    for label, point in _ROBUST:
        prices = [
            speed(scene=scene, robust=False, **point).over(speed(scene=scene, robust=True, **point)) for scene in SCENES
        ]
        rows.append(table_row(label, *prices))
    assert set(of(kept.points, robust=True)["pixels_hole"].dropna()) == {0}
    return Quoted(rows=tuple(rows))
