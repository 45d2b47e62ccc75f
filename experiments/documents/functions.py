"""Rows of tables that no description in TOML says. A function takes a sweep, and gives the cells of each row."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pandas as pd

from experiments.documents.filling import TIMES, kept_of
from experiments.methods import find_method
from experiments.paper.conclusion import scene_gains
from experiments.workloads.frame.shown import best_baselines

Rows = Iterable[Iterable[Any]]


def best_packets(sweep: str) -> Rows:
    for best in best_baselines(kept_of(sweep).processes):
        words = "more than noise" if best.is_faster else "no more than noise"
        margin = "too few processes" if best.margin is None else f"{best.margin}"
        yield f"`{best.scene}`", best.tried, best.name, margin, words


def best_gains(sweep: str) -> Rows:
    """The paper's gain, those of single rays under each reading of its baseline, and that of packets over packets."""

    def gain_and_split(gain: Any) -> str:
        return "none" if isinstance(gain, str) else f"{gain.estimate} ({gain.splits:,} {TIMES} 1)"

    for of_scene in scene_gains(kept_of(sweep).processes):
        packets = gain_and_split(next(iter(of_scene.packets.values()))) if of_scene.packets else "none"
        paper = "" if of_scene.paper is None else f"{of_scene.paper:.2f}"
        yield f"`{of_scene.scene.measured}`", paper, *map(gain_and_split, of_scene.single.values()), packets


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


FUNCTIONS: dict[str, Callable[[str], Rows]] = {
    made.__name__: made for made in (best_packets, best_gains, images_judged)
}
