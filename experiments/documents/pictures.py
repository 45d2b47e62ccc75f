"""What the pages quote of whole pictures, and of lenses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.documents.quotation import SCENES, Kept, digits, estimate, interval, milliseconds, of, span, table_row
from experiments.light.equal_error.measure import BEFORE, FAST, MITSUBA, OURS
from experiments.methods.peers.llvmpipe import LLVMPIPE

_ALL_SCENES = (*SCENES, "weekend")
_PLAIN = {
    "method": "raster", "frame": "hybrid", "samples": 1, "jitter": "shared", "order": "depth_first", "mitsuba": "none",
}  # fmt: skip


def _time(row: Any) -> Any:
    return milliseconds(row["render_time_s"])


def _gain(row: Any) -> Any:
    return interval(row, "speedup_vs_packets")


def _outside(row: Any) -> Any:
    return f"{100.0 * row['outside_embree']:.0f} %"


_QUANTITIES: tuple[Any, ...] = (
    ("hybrid, ms a sample", {}, _time),
    ("hybrid, over packets", {}, _gain),
    ("forecast of that by Amdahl", {}, lambda row: digits(row["speedup_forecast"])),
    ("hybrid, outside Embree", {}, _outside),
    ("visible-first for the rasteriser", {"method": "visible_first"}, _gain),
    ("4 samples, camera still", {"jitter": "off", "samples": 4}, _gain),
    ("paths, over packets", {"frame": "path"}, _gain),
    ("samples over Mitsuba 3's", {"frame": "path", "mitsuba": "llvm_ad_rgb"},
     lambda row: interval(row, "samples_vs_mitsuba")),
)  # fmt: skip
"""Label, what is other than in a plain sample, and what is quoted of that row."""


def whole_pictures(kept: Kept) -> Iterable[str]:
    """A quantity a row, a scene a column. Of images by our own methods none may have a wrong pixel, but where rays of
    Embree's fast setting slip through between triangles; the rasteriser's never do."""
    for label, other, quote in _QUANTITIES:
        given = _PLAIN | other
        scenes = _ALL_SCENES if given["mitsuba"] == "none" else SCENES
        found = [of(kept.points, scene=scene, **given) for scene in scenes]
        assert all(len(of_scene) == 1 for of_scene in found), f"not one row each of {given}"
        cells = [quote(of_scene.iloc[0]) for of_scene in found]
        yield table_row(label, *cells, *["not asked"] * (len(_ALL_SCENES) - len(cells)))
    waves = (_time_of_waves(kept.processes, scene) for scene in _ALL_SCENES)
    yield table_row("paths in waves over depth first: time", *waves)
    own = kept.points[kept.points["method"] != LLVMPIPE.name]
    holes = own["pixels_hole"] + own["baseline_pixels_hole"]
    assert set(own["pixels_unlike"]) == set(own["pixels_wrong"] - holes) == {0}
    assert set(of(own, method=_PLAIN["method"])["pixels_hole"]) == {0}


def _time_of_waves(processes: Any, scene: Any) -> Any:
    """Time of a path-traced sample in waves over its time depth first. The two share no process."""
    paths = _PLAIN | {"frame": "path", "scene": scene}
    waves, depth_first = (
        estimate(processes, "render_time_s", **paths | {"order": order}) for order in ("waves", "depth_first")
    )
    return waves.over(depth_first)


def equal_error(kept: Kept) -> Iterable[str]:
    """Seconds to a relative error of 5 %, by scene and number of threads: ours, with Mitsuba's settings of Embree,
    before lights were aimed at, and Mitsuba's two variants; then how many times ours with either settings is the faster
    variant's time, and the means of blocks."""
    for (scene, threads), found in kept.points.groupby(["scene", "threads"], sort=False):
        rows = found.set_index("renderer")
        times = rows["time_to_5%_s"]
        shown = [digits(times[name]) if name in times else "" for name in (OURS, FAST, BEFORE, *MITSUBA)]
        theirs = [times[name] for name in MITSUBA if name in times]
        apart = [rows.loc[name, "blocks_apart"] for name in MITSUBA if name in times]
        over = [digits(times[name] / min(theirs)) for name in (OURS, FAST)]
        yield table_row(scene, threads, *shown, *over, f"{100 * min(apart):.1f} %")


def converged_blocks(kept: Kept) -> Iterable[str]:
    """A scene a row: samples, blocks, and how far apart the means of ours and Mitsuba's are."""
    for row in kept.points.to_dict("records"):
        shares = (f"{100 * row[name]:.2f} %" for name in ("median_apart", "noise", "most_apart"))
        within = f"{100 * row['within_goal']:.0f} %"
        yield table_row(row["scene"], f"{row['samples']:,}", row["blocks"], *shares, within, row["surely_apart"])


def through_lenses(kept: Kept) -> Iterable[str]:
    """Packets with a lens over packets without; packets over the rasteriser, with a lens; both over the scenes and two
    lenses. A BOP frame over llvmpipe's."""
    one_thread = kept.points[kept.points["threads"] == 1]
    ms = one_thread.groupby(["frame", "method", "lens"], dropna=False)["ms"].median()

    def over(one: Any, other: Any) -> Any:
        return [pd.Series(ms[scene, one] / ms[scene, other]) for scene in SCENES]

    yield f"packets take {span(pd.concat(over('packets', 'packets without lens')))} times as long through a lens"
    gains = ", ".join(digits(gain.min()) for gain in over("packets", "raster"))
    yield f"at least {gains} times as fast as packets"
    bop = ms["bop"]
    yield f"{digits(float(bop['llvmpipe'].iloc[0] / bop['atra'].iloc[0]))} times as fast as OpenGL on llvmpipe"
