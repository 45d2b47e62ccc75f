"""What the pages quote of the sweeps that compare methods, views, rays and versions, and of sweep=growth."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.documents.quotation import (
    SCENES,
    TIMES,
    Kept,
    best,
    best_of_each,
    digits,
    each_scene,
    estimate,
    interval,
    line,
    milliseconds,
    number,
    of,
    split_of,
    table_row,
)
from experiments.methods import find_method
from experiments.studies.paired import ratios
from experiments.workloads.frame.break_even import baseline_costs, break_even_interval, cost_of
from experiments.workloads.frame.exponents import exponents
from experiments.workloads.frame.growth import growth_panels, growths
from experiments.workloads.frame.shown import best_baselines

COMPARED = ("raster", "visible_first", "aligned")


def _frame(number: Any) -> Any:
    return "never" if number is None else f"{number:,}"


def _gains_of_each_method(table: Any) -> Any:
    for scene in SCENES:
        raster, visible_first, aligned = (best(table, scene=scene, method=name) for name in COMPARED)
        cost, packets = cost_of(visible_first), baseline_costs(of(table, scene=scene))
        assert cost is not None
        gains = [visible_first[f"speedup_vs_packets{end}"] for end in ("", "_high", "_low")]
        middle, first, last = map(_frame, break_even_interval(cost, gains, packets.values()))
        yield table_row(
            f"`{scene}`",
            f"{aligned['triangles']:,}",
            milliseconds(aligned["packets_render_time_s"]),
            interval(aligned, "speedup_vs_packets"),
            interval(visible_first, "speedup_vs_packets"),
            middle if first == last else f"{middle} [{first}, {last}]",
            interval(raster, "speedup_vs_packets"),
        )


def frames_in_short(kept: Kept) -> Iterable[str]:
    """Scene, packets in ms, and over packets each method; and in how many images no pixel is wrong."""
    table = of(kept.points, workload="frame")
    for scene in SCENES:
        raster, visible_first, aligned = (best(table, scene=scene, method=name) for name in COMPARED)
        gains = (number(row, "speedup_vs_packets") for row in (aligned, visible_first, raster))
        yield table_row(f"`{scene}`", milliseconds(aligned["packets_render_time_s"]), *gains)
    images = table[table["pixels_equal"].notna()]
    assert (images["pixels_wrong"] == images["pixels_hole"] + images["baseline_pixels_hole"]).all()
    assert not of(images, method="raster")["pixels_hole"].any()
    yield f"In {int((images['pixels_wrong'] == 0).sum())} of the {len(images)} images no pixel is wrong"


def frames_of_each_method(kept: Kept) -> Iterable[str]:
    """Scene, triangles, packets in ms, and over packets: aligned, visible-first, from which frame on, raster."""
    return list(_gains_of_each_method(of(kept.points, workload="frame")))


def methods_in_detail(kept: Kept) -> Iterable[str]:
    def gain_and_split(row: Any, column: Any) -> Any:
        return number(row, column) + ("" if pd.isna(row["split_x"]) else f" ({split_of(row)})")

    for name in COMPARED:
        chosen = best_of_each(of(kept.points, workload="frame"), method=name)
        yield line(f"{find_method(name).label}, {TIMES} packets", chosen, "speedup_vs_packets", gain_and_split)
        yield line(f"{find_method(name).label}, {TIMES} `rtcIntersect1`", chosen, "speedup")


def families(kept: Kept) -> Iterable[str]:
    """A scene made by code a row: triangles, packets in ms, and over packets each method at its best split."""
    table = of(kept.points)
    for scene in sorted(table["scene"].unique()):
        found = [best(table, scene=scene, method=name) for name in ("aligned", "visible_first", "tiles", "raster")]
        cells = [interval(row, "speedup_vs_packets") for row in found]
        cells[0] += f" ({split_of(found[0])})"
        packets = milliseconds(found[-1]["packets_render_time_s"])
        yield table_row(f"`{scene}`", f"{found[0]['triangles']:,}", packets, *cells)


def surfaces(kept: Kept) -> Iterable[str]:
    """A frame with u, v and normals over one without, and over packets that store them."""
    for method in kept.points["method"].unique():
        chosen, label = each_scene(kept.points, method=method), find_method(method).label
        yield line(f"{label}: a frame with `u`, `v` and normals ÷ without", chosen, "surface_over_frame", interval)
        yield line(f"{label}: {TIMES} packets that store them", chosen, "speedup_vs_packets_with_surface", interval)


def best_packets(kept: Kept) -> Iterable[str]:
    for one in best_baselines(kept.processes):
        said = "more than noise" if one.is_faster else "no more than noise"
        margin = "too few processes" if one.margin is None else f"{one.margin}"
        yield table_row(f"`{one.scene}`", one.tried, one.name, margin, said)


def other_tracers(kept: Kept) -> Iterable[str]:
    """Over rtcIntersect1 in the same rounds, and wrong pixels but the holes that rtcIntersect1 leaves."""
    table = of(kept.points, workload="frame")
    for method in table["method"].unique():
        found = of(table, method=method)
        of_scenes = [of(found, scene=scene) for scene in SCENES]
        cells = ("not measured" if one.empty else digits(one["speedup"].item()) for one in of_scenes)
        wrong = found["pixels_wrong"].sum() - found["baseline_pixels_hole"].sum()
        yield table_row(find_method(method).label, *cells, f"{int(wrong):,}")


def what_was_called(kept: Kept) -> Iterable[str]:
    """Another tracer a row: its version, what of it was called, and how exact that is."""
    rows = of(kept.points, workload="frame")
    for method in rows["method"].unique():
        told = rows[rows["method"].eq(method)].iloc[0]
        if not pd.isna(told["peer_interface"]):
            names = ("peer_version", "peer_interface", "peer_setting")
            held = "all there are" if told["instruction_set"] == "none" else told["instruction_set"]
            yield table_row(find_method(method).label, *(told[name] for name in names), held)


def other_instruction_sets(kept: Kept) -> Iterable[str]:
    """The rasteriser over the packets that are native there."""
    for held, name in (("avx2", "AVX2, packets of 8"), ("sse4.2", "SSE4.2, packets of 4")):
        yield line(name, rasteriser_held_to(kept, held), "speedup_vs_packets", interval)


def rasteriser_held_to(kept: Kept, instruction_set: Any) -> Any:
    return best_of_each(of(kept.points, workload="frame", instruction_set=instruction_set), method="raster")


def frames_with_avx2(kept: Kept) -> Iterable[str]:
    """As `frames_of_each_method`."""
    yield from _gains_of_each_method(of(kept.points, workload="frame", instruction_set="avx2"))


def two_threads(kept: Kept) -> Iterable[str]:
    for method in kept.points["method"].unique():
        yield table_row(find_method(method).label, *map(digits, gains_of_two_threads(kept.points, method)))


def gains_of_two_threads(table: Any, method: Any) -> Any:
    one, two = (each_scene(table, method=method, threads=threads) for threads in (1, 2))
    return [a["render_time_s"] / b["render_time_s"] for a, b in zip(one, two, strict=True)]


def two_eyes(kept: Kept) -> Iterable[str]:
    for row in best_of_each(kept.points):
        yield table_row(f"`{row['scene']}`, {split_of(row)}", milliseconds(row["render_time_s"]), *_over_others(row))


def several_frames(kept: Kept) -> Iterable[str]:
    """A scene, a motion and a number of frames a row: together, over each other way to make them."""
    for scene in SCENES:
        rows = of(kept.points, scene=scene).sort_values(["motion", "frames"], ascending=[False, True])
        for _, row in rows.iterrows():
            cells = (f"`{scene}`", f"{row['motion']}, {row['frames']}", milliseconds(row["render_time_s"]))
            yield table_row(*cells, *_over_others(row))


def _over_others(row: Any) -> Any:
    others = ("separate", "visible_first", "packets", "rasteriser")
    return [interval(row, f"speedup_vs_{name}") for name in others]


def moving_cameras(kept: Kept) -> Iterable[str]:
    """Over packets that build anew for every eye, and over those that keep a BVH in world space."""
    for name in COMPARED:
        chosen, label = best_of_each(of(kept.points, workload="moving"), method=name), find_method(name).label
        yield line(f"{label}, {TIMES} packets built anew", chosen, "speedup_vs_packets")
        yield line(f"{label}, {TIMES} packets over a kept BVH", chosen, "speedup_vs_kept_packets")


ROBUST = {
    "packets of 16": {"method": "pixel", "packet_width": 16, "own_build_quality": "same"},
    "single rays": {"method": "pixel", "packet_width": 1, "own_build_quality": "same"},
    f"aligned, 256 {TIMES} 1": {"method": "aligned", "split_x": 256, "split_y": 1},
    f"visible-first, 256 {TIMES} 1": {"method": "visible_first", "split_x": 256, "split_y": 1},
}


def price_of_robust(kept: Kept) -> Iterable[str]:
    """A frame in Embree's robust setting over one in its fast setting: time, each against packets of its own rounds."""

    def speed(**values: Any) -> Any:
        return estimate(kept.processes, "speedup_vs_packets", workload="frame", **values)

    for label, point in ROBUST.items():
        fast, robust = ([speed(scene=scene, robust=how, **point) for scene in SCENES] for how in (False, True))
        yield table_row(label, *(a.over(b) for a, b in zip(fast, robust, strict=True)))
    assert set(of(kept.points, robust=True)["pixels_hole"].dropna()) == {0}


_JOBS = {"camera_rays": "of a camera", "random_rays": "from anywhere to anywhere"}


def twenty_views(kept: Kept) -> Iterable[str]:
    """A mesh a row: triangles, how many times as fast the library is as each tracer of others, and the least share of
    pixels with the same triangle."""
    table = of(kept.points, job="views")
    methods = tuple(table["method"].unique())
    for triangles, of_mesh in table.groupby("triangles"):
        gains = (interval(of(of_mesh, method=method).iloc[0], "library_gain") for method in methods)
        yield table_row(f"{triangles:,}", *gains, f"{of_mesh['ids_equal'].min():.5f}")
    yield from (f"{TIMES} {find_method(method).label}" for method in methods)


def million_rays(kept: Kept) -> Iterable[str]:
    """A mesh a row: triangles, and for rays of every kind how many times as fast the library is as embreex."""
    for triangles, of_mesh in of(kept.points, method="embreex").groupby("triangles"):
        gains = (interval(of(of_mesh, job=job).iloc[0], "library_gain") for job in _JOBS)
        yield table_row(f"{triangles:,}", *gains)
    yield from _JOBS.values()


_WORDS = {"subdivided": "subdivided", "copies": "copies as one mesh", "pixels": "larger images"}
_METHODS = ("pixel", "visible_first", "raster")


def growth_of_methods(kept: Kept) -> Iterable[str]:
    """What grows and how far, exponents of packets' time and of the others' over packets, and both ends of these."""
    found = {(panel.title, method): k for panel, method, k in exponents(kept.processes)}
    for panel in growth_panels(kept.points):
        of_method = {one.method: one for one in growths(panel)}
        assert set(of_method) == set(_METHODS), f"{panel.title} has {sorted(of_method)}"
        fitted = [found.get((panel.title, name)) for name in _METHODS]
        sizes = of_method["raster"].sizes
        yield table_row(
            f"`{panel.scene}`, {_WORDS[panel.axis]}",
            f"{sizes[0]:,.0f} to {sizes[-1]:,.0f} {panel.unit}",
            *("too few sizes" if k is None else f"{k.value:.2f} {k.interval()}" for k in fitted),
            *(_both_ends(of_method[name]) for name in ("visible_first", "raster")),
        )


def both_ends_of_the_rasteriser(kept: Kept, *scenes: Any) -> Iterable[str]:
    """ "`sponza`, subdivided: 4.55 to 2.23" for what grows of these scenes, as speed over packets."""
    for panel in growth_panels(kept.points):
        for one in growths(panel):
            if one.method == "raster" and panel.scene in scenes and panel.axis != "copies":
                yield f"`{panel.scene}`, {_WORDS[panel.axis]}: {_both_ends(one)}"


def _both_ends(one: Any) -> Any:
    return f"{digits(one.over_packets[0])} to {digits(one.over_packets[-1])}"


def holes_at_edges(kept: Kept) -> Iterable[str]:
    """The most holes that an image of each method has; those of single rays are counted in the same images."""
    points = kept.points
    most = [of(points, method=method)["pixels_hole"].max() for method in ("raster", "visible_first")]
    raster, visible_first, single = (f"{count:.0f}" for count in (*most, points["baseline_pixels_hole"].max()))
    yield f"The most holes in one image: rasteriser {raster}, visible-first {visible_first}, single rays {single}."


def this_and_before(kept: Kept) -> Iterable[str]:
    """How many times as fast this version is as the other one, by what was asked, on each scene with its interval."""
    found = ratios(kept.points).set_index(["instruction_set", "threads", "what", "scene"])["ratio"]
    known = [key for key in found.index if key[3] in SCENES]
    for instruction_set, threads, what in dict.fromkeys(key[:3] for key in known):
        cells = [found.get((instruction_set, threads, what, scene), "") for scene in SCENES]
        yield table_row(f"{what.replace('_', ' ')}, {instruction_set}", threads, *cells)


def small_triangles_before(kept: Kept) -> Iterable[str]:
    """A scene made by code a row: triangles, images and packets as in `this_and_before`, and how many times as fast
    as packets an image is now."""
    table = kept.points
    found = ratios(table).set_index(["scene", "what"])["ratio"]
    for scene, rows in table[~table["scene"].isin(SCENES)].groupby("scene"):
        mine = rows[rows["version"] == "this"].groupby("what")["median_ms"].median()
        cells = (found[scene, what] for what in ("image", "packets"))
        yield table_row(f"`{scene}`", f"{rows['triangles'].iloc[0]:,}", *cells, digits(mine["packets"] / mine["image"]))
