"""What docs/methods.md and docs/not_helpful.md say of the tables in short: few rows, or the range over the scenes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.documents.methods import (
    COMPARED,
    both_ends_of_the_rasteriser,
    gains_of_two_threads,
    rasteriser_held_to,
)
from experiments.documents.quotation import SCENES, Kept, best_of_each, digits, each_scene, of, span, table_row
from experiments.methods import find_method
from experiments.workloads.frame.shown import best_baselines


def still_and_moving(kept: Kept) -> Iterable[str]:
    """Speed over packets of each method at its best split, with a still camera and with another eye in every frame."""
    for name in COMPARED:
        still, moving = (
            span(row["speedup_vs_packets"] for row in best_of_each(of(kept.points, workload=workload), method=name))
            for workload in ("frame", "moving")
        )
        yield f"{find_method(name).label} {still} times ({moving})"


def growth_in_words(kept: Kept) -> Iterable[str]:
    return both_ends_of_the_rasteriser(kept, "sponza")


def narrower_vectors(kept: Kept) -> Iterable[str]:
    """How far ahead of packets the rasteriser is with AVX2 and with SSE4.2."""
    held = ("avx2", "sse4.2")
    avx2, sse = (span(row["speedup_vs_packets"] for row in rasteriser_held_to(kept, name)) for name in held)
    yield f"{avx2} times as fast as packets with AVX2 and {sse} times with SSE4.2"


def tuned_packets(kept: Kept) -> Iterable[str]:
    found = list(best_baselines(kept.processes))
    (tried,) = {one.tried for one in found}
    (best,) = (one for one in found if one.is_faster)
    assert best.margin is not None
    setting = best.name.removeprefix("packets of 16 per pixel, ")
    gain = f"{setting} on `{best.scene}`, {digits(best.margin.value)} times"
    yield f"Of {tried} settings of packets one is faster than these by more than noise: {gain}"


def others_in_short(kept: Kept) -> Iterable[str]:
    """The fastest of other people's tracers over packets; none is as fast as the rasteriser."""
    frames = of(kept.points, workload="frame")
    others = frames[frames["method"].map(lambda name: find_method(name).is_peer) & frames["speedup"].notna()]
    raster = of(frames, method="raster").set_index("scene")["speedup"]
    assert (others["speedup"] < others["scene"].map(raster)).all()
    yield f"Mitsuba 3 is {span(of(frames, method='mitsuba3')['speedup_vs_packets'])} times as fast as packets"


def second_thread(kept: Kept) -> Iterable[str]:
    methods = kept.points["method"].unique()
    gains = span(gain for method in methods for gain in gains_of_two_threads(kept.points, method))
    yield f"Two threads are {gains} times as fast as one"


def twenty_views_in_short(kept: Kept) -> Iterable[str]:
    """Twenty views by `render_views` beside others."""
    for method, name in (("embreex", "embreex"), ("open3d", "Open3D")):
        yield f"{span(of(kept.points, method=method, job='views')['library_gain'])} times as fast as {name}"


def instances_in_short(kept: Kept) -> Iterable[str]:
    """Embree's bytes of Sponza at 64 x 1: copied, with culling and without, and as instances."""
    table = of(kept.points, workload="frame", method="aligned", scene="sponza", split_x=64, split_y=1)
    widest = of(table, packet_width=table["packet_width"].max())
    kinds = (("copied", False), ("copied", True), ("instanced", False))
    chosen = [of(widest, geometry=geometry, culling=culling).iloc[0] for geometry, culling in kinds]
    whole, culled, instanced = (f"{row['embree_bytes'] / 2**20:,.1f}" for row in chosen)
    slower = digits(chosen[2]["speedup_vs_packets"] / chosen[1]["speedup_vs_packets"])
    yield f"copies take {whole} MiB, culled copies {culled} MiB and instances {instanced} MiB"
    yield f"instances are {slower} times as fast as culled copies"


def eyes_in_short(kept: Kept) -> Iterable[str]:
    yield f"{span(row['speedup_vs_separate'] for row in best_of_each(kept.points))} times as fast as each eye by itself"


def frames_in_short(kept: Kept) -> Iterable[str]:
    """Eight frames from one set of rays, whatever moves."""
    gains = span(of(kept.points, frames=8)["speedup_vs_separate"])
    yield f"eight frames {gains} times"


def surfaces_in_short(kept: Kept) -> Iterable[str]:
    yield f"takes {span(kept.points['surface_over_frame'])} times as long"


def pictures_in_short(kept: Kept) -> Iterable[str]:
    """Whole pictures over the same pictures with packets for primary visibility, and beside Mitsuba 3."""

    def gains(column: Any, **values: Any) -> Any:
        plain = {"method": "raster", "samples": 1, "jitter": "shared", "order": "depth_first"}
        return span(row[column] for row in each_scene(kept.points, **plain, **values))

    yield f"hybrid pictures {gains('speedup_vs_packets', frame='hybrid', mitsuba='none')} times"
    yield f"path-traced ones {gains('speedup_vs_packets', frame='path', mitsuba='none')} times"
    samples = gains("samples_vs_mitsuba", frame="path", mitsuba="llvm_ad_rgb")
    yield f"{samples} times as many samples a second as Mitsuba 3"


def mitsuba_in_short(kept: Kept) -> Iterable[str]:
    """Paths a second of lightmaps beside Mitsuba's best, with its settings; and its time to an error, without lamps."""
    same = of(kept.points, against="mitsuba", robust_rays=False)
    yield f"{span(same['speedup_vs_best_other'])} times as many paths a second as Mitsuba 3 at its best"
    sunlit = same[same["scene"].ne("cornell_box")]
    yield f"its error {span(sunlit['quality_vs_other'])} times as soon"


def light_bundles(kept: Kept) -> Iterable[str]:
    """How much sooner than paths bundles that carry light reach an error of 5 %."""
    rows = kept.points.set_index("scene")

    def say(row: Any) -> Any:
        reached = not pd.isna(row["bundle_directions_to_rmse_5"])
        return f"{row['paths_over_bundles']:.2g}" if reached else f"not reached, {row['bundle_error']:.0%} left"

    yield table_row("times as soon as paths", *(say(rows.loc[scene]) for scene in SCENES))
    traced = rows["packets_over_aligned"]
    aligned = f"{traced.min():.2g} to {traced.max():.2g}"
    yield f"Aligned, the rays are traced and the light exchanged {aligned} times as fast as with packets"
