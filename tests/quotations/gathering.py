"""What the pages quote of sweep=gather."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.methods import find_method
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


def all_hits(kept: Kept) -> Quoted:
    """Counts over packets that gather the same, and what else is gathered over counting."""
    packets = (milliseconds(best(kept.points, scene=scene, method="pixel", what="count")["packets_render_time_s"])
               for scene in SCENES)  # fmt: skip
    rows = [table_row("`count`, packets: ms", *packets)]
    for method in ("raster", "aligned"):
        chosen = [best(kept.points, scene=scene, method=method, what="count") for scene in SCENES]
        gains = (interval(row, "speedup_vs_packets") + (f" ({split_of(row)})" if method == "aligned" else "")
                 for row in chosen)  # fmt: skip
        rows.append(table_row(f"`count`, {find_method(method).label}: {TIMES} packets", *gains))
    rows += [
        table_row(f"`{what}` ÷ `count`, {find_method(method).label}", *_over_count(kept, method, what))
        for what in ("transmittance", "layers")
        for method in ("pixel", "raster", "aligned")
    ]
    return Quoted(rows=tuple(rows))


def _over_count(kept: Kept, method: str, what: str) -> Iterator[str]:
    split = {} if method != "aligned" else {"split_x": 128, "culling": True}
    for scene in SCENES:
        asked, counted = (
            best(kept.points, scene=scene, method=method, what=one, **split)["render_time_s"] for one in (what, "count")
        )
        yield digits(asked / counted)


def all_hits_of_a_closed_mesh(kept: Kept) -> Quoted:
    """Over other people's tracer that steps a ray on: times as fast, and the hits that each loses or repeats."""
    rows = []
    for method in ("pixel", "aligned", "raster", "trimesh"):
        cells = []
        for what in ("count", "thickness"):
            row, theirs = (best(kept.points, scene=_CLOSED, method=one, what=what) for one in (method, "trimesh"))
            cells += [milliseconds(row["render_time_s"]), digits(theirs["render_time_s"] / row["render_time_s"])]
        counted = of(kept.points, scene=_CLOSED, method=method, what="count")
        lost, repeated = (int(counted[name].max()) for name in ("hits_missing", "hits_too_many"))
        rows.append(table_row(find_method(method).label, *cells, f"{lost:,}", f"{repeated:,}"))
    return Quoted(rows=tuple(rows))
