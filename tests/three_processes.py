"""Processes of points whose intervals are known."""

import math

import pandas as pd

from experiments.results.statistics import student
from experiments.results.table import frame_of


def three_processes(points):
    """Three rows of every point of a table, whose values have the intervals that the point's columns name; one row of a
    point that names a value without its interval."""
    rows = []
    for number, (_, point) in enumerate(points.iterrows()):
        row = {name: value for name, value in point.items() if not pd.isna(value)}
        row.setdefault("point_id", str(number))
        ranges = [name for name in row if f"{name}_low" in points]
        open_ones = [name for name in ranges if f"{name}_low" not in row]
        for process in range(1 if open_ones else 3):
            values = {}
            for name in set(ranges) - set(open_ones):
                low, high = math.log(row[f"{name}_low"]), math.log(row[f"{name}_high"])
                apart = (high - low) / 2 * math.sqrt(3) / student(2)
                values[name] = math.exp((low + high) / 2 + (process - 1) * apart)
            rows.append(row | values | {"process": process})
    return frame_of(rows)
