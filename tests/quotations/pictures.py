"""What docs/methods.md quotes of the sweep of whole pictures."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.methods.peers.llvmpipe import LLVMPIPE
from tests.quotations.quotation import SCENES, Kept, Quoted, digits, interval, milliseconds, of, table_row


def whole_pictures(kept: Kept) -> Quoted:
    """Scene; of hybrid pictures: ms of a sample, its gain by the rasteriser over packets, Amdahl's forecast of that,
    the share outside Embree, the gain of visible-first, and that of 4 samples of a camera that stays; of paths: the
    gain, the share outside Embree in waves, and samples for each of Mitsuba 3's."""
    table, rows = kept.points, []
    for scene in (*SCENES, "weekend"):

        def one(scene: str = scene, method: str = "raster", frame: str = "hybrid", **values: Any) -> pd.Series:
            given = {"samples": 1, "jitter": "shared", "order": "depth_first", "mitsuba": "none"} | values
            found = of(table, scene=scene, method=method, frame=frame, **given)
            assert len(found) == 1, f"{len(found)} rows for {scene}, {method}, {frame}, {values}"
            return found.iloc[0]

        hybrid, paths = one(), one(frame="path")
        rows.append(
            table_row(
                f"`{scene}`",
                milliseconds(hybrid["render_time_s"]),
                interval(hybrid, "speedup_vs_packets"),
                digits(hybrid["speedup_forecast"]),
                percent(hybrid["outside_embree"]),
                interval(one(method="visible_first"), "speedup_vs_packets"),
                interval(one(jitter="off", samples=4), "speedup_vs_packets"),
                interval(paths, "speedup_vs_packets"),
                percent(one(frame="path", order="waves")["outside_embree"]),
                interval(one(frame="path", mitsuba="llvm_ad_rgb"), "samples_vs_mitsuba"),
            )
        )
    own = table[table["method"] != LLVMPIPE.name]
    assert set(own["pixels_wrong"].dropna()) == set(own["pixels_unlike"].dropna()) == {0}
    return Quoted(rows=tuple(rows))


def percent(share: float) -> str:
    """ "24 %"."""
    return f"{100.0 * share:.0f} %"
