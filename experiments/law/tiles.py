"""Rays of a bake to the sun: what was measured beside what the model says with constants fitted without that scene.

    python -m experiments.law.tiles results/bake_rays/table.parquet reports/reference/law_tiles

looks at every map of the rows of `sweep=bake_rays` whose use is the sun, writes table.parquet, says how well it
predicts, and prints the constants of all scenes.
"""

from __future__ import annotations

import json
from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.light import Atlas, Texels
from experiments.law.looks import scene_named
from experiments.law.model.formulas import NANO, fit
from experiments.law.tile_looks import TileLook, look_at_tiles
from experiments.law.tile_terms import packet_terms, prepare_terms, trace_terms
from experiments.light.bake_rays import SUN
from experiments.light.sun.tiles import Tiles
from scenes.directory import default_cache

KEYS = ["scene", "map_size", "tile_size", "least_texels", "shortcut"]
"""What a look depends on."""

WAYS = ("aligned", "packets", "single")

PARTS: dict[str, tuple[str, Callable[[TileLook, Any], NDArray[np.float64]]]] = {
    "trace": ("measured_trace_s", lambda look, row: trace_terms(look, int(row["positions"]), int(row["width"]))),
    "prepare": ("measured_prepare_s", lambda look, row: prepare_terms(look)),
    "packets": ("measured_packets_s", lambda look, row: packet_terms(look, int(row["positions"]), int(row["width"]))),
    "single": ("measured_single_s", lambda look, row: packet_terms(look, int(row["positions"]), 1)),
}
"""For each family of constants the time that it explains, and its terms."""


def measured_rows(table: pd.DataFrame, width: int) -> pd.DataFrame:
    """Rows of the sun, with times of the three ways. width: rays of the widest packets there."""
    rows = table[(table["workload"] == "bake_rays") & (table["use"] == "sun") & (table["status"] == "ok")]
    kept = rows[[*KEYS, "positions"]].reset_index(drop=True)
    rows = rows.reset_index(drop=True)
    aligned = rows["aligned_time_s"].astype(float)
    return kept.assign(
        width=width, measured_aligned_s=aligned, measured_prepare_s=rows["prepare_s"].astype(float),
        measured_trace_s=np.maximum(aligned - rows["prepare_s"].astype(float), 1e-9),
        measured_packets_s=aligned * rows["packets_over_aligned"].astype(float),
        measured_single_s=aligned * rows["single_over_aligned"].astype(float),
        triangles_aligned=rows["triangles_aligned"],
    )  # fmt: skip


def look_of(row: Any) -> TileLook:
    """A look at the tiles of a measured row."""
    mesh = scene_named(str(row["scene"])).mesh
    atlas = Atlas.unwrap(mesh, int(row["map_size"]), kept_in=default_cache() / "atlases")
    tiles = Tiles.of(Texels.of(mesh, atlas), int(row["tile_size"]), int(row["least_texels"]))
    return look_at_tiles(tiles, SUN, shortcut=bool(row["shortcut"]))


def with_terms(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with their look's counts, and the terms of every family."""
    parts = []
    for _, of in rows.groupby(KEYS):
        look = look_of(of.iloc[0])
        told = {"tiles": look.tiles, "texels": look.texels, "copies": look.copies, "open_share": look.open_share}
        terms = {
            f"{name}_terms": [make(look, row) for row in of.to_dict("records")] for name, (_, make) in PARTS.items()
        }
        parts.append(of.assign(**told, **terms))
    return pd.concat(parts).sort_index()


def constants_of(rows: pd.DataFrame) -> dict[str, list[float]]:
    """Constants of every family, fitted to these rows."""
    return {
        name: (fit(np.stack(list(rows[f"{name}_terms"])), rows[column].to_numpy(float)) / NANO).tolist()
        for name, (column, _) in PARTS.items()
    }


def leave_one_out(rows: pd.DataFrame) -> pd.DataFrame:
    """Each row with predictions by constants that its scene had no part in."""
    parts = []
    for scene, of in rows.groupby("scene"):
        constants = constants_of(rows[rows["scene"] != scene])
        told = {
            f"predicted_{name}_s": [float(np.dot(one, constants[name])) * NANO for one in of[f"{name}_terms"]]
            for name in PARTS
        }
        parts.append(of.assign(**told))
    judged = pd.concat(parts).sort_index()
    return judged.assign(predicted_aligned_s=judged["predicted_prepare_s"] + judged["predicted_trace_s"])


def fastest(rows: pd.DataFrame, what: str) -> pd.Series:
    """The fastest way of each row. what: measured or predicted."""
    times = rows[[f"{what}_{way}_s" for way in WAYS]]
    return times.idxmin(axis=1).str.removeprefix(f"{what}_").str.removesuffix("_s")


def report(rows: pd.DataFrame) -> str:
    """Errors, and whether the fastest way is named."""
    lines = [f"{rows['scene'].nunique()} scenes, {len(rows)} rows"]
    for name in (*PARTS, "aligned"):
        errors = (rows[f"predicted_{name}_s"] / rows[f"measured_{name}_s"] - 1.0).abs()
        lines.append(f"  {name}: median error {errors.median():.0%}, nine of ten within {errors.quantile(0.9):.0%}")
    named = fastest(rows, "measured") == fastest(rows, "predicted")
    lines.append(
        f"  fastest named: {named.mean():.0%}; aligned is it in {fastest(rows, 'measured').eq('aligned').mean():.0%}"
    )
    return "\n".join(lines)


def main() -> None:
    """Look, fit, report, and write the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--width", type=int, default=16, help="rays of the widest packets where it was measured")
    given = parser.parse_args()
    rows = with_terms(measured_rows(pd.read_parquet(given.table), given.width))
    judged = leave_one_out(rows)
    print(report(judged))
    given.folder.mkdir(parents=True, exist_ok=True)
    judged.drop(columns=[f"{name}_terms" for name in PARTS]).to_parquet(given.folder / "table.parquet", index=False)
    print(json.dumps({name: [float(f"{one:.3g}") for one in of] for name, of in constants_of(rows).items()}, indent=1))


if __name__ == "__main__":
    main()
