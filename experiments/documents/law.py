"""Rows of the tables of the law; `experiments.documents.functions` says what such a function is."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from experiments.documents.filling import TIMES, digits, kept_of
from experiments.law.fit import choices_of, errors_of, named_if_known
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.formulas import IN_CACHE

SETS = ("avx512", "avx2")
WORDS = {"nearest": "nearest hit", "count": "all hits"}
Rows = Iterable[Iterable[Any]]


def percent(value: Any) -> str:
    return f"{100 * value:.0f} %"


def errors_of_methods(sweep: str) -> Rows:
    """Median and ninth decile of the errors of frame times: all, then each family."""
    table = kept_of(sweep).points
    names = {"all frames": table["family"].notna()}
    for name in dict.fromkeys(table["family"]):
        method, want = name.split("|")
        names[f"{method.replace('_', '-')}, {'all hits' if want == 'all' else 'nearest hit'}"] = table["family"] == name
    for label, chosen in names.items():
        every = [errors_of(table[chosen & (table["instruction_set"] == isa)]) for isa in SETS]
        yield label, *(percent(value) for errors in every for value in (errors.median(), errors.quantile(0.9)))


def choices_of_methods(sweep: str) -> Rows:
    table = kept_of(sweep).points
    for isa in SETS:
        for want, words in WORDS.items():
            for without in ((), ("raster",)):
                shares = choices_of(table[table["instruction_set"] == isa], want, without)
                told = (percent(shares[name]) for name in ("named", "raster", "visible_first", "median", "decile"))
                yield f"{isa}, {words}{', rasteriser apart' if without else ''}", shares["views"], *told


def rest_of_the_law(sweep: str) -> Rows:
    table = kept_of(sweep).points
    by_set = [table[table["instruction_set"] == isa] for isa in SETS]
    views = [rows.drop_duplicates(["scene", "view"]) for rows in by_set]
    yield "scenes and views", *(f"{rows['scene'].nunique()}, {len(rows)}" for rows in views)
    nearest = [rows[rows["want"] == "nearest"] for rows in by_set]
    sizes, builds = (
        [(rows[f"predicted_{name}"] / rows[f"measured_{name}"] - 1).abs() for rows in nearest]
        for name in ("bytes", "build_s")
    )
    within = (f"{percent(errors.median())}, {percent((errors <= 0.1).mean())}" for errors in sizes)
    yield "bytes: median error, and rows within 10 %", *within
    deciles = (f"{percent(errors.median())}, {percent(errors.quantile(0.9))}" for errors in builds)
    yield "plan and build: median error, and nine of ten", *deciles
    known = (percent(named_if_known(rows)) for rows in by_set)
    yield "named, rasteriser apart, were mean errors in views known", *known
    yield "raster frames of a look, median", *(f"{(rows['look_s'] / rows['frame_s']).median():.0f}" for rows in views)


def _gains(sweep: str, want: str) -> Iterable[Any]:
    """For each view, gains of the best aligned packets over ray packets, measured and predicted, and the row."""
    rows = kept_of(sweep).points
    rows = rows[(rows["instruction_set"] == "avx512") & (rows["want"] == want) & (rows["packet_width"] == 16)]
    for (scene, _), of_view in rows.groupby(["scene", "view"]):
        packets, aligned = of_view[of_view["method"] == "pixel"].iloc[0], of_view[of_view["method"] == "aligned"]
        if len(aligned) < 4:  # scenes of millions of triangles have two splits only
            continue
        best = aligned.loc[aligned["measured_time_s"].idxmin()]
        predicted = packets["predicted_time_s"] / aligned["predicted_time_s"].min()
        yield scene, packets["measured_time_s"] / best["measured_time_s"], predicted, best


def where_alignment_pays(sweep: str) -> Rows:
    for want, words in WORDS.items():
        views = list(_gains(sweep, want))
        gains, predicted = (np.array([view[place] for view in views]) for place in (1, 2))
        scene, _, _, top = views[int(gains.argmax())]
        rightly = int(((gains > 1) == (predicted > 1)).sum())
        split = f"`{scene}`, {top['split_x']} {TIMES} {top['split_y']}"
        yield words, len(views), int((gains > 1).sum()), digits(gains.max()), split, rightly


def best_axes(sweep: str) -> Rows:
    splits = [(best["split_x"] > 1, best["split_y"] > 1) for *_, best in _gains(sweep, "nearest")]
    yield [splits.count(axes) for axes in ((True, False), (False, True), (True, True), (False, False))]


def seven_and_a_half(sweep: str) -> Rows:
    """Nanoseconds a pixel of aligned single rays on the Cornell box by the law, and what the paper's gain asks for."""
    rows = kept_of(sweep).points
    rows = rows[(rows["instruction_set"] == "avx512") & (rows["scene"] == "cornell_box")]
    rows = rows[(rows["view"] == "own") & (rows["want"] == "nearest") & (rows["packet_width"] == 1)]
    single = rows[rows["method"] == "pixel"].iloc[0]
    aligned = rows[(rows["method"] == "aligned") & (rows["split_x"] == 128)].iloc[0]
    pixels = aligned["width"] * aligned["height"]
    shot, box, tested, hit, copy, _, again = DEFAULTS["avx512"]["aligned single|nearest"]
    entered = aligned["upper"] + aligned["lower"] + aligned["tested"]
    assert 128 * 4 * entered < IN_CACHE  # four rays in a row of a cell
    parts = (
        shot * (1 + aligned["upper"]) / 128, box * aligned["lower"], tested * aligned["tested"], hit * aligned["met"],
        copy * aligned["predicted_copies"] / pixels + again * aligned["predicted_again"] * entered,
    )  # fmt: skip
    per_ray = single["measured_time_s"] / pixels * 1e9
    yield map(digits, (*parts, sum(parts), per_ray, per_ray / 7.5))


LAW_TABLES: dict[str, Callable[[str], Rows]] = {
    made.__name__: made
    for made in (
        errors_of_methods, choices_of_methods, rest_of_the_law, where_alignment_pays, best_axes, seven_and_a_half,
    )
}  # fmt: skip
