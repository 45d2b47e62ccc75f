"""What the pages quote of the sweeps that compare methods, views and rays among them."""

import pandas as pd

from experiments.methods import find_method
from experiments.workloads.frame.break_even import baseline_costs, break_even_interval, cost_of
from experiments.workloads.frame.shown import best_baselines
from tests.quotations.quotation import (
    SCENES,
    TIMES,
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
)  # fmt: skip

COMPARED = ("raster", "visible_first", "aligned")


def _frame(number):
    return "never" if number is None else f"{number:,}"


def _gains_of_each_method(table):
    for scene in SCENES:
        raster, visible_first, aligned = (best(table, scene=scene, method=name) for name in COMPARED)
        cost, packets = cost_of(visible_first), baseline_costs(of(table, scene=scene))
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


def frames_of_each_method(kept):
    """Scene, triangles, packets in ms, and over packets: aligned, visible-first, from which frame on, raster."""
    table = of(kept.points, workload="frame")
    yield from _gains_of_each_method(table)
    images = table[table["pixels_equal"].notna()]
    assert (images["pixels_wrong"] == images["pixels_hole"] + images["baseline_pixels_hole"]).all()
    assert not of(images, method="raster")["pixels_hole"].any()
    wrong = images["pixels_wrong"][images["pixels_wrong"] > 0]
    yield f"In {len(images) - len(wrong)} of the {len(images)} images no pixel is wrong"
    yield f"the others have 1 to {int(wrong.max())}"


def methods_in_detail(kept):
    def gain_and_split(row, column):
        return number(row, column) + ("" if pd.isna(row["split_x"]) else f" ({split_of(row)})")

    for name in COMPARED:
        chosen = best_of_each(of(kept.points, workload="frame"), method=name)
        yield line(f"{find_method(name).label}, {TIMES} packets", chosen, "speedup_vs_packets", gain_and_split)
        yield line(f"{find_method(name).label}, {TIMES} `rtcIntersect1`", chosen, "speedup")


def families(kept):
    """A scene made by code a row: triangles, packets in ms, and over packets each method at its best split."""
    table = of(kept.points)
    for scene in sorted(table["scene"].unique()):
        found = [best(table, scene=scene, method=name) for name in ("aligned", "visible_first", "tiles", "raster")]
        cells = [interval(row, "speedup_vs_packets") for row in found]
        cells[0] += f" ({split_of(found[0])})"
        packets = milliseconds(found[-1]["packets_render_time_s"])
        yield table_row(f"`{scene}`", f"{found[0]['triangles']:,}", packets, *cells)


def surfaces(kept):
    """A frame with u, v and normals over one without, and over packets that store them."""
    for method in kept.points["method"].unique():
        chosen, label = each_scene(kept.points, method=method), find_method(method).label
        yield line(f"{label}: a frame with `u`, `v` and normals ÷ without", chosen, "surface_over_frame", interval)
        yield line(f"{label}: {TIMES} packets that store them", chosen, "speedup_vs_packets_with_surface", interval)


def best_packets(kept):
    for one in best_baselines(kept.processes):
        said = "more than noise" if one.is_faster else "no more than noise"
        margin = "too few processes" if one.margin is None else f"{one.margin}"
        yield table_row(f"`{one.scene}`", one.tried, one.name, margin, said)


def other_tracers(kept):
    """Over rtcIntersect1 in the same rounds, and wrong pixels but the holes that rtcIntersect1 leaves."""
    table = of(kept.points, workload="frame")
    for method in table["method"].unique():
        found = of(table, method=method)
        of_scenes = [of(found, scene=scene) for scene in SCENES]
        cells = ("not measured" if one.empty else digits(one["speedup"].item()) for one in of_scenes)
        wrong = found["pixels_wrong"].sum() - found["baseline_pixels_hole"].sum()
        yield table_row(find_method(method).label, *cells, f"{int(wrong):,}")


def what_was_called(kept):
    """Another tracer a row: its version, what of it was called, and how exact that is."""
    rows = of(kept.points, workload="frame")
    for method in rows["method"].unique():
        told = rows[rows["method"].eq(method)].iloc[0]
        if not pd.isna(told["peer_interface"]):
            names = ("peer_version", "peer_interface", "peer_setting")
            held = "all there are" if told["instruction_set"] == "none" else told["instruction_set"]
            yield table_row(find_method(method).label, *(told[name] for name in names), held)


def other_instruction_sets(kept):
    """The rasteriser over the packets that are native there."""
    for held, name in (("avx2", "AVX2, packets of 8"), ("sse4.2", "SSE4.2, packets of 4")):
        yield line(name, rasteriser_held_to(kept, held), "speedup_vs_packets", interval)


def rasteriser_held_to(kept, instruction_set):
    return best_of_each(of(kept.points, workload="frame", instruction_set=instruction_set), method="raster")


def frames_with_avx2(kept):
    """As `frames_of_each_method`."""
    yield from _gains_of_each_method(of(kept.points, workload="frame", instruction_set="avx2"))


def two_threads(kept):
    for method in kept.points["method"].unique():
        yield table_row(find_method(method).label, *map(digits, gains_of_two_threads(kept.points, method)))


def gains_of_two_threads(table, method):
    one, two = (each_scene(table, method=method, threads=threads) for threads in (1, 2))
    return [a["render_time_s"] / b["render_time_s"] for a, b in zip(one, two, strict=True)]


def two_eyes(kept):
    for row in best_of_each(kept.points):
        yield table_row(f"`{row['scene']}`, {split_of(row)}", milliseconds(row["render_time_s"]), *_over_others(row))


def several_frames(kept):
    """A scene, a motion and a number of frames a row: together, over each other way to make them."""
    for scene in SCENES:
        rows = of(kept.points, scene=scene).sort_values(["motion", "frames"], ascending=[False, True])
        for _, row in rows.iterrows():
            cells = (f"`{scene}`", f"{row['motion']}, {row['frames']}", milliseconds(row["render_time_s"]))
            yield table_row(*cells, *_over_others(row))


def _over_others(row):
    others = ("separate", "visible_first", "packets", "rasteriser")
    return [interval(row, f"speedup_vs_{name}") for name in others]


def moving_cameras(kept):
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


def price_of_robust(kept):
    """A frame in Embree's robust setting over one in its fast setting: time, each against packets of its own rounds."""

    def speed(**values):
        return estimate(kept.processes, "speedup_vs_packets", workload="frame", **values)

    for label, point in ROBUST.items():
        fast, robust = ([speed(scene=scene, robust=how, **point) for scene in SCENES] for how in (False, True))
        yield table_row(label, *(a.over(b) for a, b in zip(fast, robust, strict=True)))
    assert set(of(kept.points, robust=True)["pixels_hole"].dropna()) == {0}


_JOBS = {"camera_rays": "of a camera", "random_rays": "from anywhere to anywhere"}


def twenty_views(kept):
    """A mesh a row: triangles, how many times as fast the library is as each tracer of others, and the least share of
    pixels with the same triangle."""
    table = of(kept.points, job="views")
    methods = tuple(table["method"].unique())
    for triangles, of_mesh in table.groupby("triangles"):
        gains = (interval(of(of_mesh, method=method).iloc[0], "library_gain") for method in methods)
        yield table_row(f"{triangles:,}", *gains, f"{of_mesh['ids_equal'].min():.5f}")
    yield from (f"{TIMES} {find_method(method).label}" for method in methods)


def million_rays(kept):
    """A mesh a row: triangles, and for rays of every kind how many times as fast the library is as embreex."""
    for triangles, of_mesh in of(kept.points, method="embreex").groupby("triangles"):
        gains = (interval(of(of_mesh, job=job).iloc[0], "library_gain") for job in _JOBS)
        yield table_row(f"{triangles:,}", *gains)
    yield from _JOBS.values()
