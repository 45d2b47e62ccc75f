"""What the pages quote of sweep=gather."""

from __future__ import annotations

from typing import Any

import pandas as pd

from experiments.methods import find_method
from experiments.paper.readings import EVERY_HIT
from experiments.results.estimates import FEWEST_PROCESSES, Estimate
from tests.quotations import paper
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

_CLOSED = "three_holes"

_ALIGNED = {"method": "aligned", "split_x": 128, "culling": True}
_RAYS: dict[str, tuple[str, dict[str, Any]]] = {
    "packets": ("packets_render_time_s", {"method": "raster"}),
    "aligned": ("render_time_s", _ALIGNED),
    "rasteriser": ("render_time_s", {"method": "raster"}),
}
"""What else is gathered with, beside counts: where its times stand. Packets are timed beside every point; aligned rays
gather all of it at one split."""


def _in_packets(table: pd.DataFrame) -> pd.DataFrame:
    """The rows without those of aligned single rays; the rasteriser, which shoots none, says 1 as well."""
    return table[table["method"].ne("aligned") | table["packet_width"].gt(1).fillna(False)]


def counting(kept: Kept) -> Quoted:
    """Milliseconds of packets that count, and how many times as fast others are: over packets, and over single rays."""
    packets, single = _in_packets(kept.points), of(kept.points, packet_width=1, culling=True)
    raster = [best(packets, scene=scene, method="raster", what="count") for scene in SCENES]
    aligned = [best(packets, scene=scene, method="aligned", what="count") for scene in SCENES]
    alone = [best(single, scene=scene, what="count") for scene in SCENES]
    lines = (
        ("rasteriser", "packets", raster, "speedup_vs_packets"),
        ("aligned packets", "packets", aligned, "speedup_vs_packets"),
        ("rasteriser", "single rays", raster, "speedup"),
        ("aligned packets", "single rays", aligned, "speedup"),
        ("aligned single rays", "single rays", alone, "speedup"),
    )
    rows = [table_row("packets, ms", *(milliseconds(row["packets_render_time_s"]) for row in raster))]
    for name, over, chosen, column in lines:
        rows.append(table_row(f"{name}, {TIMES} {over}", *(_gain(row, column) for row in chosen)))
    return Quoted(rows=tuple(rows))


def _gain(row: pd.Series, column: str) -> str:
    split = "" if pd.isna(row["split_x"]) else f" ({split_of(row)})"
    return interval(row, column) + split


def over_counting(kept: Kept) -> Quoted:
    """Times of transmittance and of eight layers over those of counts, with the same rays."""
    rows = []
    for what, label in (("transmittance", "transmittance"), ("layers", "`layers(8)`")):
        for name, (column, values) in _RAYS.items():
            cells = (_over_count(kept, what, column, scene=scene, **values) for scene in SCENES)
            rows.append(table_row(f"{label}, {name}", *cells))
    return Quoted(rows=tuple(rows))


def _over_count(kept: Kept, what: str, column: str, **values: Any) -> str:
    """The ratio of two points, which share no process."""
    packets = of(_in_packets(kept.processes), layers=8, **values)
    times = [of(packets, what=one)[column].tolist() for one in (what, "count")]
    if min(map(len, times)) < FEWEST_PROCESSES:
        return "too few processes"
    ratio = Estimate.of(times[0]).over(Estimate.of(times[1]))
    return f"{digits(ratio.value)} [{digits(ratio.low)}, {digits(ratio.high)}]"


def counts_of_others(kept: Kept) -> Quoted:
    """A scene and another tracer a row: how many times as fast packets and the rasteriser count, and of all hits those
    that it loses and those that it finds beside them."""
    rows = []
    for scene in (*SCENES, _CLOSED):
        raster = best(kept.points, scene=scene, method="raster", what="count")
        for method in ("trimesh", "open3d"):
            found = of(kept.points, scene=scene, method=method, what="count")
            if found.empty:
                continue
            theirs = found.iloc[0]
            gains = digits(1.0 / theirs["speedup_vs_packets"]), digits(raster["speedup"] / theirs["speedup"])
            hits = (f"{theirs[name]:,}" for name in ("hits_in_all", "hits_missing", "hits_too_many"))
            rows.append(table_row(f"`{scene}`, {find_method(method).label}", *gains, *hits))
    return Quoted(rows=tuple(rows))


def solids(kept: Kept) -> Quoted:
    """A tracer a row, of a closed mesh: milliseconds of counts and of thickness, thickness over counts, how many times
    as fast as trimesh counts and measures thickness, and pixels of another thickness than that of single rays."""
    rows, packets = [], _in_packets(kept.points)
    theirs = {what: of(packets, scene=_CLOSED, method="trimesh", what=what).iloc[0] for what in ("count", "thickness")}
    for method in ("pixel", "aligned", "raster", "trimesh"):
        counted = best(packets, scene=_CLOSED, method=method, what="count")
        same = {} if pd.isna(counted["split_x"]) else {"split_x": counted["split_x"]}
        solid = best(packets, scene=_CLOSED, method=method, what="thickness", **same)
        gains = (digits(row["speedup"] / theirs[row["what"]]["speedup"]) for row in (counted, solid))
        times = (milliseconds(row["render_time_s"]) for row in (counted, solid))
        ratio = digits(solid["render_time_s"] / counted["render_time_s"])
        label = "packets" if method == "pixel" else find_method(method).label
        rows.append(table_row(label, *times, ratio, *gains, f"{solid['pixels_different']:,}"))
    return Quoted(rows=tuple(rows))


def gains_where_every_hit_is_wanted(kept: Kept) -> Quoted:
    """A scene a row: the paper's gain, that of aligned single rays over the same at 1 x 1, and that of aligned packets
    over packets per pixel that gather the same."""
    return paper.best_gains(kept)


def verdicts_where_every_hit_is_wanted(kept: Kept) -> Quoted:
    """A row a claim; those on the best speed-ups stand in a table of their own."""
    judged = (one for one in kept.claims if not one["id"].startswith("best-speedup"))
    assert {one["reading"] for one in kept.claims} == {EVERY_HIT.name}
    return Quoted(rows=tuple(table_row(paper.claim_text(one), one["section"], one["verdict"]) for one in judged))
