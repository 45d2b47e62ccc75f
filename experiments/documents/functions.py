"""Rows of tables that no description in TOML says. A function takes a sweep, and gives the cells of each row."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from typing import Any

import pandas as pd

from experiments.documents.filling import REFERENCE, SCENES, TIMES, digits, kept_of, say, span
from experiments.documents.law import LAW_TABLES, Rows
from experiments.light.equal_error.measure import BEFORE, FAST, MITSUBA, OURS
from experiments.methods import find_method
from experiments.paper.conclusion import scene_gains
from experiments.results.queries import chosen
from experiments.results.statistics import Estimate, Interval, Pool
from experiments.results.verdicts import decide_greater
from experiments.studies.candidates import Candidate, candidates
from experiments.studies.paired import ratios
from experiments.workloads.frame.shown import best_baselines
from experiments.workloads.series import best_rows

_ENOUGH_POSITIONS = 16
"""With fewer positions in a texel, to plan for a direction of the sun may take longer than it saves."""


def _points(sweep: str, **where: Any) -> pd.DataFrame:
    points = kept_of(sweep).points
    return points[chosen(points, {"status": "ok"} | where)]


def kept_cells(sweep: str) -> Rows:
    """Rows that a function of an older commit made of the table; the README of the stored tables names it."""
    with (REFERENCE / sweep / "cells.csv").open(encoding="utf-8", newline="") as file:
        yield from csv.reader(file)


def best_packets(sweep: str) -> Rows:
    for best in best_baselines(kept_of(sweep).processes):
        words = "more than noise" if best.is_faster else "no more than noise"
        margin = "too few processes" if best.margin is None else f"{best.margin}"
        yield f"`{best.scene}`", best.tried, best.name, margin, words


def this_and_before(sweep: str) -> Rows:
    """How many times as fast this version is as the other one, by what was asked, on each scene with its interval."""
    gains = ratios(kept_of(sweep).points).set_index(["instruction_set", "threads", "what", "scene"])["ratio"]
    known = [key for key in gains.index if key[3] in SCENES]
    for instruction_set, threads, what in dict.fromkeys(key[:3] for key in known):
        cells = (gains.get((instruction_set, threads, what, scene), "") for scene in SCENES)
        yield f"{what.replace('_', ' ')}, {instruction_set}", threads, *cells


def small_triangles_before(sweep: str) -> Rows:
    """Triangles, images and packets as in `this_and_before`, and how many times as fast as packets an image is now."""
    table = kept_of(sweep).points
    gains = ratios(table).set_index(["scene", "what"])["ratio"]
    for scene, rows in table[~table["scene"].isin(SCENES)].groupby("scene"):
        ms = rows[rows["version"] == "this"].groupby("what")["median_ms"].median()
        cells = (gains[scene, what] for what in ("image", "packets"))
        yield f"`{scene}`", f"{rows['triangles'].iloc[0]:,}", *cells, digits(ms["packets"] / ms["image"])


def through_lenses(sweep: str) -> Rows:
    """Packets' time with a lens over without, and over the rasteriser's; a BOP frame over llvmpipe's."""
    points = kept_of(sweep).points
    ms = points[points["threads"] == 1].groupby(["frame", "method", "lens"], dropna=False)["ms"].median()
    for label, above, below in (
        ("packets: through a lens ÷ without", "packets", "packets without lens"),
        (f"rasteriser: {TIMES} packets", "packets", "raster"),
    ):
        yield label, *(span(pd.Series(ms[scene, above] / ms[scene, below])) for scene in SCENES), ""
    gain = ms["bop", "llvmpipe"].iloc[0] / ms["bop", "atra"].iloc[0]
    yield "rasteriser: times as fast as OpenGL on llvmpipe", "", "", "", "", digits(float(gain))


def worth_of_the_shortcut(sweep: str) -> Rows:
    """Rays to the sun, aligned: over packets with the shortcut and without it, and the one over the other."""
    processes = kept_of(sweep).processes
    for scene in ("cornell_box", "sponza"):
        where = {"status": "ok", "workload": "bake_rays", "scene": scene}
        values = [
            processes[chosen(processes, where | {"shortcut": how})]["packets_over_aligned"].astype(float).tolist()
            for how in (True, False)
        ]
        pool = Pool.of(values)
        with_it, without = (Estimate.of(samples, pool) for samples in values)
        yield f"`{scene}`", say(with_it), say(without), say(with_it.over(without))


def best_gains(sweep: str) -> Rows:
    """The paper's gain, those of single rays under each reading of its baseline, and that of packets over packets."""

    def gain_and_split(gain: Any) -> str:
        return "none" if gain.best is None else f"{gain.best.gain} ({gain.best.splits:,} {TIMES} 1)"

    for of_scene in scene_gains(kept_of(sweep).processes):
        packets = gain_and_split(next(iter(of_scene.packets.values()))) if of_scene.packets else "none"
        paper = "" if of_scene.paper is None else f"{of_scene.paper:.2f}"
        yield f"`{of_scene.scene}`", paper, *map(gain_and_split, of_scene.single.values()), packets


def _candidate_row(candidate: Candidate) -> tuple[Any, ...]:
    gains = ("" if gain is None else gain for gain in (candidate.nearest, candidate.all_hits))
    return (candidate.name, *gains, candidate.reaches)


def candidates_for_the_gain(sweep: str) -> Rows:
    """Gains over the nearest hit and over all hits, and whether one is as large as the paper's."""
    return map(_candidate_row, candidates(kept_of(sweep).processes))


def equal_error(sweep: str) -> Rows:
    """Seconds to a relative error of 5 % by scene, threads and renderer; times over the faster one of Mitsuba's; and
    how far apart the means of blocks are."""
    for (scene, threads), of_scene in kept_of(sweep).points.groupby(["scene", "threads"], sort=False):
        rows = of_scene.set_index("renderer")
        times = rows["time_to_5%_s"]
        shown = [digits(times[name]) if name in times else "" for name in (OURS, FAST, BEFORE, *MITSUBA)]
        theirs = [name for name in MITSUBA if name in times]
        over = (digits(times[name] / min(times[theirs])) for name in (OURS, FAST))
        yield scene, threads, *shown, *over, f"{100 * rows.loc[theirs, 'blocks_apart'].min():.1f} %"


_SUMMED = "^(pixels|images$|rays_|method_|baseline_wrong|sampled_)"


def images_judged(sweep: str) -> Rows:
    """A kind of image a row, then a scene: who is wrong how often, and the largest errors of depths."""

    def kind_of(row: Any) -> str:
        label = find_method(row["method"]).label
        if pd.isna(row["culling"]) or pd.isna(row["geometry"]):
            return f"{label} of {row['packet_width']}" if row["method"] == "pixel" else label
        if row["geometry"] == "instanced":
            return f"{label}, instanced"
        return f"{label}, culling {'on' if row['culling'] else 'off'}"

    points = kept_of(sweep).points
    pixels = points.filter(regex="^pixels_").sum(axis=1)
    points = points.assign(kind=[kind_of(row) for _, row in points.iterrows()], pixels=pixels)
    sums = dict.fromkeys(points.filter(regex=_SUMMED), "sum")
    largest = dict.fromkeys(("depth_error_max", "baseline_depth_error_max"), "max")
    for by in ("kind", "scene"):
        for label, row in points.groupby(by, sort=False).agg(sums | largest).iterrows():
            yield (
                label if by == "kind" else f"`{label}`", int(row["images"]), f"{row['pixels'] / 1e6:.1f} M",
                *(f"{int(row[name]):,}" for name in ("pixels_wrong", "pixels_tied", "pixels_edge")),
                f"{int(row['method_wrong']):,} : {int(row['baseline_wrong']):,}",
                f"{int(row['sampled_method_wrong'])} : {int(row['sampled_baseline_wrong'])}",
                f"{row['depth_error_max']:.1e}", f"{row['baseline_depth_error_max']:.1e}",
            )  # fmt: skip


def where_alignment_stands(sweep: str) -> Rows:
    """Rays and scenes a row: how many times as fast as packets aligned packets are at their best split, and the
    rasteriser. Scenes go by the interval of the former: above one, around it, below it. sweep: that of methods."""
    gather = _points("gather", what="count")
    every = _gains_of_scenes(gather[gather["method"].ne("aligned") | gather["packet_width"].gt(1).fillna(False)])
    nearest = [
        both for name in (sweep, "methods_families") for both in _gains_of_scenes(_points(name, workload="frame"))
    ]
    nearest.sort(key=lambda both: -both[0]["speedup_vs_packets"])
    sun = _points("bake_rays", use="sun")
    in_the_box = sun["scene"].eq("cornell_box")
    many, deep = sun[in_the_box & sun["positions"].ge(_ENOUGH_POSITIONS)], sun[~in_the_box]
    over = "packets_over_aligned"
    assert {_place(row, over) for _, row in many.iterrows()} == {_AHEAD}
    assert {_place(row, over) for _, row in deep.iterrows()} == {_BEHIND}
    yield "fastest", f"to the sun, {_ENOUGH_POSITIONS} or more a texel", "`cornell_box`", span(many[over]), ""
    for place in (_AHEAD, _LEVEL, _BEHIND):
        for rays, gains in (("all hits", every), ("nearest hit", nearest)):
            there = [both for both in gains if _place(both[0]) == place]
            if there:
                ranges = (span(row["speedup_vs_packets"] for row in rows) for rows in zip(*there, strict=True))
                yield place, rays, ", ".join(f"`{aligned['scene']}`" for aligned, _ in there), *ranges
    yield _BEHIND, "to the sun", ", ".join(f"`{name}`" for name in deep["scene"].unique()), span(deep[over]), ""


_AHEAD, _LEVEL, _BEHIND = "ahead of packets only", "level with packets", "behind packets"


def _place(row: Any, column: str = "speedup_vs_packets") -> str:
    gain = Interval(*(row[f"{column}{end}"] for end in ("", "_low", "_high")))
    return {True: _AHEAD, None: _LEVEL, False: _BEHIND}[decide_greater(gain)]


def _gains_of_scenes(points: pd.DataFrame) -> list[Any]:
    """For each scene that has both, the best row of aligned packets, and that of the rasteriser, which is faster."""

    def rows() -> Iterator[Any]:
        for scene in points["scene"].unique():
            named = (points[chosen(points, {"scene": scene, "method": name})] for name in ("aligned", "raster"))
            both = [best_rows(rows) for rows in named]
            if all(map(len, both)):
                yield tuple(rows.iloc[0] for rows in both)

    gains = sorted(rows(), key=lambda both: -both[0]["speedup_vs_packets"])
    assert all(aligned["speedup_vs_packets"] < raster["speedup_vs_packets"] for aligned, raster in gains)
    return gains


FUNCTIONS: dict[str, Callable[[str], Rows]] = LAW_TABLES | {
    made.__name__: made
    for made in (
        kept_cells, best_packets, this_and_before, small_triangles_before, through_lenses,
        worth_of_the_shortcut, best_gains, candidates_for_the_gain, equal_error, images_judged,
        where_alignment_stands,
    )
}  # fmt: skip
