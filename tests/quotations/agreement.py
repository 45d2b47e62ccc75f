"""What docs/trust.md quotes of sweep=agreement."""

from __future__ import annotations

import pandas as pd

from experiments.methods import METHODS
from tests.quotations.quotation import SCENES, Kept, Quoted, power_of_ten, table_row

_LABELS = {method.name: method.label for method in METHODS}
_SUMMED = "^(pixels|images$|rays_|method_|baseline_wrong|sampled_)"


def kind_of(row: pd.Series) -> str:
    if pd.isna(row["culling"]) or pd.isna(row["geometry"]):
        width = f" of {row['packet_width']}" if row["method"] == "pixel" else ""
        return f"{_LABELS[row['method']]}{width}"
    if row["geometry"] == "instanced":
        return f"{_LABELS[row['method']]}, instanced"
    return f"{_LABELS[row['method']]}, culling {'on' if row['culling'] else 'off'}"


def sums(table: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    table = table.assign(
        kind=[kind_of(row) for _, row in table.iterrows()], pixels=table.filter(regex="^pixels_").sum(axis=1)
    )
    summed = dict.fromkeys(table.filter(regex=_SUMMED), "sum")
    largest = dict.fromkeys(("depth_error_max", "baseline_depth_error_max"), "max")
    return table.groupby(by, sort=False).agg(summed | largest)


def by_kind(kept: Kept) -> Quoted:
    rows = []
    for kind, row in sums(kept.points, ["kind"]).iterrows():
        assert row["pixels_wrong"] == 0
        rows.append(
            table_row(
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
        )
    return Quoted(rows=tuple(rows))


def in_all(kept: Kept) -> Quoted:
    table = kept.points
    totals, by_scene = table.sum(numeric_only=True), sums(table, ["scene"])
    errors = {scene: f"{row['method_wrong']:,.0f} : {row['baseline_wrong']:,.0f}" for scene, row in by_scene.iterrows()}
    depths = table["depth_error_max"] / table["baseline_depth_error_max"]
    pixels = table.filter(regex="^pixels_").to_numpy().sum()
    names = [*SCENES, *(name for name in errors if name not in SCENES)]
    return Quoted(
        phrases=(
            f"{totals['images']:.0f} images, {pixels / 1e6:.0f} million pixels",
            f"*Wrong* is {totals['pixels_wrong']:.0f} in all {totals['images']:.0f} images",
            f"at most {depths.max():.1f} times",
            f"Of {totals['rays_sampled']:,.0f} sampled rays the methods are wrong at "
            f"{totals['sampled_method_wrong']:.0f}, `rtcIntersect1` at {totals['sampled_baseline_wrong']:.0f}",
            ", ".join(f"{name} {errors[name]}" for name in names if name != "mitsuba"),
            f"On mitsuba it is {errors['mitsuba']}",
            f"Sponza's ties are {by_scene.loc['sponza', 'pixels_tied']:.0f}",
        )
    )


def of_the_rasteriser(kept: Kept) -> Quoted:
    totals = kept.points.sum(numeric_only=True)
    pixels = kept.points.filter(regex="^pixels_").sum().sum() / 1e6
    own, single = (f"{totals[name]:.0f}" for name in ("method_wrong", "baseline_wrong"))
    return Quoted(
        phrases=(
            f"{totals['images']:.0f} images, {pixels:.0f} million pixels: *wrong* is {totals['pixels_wrong']:.0f}",
            f"where they differ, float64 finds the rasteriser wrong at {own} and `rtcIntersect1` at {single}",
            f"{power_of_ten(kept.points['depth_error_max'].max())}, of `rtcIntersect1` "
            f"{power_of_ten(kept.points['baseline_depth_error_max'].max())}",
        )
    )
