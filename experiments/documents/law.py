"""What the pages quote of the law."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from experiments.documents.quotation import TIMES, Kept, digits, table_row
from experiments.law.fit import choices_of, errors_of, named_if_known
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.formulas import IN_CACHE

SETS = ("avx512", "avx2")
WORDS = {"nearest": "nearest hit", "count": "all hits"}


def percent(value: Any) -> Any:
    return f"{100 * value:.0f} %"


def errors_of_methods(kept: Kept) -> Iterable[str]:
    """Median and ninth decile of the errors of frame times: all, then each family."""
    table = kept.points
    names = {"all frames": table["family"].notna()}
    for name in dict.fromkeys(table["family"]):
        method, want = name.split("|")
        said = "all hits" if want == "all" else "nearest hit"
        names[f"{method.replace('_', '-')}, {said}"] = table["family"] == name
    for label, chosen in names.items():
        cells = []
        for isa in SETS:
            errors = errors_of(table[chosen & (table["instruction_set"] == isa)])
            cells += [percent(errors.median()), percent(errors.quantile(0.9))]
        yield table_row(label, *cells)


def errors_in_short(kept: Kept) -> Iterable[str]:
    yield from list(errors_of_methods(kept))[:1]


def choices_in_short(kept: Kept) -> Iterable[str]:
    yield from list(choices_of_methods(kept))[:4]


def choices_of_methods(kept: Kept) -> Iterable[str]:
    for isa in SETS:
        for want, said in WORDS.items():
            for without in ((), ("raster",)):
                rows = kept.points[kept.points["instruction_set"] == isa]
                found = choices_of(rows, want, without)
                yield table_row(
                    f"{isa}, {said}{', rasteriser apart' if without else ''}", found["views"],
                    *(percent(found[one]) for one in ("named", "raster", "visible_first", "median", "decile")),
                )  # fmt: skip


def rest_of_the_law(kept: Kept) -> Iterable[str]:
    by_set = [kept.points[kept.points["instruction_set"] == isa] for isa in SETS]
    views = [rows.drop_duplicates(["scene", "view"]) for rows in by_set]
    yield table_row("scenes and views", *(f"{one['scene'].nunique()}, {len(one)}" for one in views))
    nearest = [rows[rows["want"] == "nearest"] for rows in by_set]
    bytes_, builds = (
        [(one[f"predicted_{name}"] / one[f"measured_{name}"] - 1).abs() for one in nearest]
        for name in ("bytes", "build_s")
    )
    within = (f"{percent(one.median())}, {percent((one <= 0.1).mean())}" for one in bytes_)
    yield table_row("bytes: median error, and rows within 10 %", *within)
    said = (f"{percent(one.median())}, {percent(one.quantile(0.9))}" for one in builds)
    yield table_row("plan and build: median error, and nine of ten", *said)
    known = (percent(named_if_known(rows)) for rows in by_set)
    yield table_row("named, rasteriser apart, were mean errors in views known", *known)
    yield table_row(
        "raster frames of a look, median", *(f"{(one['look_s'] / one['frame_s']).median():.0f}" for one in views)
    )


def _alignment(kept: Kept, want: Any) -> Any:
    """For each view, gains of the best aligned packets over packets per pixel, measured and predicted, and the row."""
    rows = kept.points[(kept.points["instruction_set"] == "avx512") & (kept.points["want"] == want)]
    rows = rows[rows["packet_width"] == 16]
    for (scene, view), of in rows.groupby(["scene", "view"]):
        packets, aligned = of[of["method"] == "pixel"].iloc[0], of[of["method"] == "aligned"]
        if len(aligned) < 4:  # scenes of millions of triangles have two splits only
            continue
        best = aligned.loc[aligned["measured_time_s"].idxmin()]
        predicted = packets["predicted_time_s"] / aligned["predicted_time_s"].min()
        yield scene, view, packets["measured_time_s"] / best["measured_time_s"], predicted, best


def where_alignment_pays(kept: Kept) -> Iterable[str]:
    for want, said in WORDS.items():
        found = list(_alignment(kept, want))
        gains, predicted = np.array([one[2] for one in found]), np.array([one[3] for one in found])
        top = found[int(gains.argmax())]
        yield table_row(
            said, len(found), int((gains > 1).sum()), digits(gains.max()), f"`{top[0]}`, {top[4]['split_x']} {TIMES} "
            f"{top[4]['split_y']}", int(((gains > 1) == (predicted > 1)).sum()),
        )  # fmt: skip


def best_axes(kept: Kept) -> Iterable[str]:
    splits = [(one[4]["split_x"] > 1, one[4]["split_y"] > 1) for one in _alignment(kept, "nearest")]
    wanted = ((True, False), (False, True), (True, True), (False, False))
    yield table_row(*(splits.count(one) for one in wanted))


def seven_and_a_half(kept: Kept) -> Iterable[str]:
    """Nanoseconds a pixel of aligned single rays on the Cornell box by the law, and what the paper's gain asks for."""
    rows = kept.points[(kept.points["instruction_set"] == "avx512") & (kept.points["scene"] == "cornell_box")]
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
    yield table_row(*map(digits, (*parts, sum(parts), per_ray, per_ray / 7.5)))


def rays_of_tiles(kept: Kept) -> Iterable[str]:
    """For each way to trace rays to the sun the errors of its time, and how often it is the fastest, and named."""
    rows, ways = kept.points, ("aligned", "packets", "single")
    fastest = {
        what: rows[[f"{what}_{way}_s" for way in ways]].idxmin(axis=1).str.split("_").str[1]
        for what in ("measured", "predicted")
    }
    for way in ways:
        errors = (rows[f"predicted_{way}_s"] / rows[f"measured_{way}_s"] - 1).abs()
        is_fastest = fastest["measured"] == way
        named = is_fastest & (fastest["predicted"] == way)
        yield table_row(
            f"{way} rays" if way != "packets" else way, percent(errors.median()), percent(errors.quantile(0.9)),
            f"{is_fastest.sum()} of {len(rows)}", int(named.sum()),
        )  # fmt: skip
