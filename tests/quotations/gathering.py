"""What the pages quote of sweep=gather."""

import pandas as pd

from experiments.methods import find_method
from experiments.paper.readings import EVERY_HIT
from tests.quotations import paper
from tests.quotations.quotation import (
    SCENES,
    TIMES,
    best,
    best_of_each,
    digits,
    estimate,
    interval,
    line,
    milliseconds,
    of,
    say,
    split_of,
    table_row,
)  # fmt: skip

_CLOSED = "three_holes"
_RAYS = {
    "packets": ("packets_render_time_s", {"method": "raster"}),
    "aligned": ("render_time_s", {"method": "aligned", "split_x": 128, "culling": True}),
    "rasteriser": ("render_time_s", {"method": "raster"}),
}
"""What else is gathered with, beside counts: where its times stand. Packets are timed beside every point; aligned rays
gather all of it at one split."""


def in_packets(table):
    """The rows without those of aligned single rays; the rasteriser, which shoots none, says 1 as well."""
    return table[table["method"].ne("aligned") | table["packet_width"].gt(1).fillna(False)]


def counting(kept):
    """Milliseconds of packets that count, and how many times as fast others are: over packets, and over single rays."""
    packets = in_packets(kept.points)
    raster, aligned = (best_of_each(packets, method=name, what="count") for name in ("raster", "aligned"))
    alone = best_of_each(of(kept.points, packet_width=1, culling=True), what="count")
    yield table_row("packets, ms", *(milliseconds(row["packets_render_time_s"]) for row in raster))
    yield line(f"rasteriser, {TIMES} packets", raster, "speedup_vs_packets", _gain)
    yield line(f"aligned packets, {TIMES} packets", aligned, "speedup_vs_packets", _gain)
    yield line(f"rasteriser, {TIMES} single rays", raster, "speedup", _gain)
    yield line(f"aligned packets, {TIMES} single rays", aligned, "speedup", _gain)
    yield line(f"aligned single rays, {TIMES} single rays", alone, "speedup", _gain)


def _gain(row, column):
    return interval(row, column) + ("" if pd.isna(row["split_x"]) else f" ({split_of(row)})")


def over_counting(kept):
    """Times of transmittance and of eight layers over those of counts, with the same rays."""
    for what, label in (("transmittance", "transmittance"), ("layers", "`layers(8)`")):
        for name, (column, values) in _RAYS.items():
            cells = (_over_count(kept, what, column, scene=scene, **values) for scene in SCENES)
            yield table_row(f"{label}, {name}", *cells)


def _over_count(kept, what, column, **values):
    packets = of(in_packets(kept.points), layers=8, **values)
    asked, counted = (of(packets, what=one).iloc[0] for one in (what, "count"))
    return _over(kept, column, asked, counted)


def _over(kept, column, one, other):
    """The ratio of two points, which share no process."""
    above, below = (estimate(kept.processes, column, point_id=row["point_id"]) for row in (one, other))
    return say(above.over(below))


def counts_of_others(kept):
    """A scene and another tracer a row: how many times as fast packets and the rasteriser count, and of all hits those
    that it loses and those that it finds beside them."""
    for scene in (*SCENES, _CLOSED):
        raster = best(kept.points, scene=scene, method="raster", what="count")
        for method in ("trimesh", "open3d"):
            for _, theirs in of(kept.points, scene=scene, method=method, what="count").iloc[:1].iterrows():
                ends = (1.0 / theirs[f"speedup_vs_packets{end}"] for end in ("", "_high", "_low"))
                packets, low, high = map(digits, ends)
                gains = f"{packets} [{low}, {high}]", _over(kept, "speedup", raster, theirs)
                hits = (f"{theirs[name]:,}" for name in ("hits_in_all", "hits_missing", "hits_too_many"))
                yield table_row(f"`{scene}`, {find_method(method).label}", *gains, *hits)


def solids(kept):
    """A tracer a row, of a closed mesh: milliseconds of counts and of thickness, thickness over counts, how many times
    as fast as trimesh counts and measures thickness, and pixels of another thickness than that of single rays."""
    packets = of(in_packets(kept.points), scene=_CLOSED)
    theirs = {what: of(packets, method="trimesh", what=what).iloc[0] for what in ("count", "thickness")}
    for method in ("pixel", "aligned", "raster", "trimesh"):
        counted = best(packets, method=method, what="count")
        same = {} if pd.isna(counted["split_x"]) else {"split_x": counted["split_x"]}
        solid = best(packets, method=method, what="thickness", **same)
        gains = (
            "1" if method == "trimesh" else _over(kept, "speedup", row, theirs[row["what"]]) for row in (counted, solid)
        )
        times = (milliseconds(row["render_time_s"]) for row in (counted, solid))
        ratio = _over(kept, "render_time_s", solid, counted)
        label = "packets" if method == "pixel" else find_method(method).label
        yield table_row(label, *times, ratio, *gains, f"{solid['pixels_different']:,}")


def gains_where_every_hit_is_wanted(kept):
    """A scene a row: the paper's gain, that of aligned single rays over the same at 1 x 1, and that of aligned packets
    over packets per pixel that gather the same."""
    return paper.best_gains(kept)


def verdicts_where_every_hit_is_wanted(kept):
    """A row a claim; those on the best speed-ups stand in a table of their own."""
    assert {one["reading"] for one in kept.claims} == {EVERY_HIT.name}
    for one in kept.claims:
        if not one["id"].startswith("best-speedup"):
            yield table_row(paper.claim_text(one), one["section"], one["verdict"])
