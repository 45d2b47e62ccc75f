"""Intervals of points with few processes, and what the processes report that did not choose the best of several."""

from __future__ import annotations

import re

import pandas as pd

from experiments.results.statistics import REST, Estimate, Pool, holdout

_LOWER_END = re.compile(r"(.+)_low(|_s)")


def with_intervals(points: pd.DataFrame, processes: pd.DataFrame) -> pd.DataFrame:
    """The points, each value with an interval where any variance is known.

    Fewer processes than have an interval of their own borrow the variance of the logarithms that all points of their
    workload have in this column. What a table lacks that is older than the columns of the reporting half is filled in.
    """
    if "process" not in processes or processes["point_id"].isna().any():
        return points
    newer = [
        f"{stem}{REST}{end}" for stem in ("speedup", "speedup_vs_packets") for end in ("", "_low", "_high")
        if f"{stem}_low" in points and f"{stem}{REST}{end}" not in points
    ]  # fmt: skip
    points = points.assign(**dict.fromkeys(newer, float("nan")))
    measured = processes[processes["status"].eq("ok").fillna(False).astype(bool)]
    places = {name: place for place, name in enumerate(points["point_id"])}
    for stem, unit in (found.groups() for name in points if (found := _LOWER_END.fullmatch(name))):
        source = f"{stem.removesuffix(REST)}{unit}"
        if source not in measured or f"{stem}_high{unit}" not in points:
            continue
        # In Python, as pandas takes longer to group rows than there are rows to group.
        of_workloads: dict[str, dict[str, list[float]]] = {}
        for workload, name, value in measured[["workload", "point_id", source]].itertuples(index=False):
            if not pd.isna(value):
                of_workloads.setdefault(workload, {}).setdefault(name, []).append(float(value))
        for groups in of_workloads.values():
            pool = Pool.of(groups.values())
            for name, values in groups.items():
                if name in places:
                    _fill(points, places[name], stem, unit, values, pool)
    return points


def _fill(points: pd.DataFrame, row: int, stem: str, unit: str, values: list[float], pool: Pool | None) -> None:
    """Fill in the ends that are missing; the value itself alone of what reports the best."""
    value, *ends = (points.columns.get_loc(f"{stem}{end}{unit}") for end in ("", "_low", "_high"))
    is_rest = stem.endswith(REST)
    if not pd.isna(points.iat[row, ends[0]]) or (not is_rest and pd.isna(points.iat[row, value])):
        return
    try:
        estimate = Estimate.of(list(holdout(values)) if is_rest else values, pool)
    except ValueError:
        return
    points.iat[row, ends[0]], points.iat[row, ends[1]] = estimate.low, estimate.high
    if is_rest:
        points.iat[row, value] = estimate.value
