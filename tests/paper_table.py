"""A table small enough to know the verdict of each of the paper's claims, and ways to change it."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from experiments.paper.evidence import PAPER_SCENES, SPLITS
from tests.report_samples import table_of

BEST = {"cornell_box": 7.6, "mitsuba": 3.0, "fireplace_room": 1.9, "sponza": 1.75}

Row = dict[str, Any]


def agreeing_rows(scene: str) -> list[Row]:
    """Rows of one scene that confirm every claim but the cost model's; intervals are 1 % wide either way."""
    triangles = PAPER_SCENES[scene]
    common: Row = {
        "scene": scene, "triangles": triangles, "width": 1024, "height": 1024, "threads": 1, "build_quality": "medium",
        "method": "aligned", "geometry": "copied", "culling": True, "packet_width": 8, "split_y": 1, "status": "ok",
        "cpu": "some cpu",
    }  # fmt: skip

    def gain(cells: int) -> float:
        return BEST[scene] * (cells / 1024) ** 0.05

    rows: list[Row] = []

    def time(split_x: int, split_y: int, speedup: float, **fields: Any) -> None:
        name = "speedup" if fields["packet_width"] == 1 else "speedup_vs_packets"
        numbers = {name: speedup, f"{name}_low": speedup * 0.99, f"{name}_high": speedup * 1.01}
        if name != "speedup":
            numbers |= {column.replace("_vs_packets", ""): number for column, number in numbers.items()}
        counts = {"pixels_equal": 1024**2 - 3, "pixels_tied": 2, "pixels_edge": 1, "pixels_wrong": 0}
        copies = {"triangles_traced": triangles * split_x * split_y}
        split = {"workload": "frame", "split_x": split_x, "split_y": split_y}
        rows.append({**common, **split, **numbers, **counts, **copies, **fields})

    for splits in SPLITS:
        # Without culling: fastest at 16, at the end slower than at the start.
        off = 1 + 0.1 * math.log2(splits) if splits <= 16 else 1.4 * (16 / splits) ** 0.2
        time(splits, 1, off, culling=False, packet_width=1)
        time(splits, 1, off, culling=False, packet_width=8)
        time(splits, 1, off / 2, culling=False, packet_width=8, geometry="instanced")
        time(splits, 1, gain(splits), packet_width=1)
        time(splits, 1, gain(splits), packet_width=8)
        if splits > 1:
            time(1, splits, gain(splits) / 1.06, packet_width=1)
        build = {"plan_time_s": 0.1, "build_time_s": splits**0.1, "build_time_low_s": splits**0.1 * 0.99}
        build["build_time_high_s"] = splits**0.1 * 1.01
        rows.append({**common, "workload": "build", "split_x": splits, **build})
        rss = {"rss_mesh_bytes": 10 * 2**20, "rss_bytes": 14 * 2**20}
        for geometry, culling, size in (
            ("copied", True, splits**0.1),
            ("copied", False, splits),
            ("instanced", False, 1),
        ):
            how = {"geometry": geometry, "culling": culling, "embree_bytes": int(1000 * size) - (geometry != "copied")}
            rows.append({**common, "workload": "memory", "split_x": splits, **how, **rss})
    for split_x in SPLITS[1:5]:
        for split_y in SPLITS[1:5]:
            time(split_x, split_y, gain(split_x * split_y) / 1.2, packet_width=1)
    return rows


def agreeing_table(scenes: tuple[str, ...] = tuple(PAPER_SCENES)) -> pd.DataFrame:
    return table_of([row for scene in scenes for row in agreeing_rows(scene)])


def where(table: pd.DataFrame, **wanted: Any) -> pd.Series:
    chosen = pd.Series(True, index=table.index)
    for name, value in wanted.items():
        chosen &= (table[name] == value).fillna(False)
    assert chosen.any(), f"no row with {wanted}"
    return chosen


def scaled(table: pd.DataFrame, factor: float, column: str = "speedup", **wanted: Any) -> pd.DataFrame:
    """The table with one number, and its interval, multiplied in the rows with `wanted`."""
    table = table.copy()
    stem, unit = (column[:-2], "_s") if column.endswith("_s") else (column, "")
    for name in (column, f"{stem}_low{unit}", f"{stem}_high{unit}"):
        if name in table:
            table[name] = table[name].astype("Float64")
            table.loc[where(table, **wanted), name] *= factor
    return table


def skipped(table: pd.DataFrame, **wanted: Any) -> pd.DataFrame:
    table = table.copy()
    chosen = where(table, **wanted)
    table.loc[chosen, ["status", "error"]] = ["skipped", "needs 9 GiB"]
    table.loc[chosen, ["speedup", "speedup_low", "speedup_high", "pixels_wrong", "triangles_traced"]] = pd.NA
    return table


def longer_build(table: pd.DataFrame, scene: str, split_x: int) -> pd.DataFrame:
    return scaled(table, 2, "build_time_s", workload="build", scene=scene, split_x=split_x)


def more_bytes(table: pd.DataFrame, scene: str, split_x: int, **fields: Any) -> pd.DataFrame:
    wanted = {"culling": True, "workload": "memory", "scene": scene, "split_x": split_x, **fields}
    return scaled(table, 9 if fields else 2, "embree_bytes", **wanted)
