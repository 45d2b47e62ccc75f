"""Where alignment is fastest, ahead or behind, from several sweeps; and what each part of our methods is worth."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from experiments.documents.quotation import (
    REFERENCE,
    SCENES,
    TIMES,
    Kept,
    best,
    estimate,
    interval,
    kept_in,
    of,
    say,
    span,
    table_row,
)
from experiments.documents.rays import in_packets
from experiments.results.statistics import Estimate, Interval, Pool
from experiments.results.verdicts import decide_greater
from experiments.workloads.series import best_rows

_FASTEST, _AHEAD, _LEVEL, _BEHIND = "fastest", "ahead of packets only", "level with packets", "behind packets"
_ENOUGH_POSITIONS = 16
"""With fewer positions in a texel, to plan for a direction of the sun may take longer than it saves."""


def where_alignment_stands(kept: Kept) -> Iterable[str]:
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


def _kept(sweep: Any) -> Any:
    return kept_in(REFERENCE / sweep)


def _gains_of_scenes(table: Any) -> Any:
    """For each scene that has both, the best row of aligned packets, and that of the rasteriser, which is faster."""
    scenes = [scene for scene in table["scene"].unique() if len(of(table, scene=scene, method="aligned"))]
    found = [tuple(best(table, scene=scene, method=name) for name in ("aligned", "raster")) for scene in scenes]
    assert all(aligned["speedup_vs_packets"] < raster["speedup_vs_packets"] for aligned, raster in found)
    return _largest_first(found)


def _largest_first(found: Any) -> Any:
    return sorted(found, key=lambda both: -both[0]["speedup_vs_packets"])


def _places(rows: Any, column: Any) -> Any:
    return {_place(row, column) for _, row in rows.iterrows()}


def _place(aligned: Any, column: Any = "speedup_vs_packets") -> Any:
    gain = Interval(*(aligned[f"{column}{end}"] for end in ("", "_low", "_high")))
    return {True: _AHEAD, None: _LEVEL, False: _BEHIND}[decide_greater(gain)]


def _row(place: Any, rays: Any, found: Any) -> Any:
    gains = (span(row["speedup_vs_packets"] for row in rows) for rows in zip(*found, strict=True))
    return table_row(place, rays, _scenes(aligned["scene"] for aligned, _ in found), *gains)


def _to_the_sun(place: Any, rays: Any, rows: Any) -> Any:
    scenes = _scenes(rows["scene"].unique())
    return table_row(place, f"to the sun{rays}", scenes, span(rows["packets_over_aligned"]), "")


def _scenes(names: Any) -> Any:
    return ", ".join(f"`{name}`" for name in names)


_ALIGNED = {"method": "aligned", "split_x": 128}
_HIDDEN = {"method": "raster", "left_out": "hidden"}
_SCENES_OF_THE_SUN = ("cornell_box", "sponza")


def worth_of_parts(kept: Kept) -> Iterable[str]:
    """A part a row: speed with it over speed without it, and what is left over packets where that says more."""
    frames = _Frames(kept)
    yield frames.over_packets("culled tiles without alignment", method="tiles")
    yield frames.over_packets(f"visible-first, 1 {TIMES} 1", method="visible_first", split_x=1)
    yield frames.best_over_packets("visible-first, best split", method="visible_first")
    for width in (1, frames.widest):
        one = _ALIGNED | {"packet_width": width, "robust": False}
        yield frames.over_first_cell(f"our reference rays ÷ the first cell's, {_rays(width)}", one)
    fast = _ALIGNED | {"packet_width": frames.widest, "reference": "off_axis"}
    yield frames.ratio("fast ÷ robust, aligned packets", fast | {"robust": False}, fast | {"robust": True})
    yield frames.over_packets("robust packets per pixel", method="pixel", robust=True)
    narrow = {lanes: {"method": "raster", "left_out": "hidden", "lanes": str(lanes)} for lanes in (4, 8)}
    for label, without in (
        ("rasteriser ÷ without occlusion", {"method": "raster", "left_out": "outside"}),
        ("rasteriser ÷ without clusters", {"method": "raster", "left_out": "none"}),
        *((f"rasteriser ÷ with {lanes} lanes", one) for lanes, one in narrow.items()),
    ):
        yield frames.ratio(label, _HIDDEN, without)


def our_reference_rays(kept: Kept) -> Iterable[str]:
    """A setting a row: speed with our reference rays over speed with those of the first cell."""
    frames = _Frames(kept)
    for culling, split, width in (
        (False, 16, 1),
        *((True, split, width) for split in (16, 128) for width in (1, frames.widest)),
    ):
        label = f"{_rays(width)}, {split} {TIMES} 1{'' if culling else ', culling off'}"
        one = {"method": "aligned", "culling": culling, "split_x": split, "packet_width": width}
        yield frames.over_first_cell(label, one)


def worth_of_the_shortcut(kept: Kept) -> Iterable[str]:
    """Rays to the sun, aligned: over packets with the shortcut and without it, and the one over the other."""
    rows = of(kept.processes, workload="bake_rays")
    for scene in _SCENES_OF_THE_SUN:
        with_it, without = (
            of(rows, scene=scene, shortcut=how)["packets_over_aligned"].astype(float).tolist() for how in (True, False)
        )
        pool = Pool.of([with_it, without])
        one, other = Estimate.of(with_it, pool), Estimate.of(without, pool)
        yield table_row(f"`{scene}`", say(one), say(other), say(one.over(other)))


class _Frames:
    """Rows of frames, single points by their options."""

    def __init__(self, kept: Kept) -> None:
        self._points, self._processes = of(kept.points, workload="frame"), of(kept.processes, workload="frame")
        self.widest = int(self._points["packet_width"].max())

    def over_packets(self, label: Any, **values: Any) -> Any:
        return table_row(label, *(say(self._speed(scene, values)) for scene in SCENES))

    def best_over_packets(self, label: Any, **values: Any) -> Any:
        found = [best_rows(of(self._points, scene=scene, **values)) for scene in SCENES]
        return table_row(label, *(interval(rows.iloc[0], "speedup_vs_packets") for rows in found))

    def ratio(self, label: Any, one: Any, other: Any) -> Any:
        return table_row(label, *(say(self._speed(scene, one).over(self._speed(scene, other))) for scene in SCENES))

    def over_first_cell(self, label: Any, values: Any) -> Any:
        """Speed with our reference rays over speed with those of the first cell."""
        return self.ratio(label, values | {"reference": "off_axis"}, values | {"reference": "first_cell"})

    def _speed(self, scene: Any, values: Any) -> Any:
        """Over packets in the same rounds. Lanes that are not named are the machine's."""
        rows = of(self._processes, scene=scene, **values)
        if values["method"] == "raster" and "lanes" not in values:
            rows = rows[rows["lanes"].eq("native")]
        assert rows["point_id"].nunique() == 1, (scene, values)
        return estimate(rows, "speedup_vs_packets")


def _rays(width: Any) -> Any:
    return "single rays" if width == 1 else "packets"


def sun_in_short(kept: Kept) -> Iterable[str]:
    """Aligned rays to the sun on the Cornell box over coherent packets, with the shortcut and without."""
    row = next(line for line in worth_of_the_shortcut(kept) if "`cornell_box`" in line)
    with_it, without_it = (cell.split()[0] for cell in row.split("|")[2:4])
    yield f"{with_it} with it, {without_it} without it"
