"""What pages say of rays of one's own beside other libraries, and of sweep=gather."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.documents import paper
from experiments.documents.quotation import (
    SCENES,
    TIMES,
    Kept,
    best,
    best_of_each,
    digits,
    estimate,
    interval,
    line,
    milliseconds,
    of,
    say,
    span,
    split_of,
    table_row,
)
from experiments.methods import find_method
from experiments.paper.readings import EVERY_HIT
from experiments.results.table import rows_of

_PEERS = {"trimesh": "trimesh with embreex", "open3d": "Open3D"}
_SCENES = ("sponza", "three_holes")
_THREADS = (1, 2)
_BATCHES = ("coherent", "incoherent")
_ASKED = ("rays_questions", "rays_questions_threads")
_QUESTIONS = {"closest": "closest hit", "any": "any hit", "all": "all hits"}


def rays_beside_others(kept: Kept) -> Iterable[str]:
    """A question and a kind of rays a row; a scene and a peer a column: the peer's time over ours, for each number of
    threads that was measured."""
    asked, inside = rows_of(kept.points, *_ASKED), of(kept.points, question="contains")
    for question, label in _QUESTIONS.items():
        for batch in _BATCHES:
            yield table_row(f"{label}, {batch}", *_cells(of(asked, question=question, ray_batch=batch)))
    yield table_row("points inside", *_cells(inside))


def _cells(rows: Any) -> Any:
    for scene in _SCENES:
        for peer in _PEERS:
            gains = [of(rows, scene=scene, method=peer, threads=threads)["answer_gain"] for threads in _THREADS]
            yield ", ".join(digits(gain.item()) for gain in gains if len(gain))


def hits_lost_by_others(kept: Kept) -> Iterable[str]:
    """A sentence a peer: how many of the judged hits it lost, and how many `RayScene` lost."""
    for peer, name in _PEERS.items():
        rows = of(kept.points, method=peer)
        judged, lost, ours = (f"{rows[column].sum():,}" for column in ("judged_hits", "lost", "library_lost"))
        yield f"of {judged} judged hits {name} lost {lost}, `RayScene` {ours}"


def nanoseconds_a_ray(kept: Kept) -> Iterable[str]:
    """A number of rays a row: nanoseconds a ray that the closest hit takes on one thread, coherent and incoherent."""
    for asked, rows in rows_of(kept.points, "rays_numbers").groupby("asked"):
        times = (of(rows, ray_batch=batch)["answer_library_time_s"].item() for batch in _BATCHES)
        yield table_row(f"{asked:,}", *(f"{1e9 * time / asked:.0f}" for time in times))


def rays_in_short(kept: Kept) -> Iterable[str]:
    """The closest hit, all hits and points inside over both peers, whatever the rays, the scene and the threads."""
    rows = of(kept.points)
    for question, words in (("closest", "the closest hit"), ("all", "all hits")):
        asked = of(rows_of(rows, *_ASKED), question=question)
        gains = (
            f"{span(of(asked, method=peer)['answer_gain'])} times as fast as {name}" for peer, name in _PEERS.items()
        )
        yield f"{words} {' and '.join(gains)}"
    yield f"what lies inside {span(of(rows, question='contains')['answer_gain'])} times"


def closest_hit_over_trimesh(kept: Kept) -> Iterable[str]:
    rows = of(rows_of(kept.points, *_ASKED), question="closest", method="trimesh")
    yield f"the closest hit {span(rows['answer_gain'])} times as fast as trimesh with embreex"


def rays_with_avx2(kept: Kept) -> Iterable[str]:
    """Closest hits over trimesh with embreex: a scene a row, coherent and incoherent."""
    for scene in _SCENES:
        rows = of(kept.points, workload="rays", scene=scene)
        yield table_row(f"`{scene}`", *(digits(of(rows, ray_batch=batch)["answer_gain"].item()) for batch in _BATCHES))


_CLOSED = "three_holes"
_RAYS: dict[str, tuple[str, dict[str, Any]]] = {
    "packets": ("packets_render_time_s", {"method": "raster"}),
    "aligned": ("render_time_s", {"method": "aligned", "split_x": 128, "culling": True}),
    "rasteriser": ("render_time_s", {"method": "raster"}),
}
"""What else is gathered with, beside counts: where its times stand. Packets are timed beside every point; aligned rays
gather all of it at one split."""


def in_packets(table: Any) -> Any:
    """The rows without those of aligned single rays; the rasteriser, which shoots none, says 1 as well."""
    return table[table["method"].ne("aligned") | table["packet_width"].gt(1).fillna(False)]


def counting(kept: Kept) -> Iterable[str]:
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


def _gain(row: Any, column: Any) -> Any:
    return interval(row, column) + ("" if pd.isna(row["split_x"]) else f" ({split_of(row)})")


def over_counting(kept: Kept) -> Iterable[str]:
    """Times of transmittance and of eight layers over those of counts, with the same rays."""
    for what, label in (("transmittance", "transmittance"), ("layers", "`layers(8)`")):
        for name, (column, values) in _RAYS.items():
            cells = (_over_count(kept, what, column, scene=scene, **values) for scene in SCENES)
            yield table_row(f"{label}, {name}", *cells)


def _over_count(kept: Kept, what: Any, column: Any, **values: Any) -> Any:
    packets = of(in_packets(kept.points), layers=8, **values)
    asked, counted = (of(packets, what=one).iloc[0] for one in (what, "count"))
    return _over(kept, column, asked, counted)


def _over(kept: Kept, column: Any, one: Any, other: Any) -> Any:
    """The ratio of two points, which share no process."""
    above, below = (estimate(kept.processes, column, point_id=row["point_id"]) for row in (one, other))
    return say(above.over(below))


def counts_of_others(kept: Kept) -> Iterable[str]:
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


def solids(kept: Kept) -> Iterable[str]:
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


def gains_where_every_hit_is_wanted(kept: Kept) -> Iterable[str]:
    """A scene a row: the paper's gain, that of aligned single rays over the same at 1 x 1, and that of aligned packets
    over packets per pixel that gather the same."""
    return paper.best_gains(kept)


def verdicts_where_every_hit_is_wanted(kept: Kept) -> Iterable[str]:
    """A row a claim; those on the best speed-ups stand in a table of their own."""
    assert {one["reading"] for one in kept.claims} == {EVERY_HIT.name}
    for one in kept.claims:
        if not one["id"].startswith("best-speedup"):
            yield table_row(paper.claim_text(one), one["section"], one["verdict"])
