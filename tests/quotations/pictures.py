"""What the pages quote of the sweep of whole pictures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pandas as pd

from experiments.methods.peers.llvmpipe import LLVMPIPE
from tests.quotations.quotation import SCENES, Kept, Quoted, digits, interval, milliseconds, of, table_row

_PLAIN = {"method": "raster", "frame": "hybrid", "samples": 1, "jitter": "shared", "order": "depth_first"}

_QUANTITIES: tuple[tuple[str, dict[str, Any], Callable[[pd.Series], str]], ...] = (
    ("hybrid, ms a sample", {}, lambda row: milliseconds(row["render_time_s"])),
    ("hybrid, over packets", {}, lambda row: interval(row, "speedup_vs_packets")),
    ("forecast of that by Amdahl", {}, lambda row: digits(row["speedup_forecast"])),
    ("hybrid, outside Embree", {}, lambda row: percent(row["outside_embree"])),
    ("visible-first for the rasteriser", {"method": "visible_first"}, lambda row: interval(row, "speedup_vs_packets")),
    ("4 samples, camera still", {"jitter": "off", "samples": 4}, lambda row: interval(row, "speedup_vs_packets")),
    ("paths, over packets", {"frame": "path"}, lambda row: interval(row, "speedup_vs_packets")),
    ("waves of paths, outside Embree", {"frame": "path", "order": "waves"}, lambda row: percent(row["outside_embree"])),
    (
        "samples over Mitsuba 3's",
        {"frame": "path", "mitsuba": "llvm_ad_rgb"},
        lambda row: interval(row, "samples_vs_mitsuba"),
    ),
)
"""Label, what is other than in a plain sample, and what is quoted of that row."""


def whole_pictures(kept: Kept) -> Quoted:
    """A quantity a row, a scene a column. Of images by our own methods none may have a wrong pixel."""
    rows = []
    for label, other, quote in _QUANTITIES:
        given = {"mitsuba": "none"} | _PLAIN | other
        scenes = (*SCENES, "weekend") if given["mitsuba"] == "none" else SCENES
        found = [of(kept.points, scene=scene, **given) for scene in scenes]
        assert all(len(of_scene) == 1 for of_scene in found), f"not one row each of {given}"
        cells = [quote(of_scene.iloc[0]) for of_scene in found]
        rows.append(table_row(label, *cells, *["not asked"] * (len(SCENES) + 1 - len(cells))))
    own = kept.points[kept.points["method"] != LLVMPIPE.name]
    assert set(own["pixels_wrong"].dropna()) == set(own["pixels_unlike"].dropna()) == {0}
    return Quoted(rows=tuple(rows))


def percent(share: float) -> str:
    """ "24 %"."""
    return f"{100.0 * share:.0f} %"
