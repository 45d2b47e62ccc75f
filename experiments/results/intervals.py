"""Intervals of points with few processes, and what the processes report that did not choose the best of several."""

from __future__ import annotations

import pandas as pd

from experiments.results.statistics import REST, Estimate, Pool, holdout

_ENDS = ("low", "high")


def _stem(name: str) -> tuple[str, str] | None:
    """ "render_time_low_s" -> "render_time" and "_s"; None for a column that is no lower end."""
    stem, separator, unit = name.rpartition("_low")
    return (stem, unit) if separator and unit in ("", "_s") else None


def with_intervals(points: pd.DataFrame, processes: pd.DataFrame) -> pd.DataFrame:
    """The points, each value with an interval where any variance is known.

    Fewer processes than have an interval of their own borrow the variance of the logarithms that all points of their
    workload have in this column. What a table lacks that is older than the columns of the reporting half is filled in.
    """
    if "process" not in processes or processes["point_id"].isna().any():
        return points
    stems = [parts for name in points if (parts := _stem(name)) is not None]
    missing = [
        (f"{stem}{REST}", "") for stem in ("speedup", "speedup_vs_packets")
        if f"{stem}_low" in points and f"{stem}{REST}_low" not in points
    ]  # fmt: skip
    points = points.assign(**{f"{stem}{end}": float("nan") for stem, _ in missing for end in ("", "_low", "_high")})
    measured = processes[processes["status"].eq("ok").fillna(False).astype(bool)]
    workloads, names = measured["workload"].tolist(), measured["point_id"].tolist()
    at = {name: place for place, name in enumerate(points["point_id"])}
    for stem, unit in [*stems, *missing]:
        source = f"{stem.removesuffix(REST)}{unit}"
        if source not in measured or f"{stem}_high{unit}" not in points:
            continue
        # In Python, as pandas takes longer to group rows than there are rows to group.
        of_workloads: dict[str, dict[str, list[float]]] = {}
        for workload, name, value in zip(workloads, names, measured[source], strict=True):
            if not pd.isna(value):
                of_workloads.setdefault(workload, {}).setdefault(name, []).append(float(value))
        for groups in of_workloads.values():
            pool = Pool.of(groups.values())
            for name, values in groups.items():
                if name in at:
                    _fill(points, at[name], stem, unit, values, pool)
    return points


def _fill(points: pd.DataFrame, row: int, stem: str, unit: str, values: list[float], pool: Pool | None) -> None:
    place = [points.columns.get_loc(f"{stem}{end}{unit}") for end in ("", "_low", "_high")]
    rest = stem.endswith(REST)
    if not pd.isna(points.iat[row, place[1]]) or (not rest and pd.isna(points.iat[row, place[0]])):
        return
    try:
        estimate = Estimate.of(list(holdout(values)) if rest else values, pool)
    except ValueError:
        return
    for column, value in zip(place, (estimate.value, estimate.low, estimate.high), strict=True):
        if rest or column != place[0]:
            points.iat[row, column] = value
