"""What docs/trust.md quotes of sweep=agreement."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd

from experiments.documents.quotation import SCENES, Kept, power_of_ten, table_row
from experiments.methods import find_method

_SUMMED = "^(pixels|images$|rays_|method_|baseline_wrong|sampled_)"


def kind_of(row: Any) -> Any:
    label = find_method(row["method"]).label
    if pd.isna(row["culling"]) or pd.isna(row["geometry"]):
        return f"{label} of {row['packet_width']}" if row["method"] == "pixel" else label
    if row["geometry"] == "instanced":
        return f"{label}, instanced"
    return f"{label}, culling {'on' if row['culling'] else 'off'}"


def sums(table: Any, by: Any) -> Any:
    table = table.assign(
        kind=[kind_of(row) for _, row in table.iterrows()], pixels=table.filter(regex="^pixels_").sum(axis=1)
    )
    summed = dict.fromkeys(table.filter(regex=_SUMMED), "sum")
    largest = dict.fromkeys(("depth_error_max", "baseline_depth_error_max"), "max")
    return table.groupby(by, sort=False).agg(summed | largest)


def by_kind(kept: Kept) -> Iterable[str]:
    for kind, row in sums(kept.points, ["kind"]).iterrows():
        assert row["pixels_wrong"] == 0
        yield table_row(
            kind,
            int(row["images"]),
            f"{row['pixels'] / 1e6:.1f} M",
            f"{int(row['pixels_tied']):,}",
            f"{int(row['pixels_edge']):,}",
            f"{int(row['method_wrong']):,} : {int(row['baseline_wrong']):,}",
            f"{int(row['sampled_method_wrong'])} : {int(row['sampled_baseline_wrong'])}",
            power_of_ten(row["depth_error_max"]),
            power_of_ten(row["baseline_depth_error_max"]),
        )


def in_all(kept: Kept) -> Iterable[str]:
    table = kept.points
    totals, by_scene = table.sum(numeric_only=True), sums(table, ["scene"])
    errors = {scene: f"{row['method_wrong']:,.0f} : {row['baseline_wrong']:,.0f}" for scene, row in by_scene.iterrows()}
    names = [*SCENES, *(name for name in errors if name not in SCENES)]
    yield f"{totals['images']:.0f} images, {by_scene['pixels'].sum() / 1e6:.0f} million pixels"
    yield f"*Wrong* is {totals['pixels_wrong']:.0f} in all {totals['images']:.0f} images"
    yield f"at most {(table['depth_error_max'] / table['baseline_depth_error_max']).max():.1f} times"
    yield (
        f"Of {totals['rays_sampled']:,.0f} sampled rays the methods are wrong at "
        f"{totals['sampled_method_wrong']:.0f}, `rtcIntersect1` at {totals['sampled_baseline_wrong']:.0f}"
    )
    yield ", ".join(f"{name} {errors[name]}" for name in names if name != "mitsuba")
    yield f"On mitsuba it is {errors['mitsuba']}"


def of_the_rasteriser(kept: Kept) -> Iterable[str]:
    totals = kept.points.sum(numeric_only=True)
    pixels = totals.filter(regex="^pixels_").sum() / 1e6
    own, single = (f"{totals[name]:.0f}" for name in ("method_wrong", "baseline_wrong"))
    yield f"{totals['images']:.0f} images, {pixels:.0f} million pixels: *wrong* is {totals['pixels_wrong']:.0f}"
    yield f"where they differ, float64 finds the rasteriser wrong at {own} and `rtcIntersect1` at {single}"
    largest, theirs = (kept.points[name].max() for name in ("depth_error_max", "baseline_depth_error_max"))
    yield f"{power_of_ten(largest)}, of `rtcIntersect1` {power_of_ten(theirs)}"
