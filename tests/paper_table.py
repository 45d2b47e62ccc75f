"""A table of processes small enough to know the verdict of each of the paper's claims, and ways to change it."""

import math

import pandas as pd

from experiments.paper.evidence import PAPER_SCENES, SPLITS
from tests.report_samples import table_of

SCATTER = (0.997, 1.003, 1.0, 0.998, 1.002)
"""What the processes of a point differ by; point by point in another order."""

SCATTERED = ("speedup", "speedup_vs_packets", "build_over_plain", "plan_and_build_over_plain")

BEST = {"cornell_box": 7.6, "mitsuba": 3.0, "fireplace_room": 1.9, "sponza": 1.75}


def agreeing_rows(scene):
    """Rows of one scene that confirm every claim but those no table can confirm beside the others."""
    triangles = PAPER_SCENES[scene]
    common = {
        "scene": scene, "triangles": triangles, "width": 1024, "height": 1024, "threads": 1, "build_quality": "medium",
        "method": "aligned", "geometry": "copied", "culling": True, "packet_width": 8, "split_y": 1, "status": "ok",
        "cpu": "some cpu",
    }  # fmt: skip

    def gain(cells):
        return BEST[scene] * (cells / 1024) ** 0.05

    rows = []

    def time(split_x, split_y, speedup, **fields):
        numbers = {"speedup": speedup}
        if fields["packet_width"] > 1:
            numbers["speedup_vs_packets"] = speedup
        counts = {"pixels_equal": 1024**2 - 3, "pixels_tied": 2, "pixels_edge": 1, "pixels_wrong": 0}
        copies = {"triangles_traced": triangles * split_x * split_y}
        split = {"workload": "frame", "split_x": split_x, "split_y": split_y}
        held = {"embree_bytes": 1000 * (1 if fields.get("culling", True) else split_x)}
        rows.append({**common, **split, **numbers, **counts, **copies, **held, **fields})

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
        build = {"build_over_plain": splits**0.1, "plan_and_build_over_plain": 2 * splits**0.1}
        rows.append({**common, "workload": "build", "split_x": splits, **build})
        copies = {"boxes_entered": 30.0 * splits**1.5, "triangles_traced": triangles * splits}
        rows.append({**common, "workload": "build", "split_x": splits, "culling": False, **copies})
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
    return processes(rows)


def processes(rows):
    """Each row once for every process; bytes and pixels are counted in one alone."""
    of_processes = []
    for number, row in enumerate(rows):
        point = {"point_id": f"{row['scene']} {number}"}
        timed = not row.keys().isdisjoint(SCATTERED)
        for process in range(len(SCATTER) if timed else 1):
            factor = SCATTER[(process + number) % len(SCATTER)]
            scattered = {name: row[name] * factor for name in SCATTERED if name in row}
            of_processes.append({**row, **point, "process": process, **scattered})
    return of_processes


def agreeing_table(scenes=tuple(PAPER_SCENES)):
    return table_of([row for scene in scenes for row in agreeing_rows(scene)])


def where(table, **wanted):
    chosen = pd.Series(True, index=table.index)
    for name, value in wanted.items():
        chosen &= (table[name] == value).fillna(False)
    assert chosen.any(), f"no row with {wanted}"
    return chosen


def scaled(table, factor, column="speedup", **wanted):
    """The table with one number multiplied in the rows with `wanted`."""
    table = table.copy()
    table[column] = table[column].astype("Float64")
    table.loc[where(table, **wanted), column] *= factor
    return table


def skipped(table, **wanted):
    table = table.copy()
    chosen = where(table, **wanted)
    table.loc[chosen, ["status", "error"]] = ["skipped", "needs 9 GiB"]
    table.loc[chosen, ["speedup", "pixels_wrong", "triangles_traced"]] = pd.NA
    return table


def longer_build(table, scene, split_x):
    return scaled(table, 2, "build_over_plain", workload="build", scene=scene, split_x=split_x)


def more_bytes(table, scene, split_x, **fields):
    wanted = {"culling": True, "workload": "memory", "scene": scene, "split_x": split_x, **fields}
    return scaled(table, 9 if fields else 2, "embree_bytes", **wanted)
