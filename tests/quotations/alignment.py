"""Where alignment is fastest, where it gains over packets alone, and where it loses: one table of several sweeps."""

from experiments.results.statistics import Interval
from experiments.results.verdicts import decide_greater
from tests.quotations.gathering import in_packets
from tests.quotations.quotation import REFERENCE, best, kept_in, of, span, table_row

_FASTEST, _AHEAD, _LEVEL, _BEHIND = "fastest", "ahead of packets only", "level with packets", "behind packets"
_ENOUGH_POSITIONS = 16
"""With fewer positions in a texel, to plan for a direction of the sun may take longer than it saves."""


def where_alignment_stands(kept):
    """Rays and scenes a row: how many times as fast as packets aligned packets are at their best split, and the
    rasteriser. Scenes go by the interval of the former: above one, around it, below it. kept: that of sweep=methods."""
    every = _gains_of_scenes(of(in_packets(_kept("gather").points), what="count"))
    tables = (of(one.points, workload="frame") for one in (kept, _kept("methods_families")))
    nearest = _largest_first(gains for table in tables for gains in _gains_of_scenes(table))
    sun = of(_kept("bake_rays").points, use="sun")
    in_the_box = sun["scene"].eq("cornell_box")
    many, deep = sun[in_the_box & sun["positions"].ge(_ENOUGH_POSITIONS)], sun[~in_the_box]
    assert _places(many, "packets_over_aligned") == _places(many, "single_over_aligned") == {_AHEAD}
    assert _places(deep, "packets_over_aligned") == {_BEHIND}
    yield _to_the_sun(_FASTEST, f", {_ENOUGH_POSITIONS} or more a texel", many)
    for place in (_AHEAD, _LEVEL, _BEHIND):
        for rays, found in (("all hits", every), ("nearest hit", nearest)):
            there = [both for both in found if _place(both[0]) == place]
            if there:
                yield _row(place, rays, there)
    yield _to_the_sun(_BEHIND, "", deep)


def _kept(sweep):
    return kept_in(REFERENCE / sweep)


def _gains_of_scenes(table):
    """For each scene that has both, the best row of aligned packets, and that of the rasteriser, which is faster."""
    scenes = [scene for scene in table["scene"].unique() if len(of(table, scene=scene, method="aligned"))]
    found = [tuple(best(table, scene=scene, method=name) for name in ("aligned", "raster")) for scene in scenes]
    assert all(aligned["speedup_vs_packets"] < raster["speedup_vs_packets"] for aligned, raster in found)
    return _largest_first(found)


def _largest_first(found):
    return sorted(found, key=lambda both: -both[0]["speedup_vs_packets"])


def _places(rows, column):
    return {_place(row, column) for _, row in rows.iterrows()}


def _place(aligned, column="speedup_vs_packets"):
    gain = Interval(*(aligned[f"{column}{end}"] for end in ("", "_low", "_high")))
    return {True: _AHEAD, None: _LEVEL, False: _BEHIND}[decide_greater(gain)]


def _row(place, rays, found):
    gains = (span(row["speedup_vs_packets"] for row in rows) for rows in zip(*found, strict=True))
    return table_row(place, rays, _scenes(aligned["scene"] for aligned, _ in found), *gains)


def _to_the_sun(place, rays, rows):
    scenes = _scenes(rows["scene"].unique())
    return table_row(place, f"to the sun{rays}", scenes, span(rows["packets_over_aligned"]), "")


def _scenes(names):
    return ", ".join(f"`{name}`" for name in names)
