"""What docs/methods.md and docs/not_helpful.md say of the tables in short: few rows, or the range over the scenes."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from experiments.methods import find_method
from experiments.results.claims import judge_claim
from experiments.workloads.bake import Against
from experiments.workloads.bake_rays.claims import CLAIMS as PREDICTIONS
from experiments.workloads.frame.best_baseline import best_baselines
from experiments.workloads.rays.claims import KINDS, usual
from tests.quotations.growth import both_ends_of_the_rasteriser
from tests.quotations.quotation import SCENES, Kept, Quoted, best, digits, of, table_row


def span(values: Iterable[float]) -> str:
    """ "1.22 to 1.98"."""
    known = [value for value in values if not pd.isna(value)]
    return f"{digits(min(known))} to {digits(max(known))}"


def _row(label: str, rows: Iterable[pd.Series], column: str) -> str:
    return table_row(label, *(digits(row[column]) for row in rows))


def _each_scene(table: pd.DataFrame, **values: object) -> list[pd.Series]:
    """The one row of each scene."""
    found = [of(table, scene=scene, **values) for scene in SCENES]
    assert all(len(rows) == 1 for rows in found), values
    return [rows.iloc[0] for rows in found]


def still_and_moving(kept: Kept) -> Quoted:
    """Speed over packets of each method at its best split, with a still camera and with another eye in every frame."""
    rows = []
    for name in ("raster", "visible_first", "aligned"):
        label = find_method(name).label
        for workload, words in (("frame", "camera still"), ("moving", "another eye in every frame")):
            table = of(kept.points, workload=workload)
            chosen = [best(table, scene=scene, method=name) for scene in SCENES]
            rows.append(_row(f"{label}, {words}", chosen, "speedup_vs_packets"))
    return Quoted(rows=tuple(rows))


def growth_in_words(kept: Kept) -> Quoted:
    return Quoted(phrases=tuple(both_ends_of_the_rasteriser(kept, "sponza")))


def narrower_vectors(kept: Kept) -> Quoted:
    """How far ahead of packets the rasteriser is with AVX2 and with SSE4.2."""
    gains = []
    for width in (8, 4):
        narrow = of(kept.points, packets_width=width)
        gains.append(span(best(narrow, scene=scene, method="raster")["speedup_vs_packets"] for scene in SCENES))
    return Quoted(phrases=(f"{gains[0]} times as fast as packets with AVX2 and {gains[1]} times with SSE4.2",))


def tuned_packets(kept: Kept) -> Quoted:
    found = list(best_baselines(kept.processes))
    assert not any(one.is_faster for one in found)
    (tried,) = {one.tried for one in found}
    return Quoted(phrases=(f"Of {tried} settings of packets none is faster than these by more than noise",))


def tracers_of_others(kept: Kept) -> Quoted:
    """Speed over rtcIntersect1 of other people's tracers and of the rasteriser, and their wrong pixels."""
    table, rows = of(kept.points, workload="frame"), []
    for method in ("raster", "llvmpipe", "mitsuba3", "open3d", "embreex", "trimesh"):
        found = of(table, method=method)
        cells = []
        for scene in SCENES:
            of_scene = of(found, scene=scene)
            cells.append("not measured" if of_scene.empty else digits(of_scene["speedup"].item()))
        rows.append(table_row(find_method(method).label, *cells, f"{int(found['pixels_wrong'].sum()):,}"))
    return Quoted(rows=tuple(rows))


def second_thread(kept: Kept) -> Quoted:
    ratios = []
    for method in kept.points["method"].unique():
        one, two = (_each_scene(kept.points, method=method, threads=threads) for threads in (1, 2))
        ratios += [a["render_time_s"] / b["render_time_s"] for a, b in zip(one, two, strict=True)]
    return Quoted(phrases=(f"Two threads are {span(ratios)} times as fast as one",))


def views_and_rays(kept: Kept) -> Quoted:
    """Twenty views by `render_views`, and a million rays by `RayScene`, beside others."""
    gains = kept.points[kept.points["status"].eq("ok")]
    views = gains[gains["job"].eq("views")]
    rays = of(kept.points, method="embreex")
    spans = {job: span(rays[rays["job"].eq(job)]["library_gain"]) for job in ("camera_rays", "random_rays")}
    return Quoted(
        phrases=(
            f"{span(of(views, method='embreex')['library_gain'])} times as fast as embreex",
            f"{span(of(views, method='open3d')['library_gain'])} times as fast as Open3D",
            f"{spans['camera_rays']} times for rays of a camera",
            f"{spans['random_rays']} times for rays from anywhere",
        )
    )


def counting_in_short(kept: Kept) -> Quoted:
    """Counting all hits: speed over packets that count the same."""
    packets = kept.points[kept.points["method"].ne("aligned") | kept.points["packet_width"].gt(1).fillna(False)]
    rows = []
    for method, label in (("raster", "rasteriser"), ("aligned", "aligned packets")):
        chosen = [best(packets, scene=scene, method=method, what="count") for scene in SCENES]
        rows.append(_row(f"{label}, counting", chosen, "speedup_vs_packets"))
    return Quoted(rows=tuple(rows))


def instances_in_short(kept: Kept) -> Quoted:
    """Embree's bytes of Sponza at 64 x 1: copied, with culling and without, and as instances."""
    table = of(kept.points, workload="frame", method="aligned", scene="sponza", split_x=64, split_y=1)
    widest = table[table["packet_width"].eq(table["packet_width"].max())]
    kinds = (("copied", False), ("copied", True), ("instanced", False))
    chosen = [of(widest, geometry=geometry, culling=culling).iloc[0] for geometry, culling in kinds]
    whole, culled, instanced = (f"{row['embree_bytes'] / 2**20:,.1f}" for row in chosen)
    slower = digits(chosen[2]["speedup_vs_packets"] / chosen[1]["speedup_vs_packets"])
    return Quoted(
        phrases=(
            f"copies take {whole} MiB, culled copies {culled} MiB and instances {instanced} MiB",
            f"instances are {slower} times as fast as culled copies",
        )
    )


def eyes_in_short(kept: Kept) -> Quoted:
    rows = [best(kept.points, scene=scene) for scene in SCENES]
    return Quoted(phrases=(f"{span(row['speedup_vs_separate'] for row in rows)} times as fast as each eye by itself",))


def surfaces_in_short(kept: Kept) -> Quoted:
    return Quoted(phrases=(f"takes {span(kept.points['surface_over_frame'])} times as long",))


def regret_in_short(kept: Kept) -> Quoted:
    views = of(kept.points)
    medians = views.groupby("scene")["regret_with_planning"].median()
    return Quoted(
        phrases=(
            f"On {len(views)} views and 64 frames its worst choice takes {digits(views['regret'].max())} times",
            f"with the time of choosing, {span(medians)} times",
        )
    )


def pictures_in_short(kept: Kept) -> Quoted:
    """Whole pictures over the same pictures with packets for primary visibility, and beside Mitsuba 3."""
    plain = {"method": "raster", "samples": 1, "jitter": "shared", "order": "depth_first"}
    lines = (
        ("hybrid pictures", {"frame": "hybrid", "mitsuba": "none"}, "speedup_vs_packets"),
        ("path-traced pictures", {"frame": "path", "mitsuba": "none"}, "speedup_vs_packets"),
        ("path-traced samples, over Mitsuba 3's", {"frame": "path", "mitsuba": "llvm_ad_rgb"}, "samples_vs_mitsuba"),
    )
    return Quoted(
        rows=tuple(_row(label, _each_scene(kept.points, **plain, **other), column) for label, other, column in lines)
    )


def steps_and_speed(kept: Kept) -> Quoted:
    """Rays that start from lists: steps over those from the root, and speed over the root."""
    popped, rows = usual(of(kept.points, workload="rays")), []
    for kind in KINDS:
        chosen = _each_scene(popped, ray_kind=kind)
        cells = (f"{digits(row['steps_ratio'])}, {digits(row['speedup_vs_bvh'])}" for row in chosen)
        rows.append(table_row(kind, *cells))
    return Quoted(rows=tuple(rows))


def mitsuba_in_short(kept: Kept) -> Quoted:
    """Paths a second of lightmaps beside Mitsuba's best, rays one by one and in packets."""
    rows = of(kept.points, against=Against.mitsuba.value)
    return Quoted(
        phrases=(f"{span(rows['speedup_vs_best_other'])} times as many paths a second as Mitsuba 3 at its best",)
    )


def mitsuba_before_in_short(kept: Kept) -> Quoted:
    rows = of(kept.points, against=Against.mitsuba.value)
    return Quoted(phrases=(f"an earlier version had {span(rows['speedup_vs_best_other'])} times",))


def _predictions(kept: Kept) -> dict[str, str]:
    """What was found of each prediction about alignment, by the name of the claim."""
    return {claim.id: one.value or "" for claim in PREDICTIONS for one in judge_claim(claim, kept.points)}


def sun_in_the_box(kept: Kept) -> Quoted:
    """Rays from texels to the sun: packets over aligned rays."""
    found = _predictions(kept)
    box, deep = found["sun-gains-in-the-box"], found["sun-gains-nothing-in-deep-scenes"]
    return Quoted(phrases=(f"{box} times as fast as packets in the Cornell box, and {deep} times in deep scenes",))


def light_bundles(kept: Kept) -> Quoted:
    """How much sooner than paths bundles that carry light reach an error of 5 %."""
    rows = kept.points[kept.points["use"].eq("light")]
    found = {
        row["scene"]: f"not reached, {row['bundle_error']:.0%} left"
        if pd.isna(row["bundle_directions_to_rmse_5"])
        else f"{row['paths_over_bundles']:.2g}"
        for row in rows.to_dict("records")
    }
    traced = rows["packets_over_aligned"]
    aligned = f"{traced.min():.2g} to {traced.max():.2g}"
    return Quoted(
        rows=(table_row("times as soon as paths", *(found[scene] for scene in SCENES)),),
        phrases=(f"Aligned, the rays are traced and the light exchanged {aligned} times as fast as with packets",),
    )
