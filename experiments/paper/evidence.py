"""Table -> the numbers a claim asks for, scene by scene; whatever is missing is refused with its reason."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import pandas as pd

from experiments.methods.aligned import ALIGNED
from experiments.results.claims import NotMeasuredError
from experiments.results.statistics import Estimate, Pool, best_of
from experiments.workloads.build import BUILD
from experiments.workloads.frame import FRAME
from experiments.workloads.gather import GATHER
from experiments.workloads.memory import MEMORY
from experiments.workloads.multiframe import MULTIFRAME

PAPER_SCENES = {"cornell_box": 1_112, "mitsuba": 61_600, "fireplace_room": 143_173, "sponza": 262_267}
"""The paper's scenes with the triangles it reports, smallest first."""

SPLITS = tuple(2**power for power in range(11))
"""Splits of one axis in the paper's figures 5 to 7."""

TIMED = (FRAME.name, GATHER.name)
"""Workloads whose speed-ups are judged."""

_SETTINGS = ("width", "height", "threads", "build_quality")
# A copy of a scene from another source may have lost degenerate triangles; a different model differs by far more.
_TRIANGLES_TOLERANCE = 1e-3
USED_COLUMNS: tuple[str, ...] = (
    "scene", "stands_for", "triangles", "triangles_traced", "workload", "what", "method", "geometry", "culling",
    "packet_width", "split_x", "split_y", *_SETTINGS, "status", "error", "cpu", "speedup", "speedup_vs_packets",
    "plan_time_s", "build_time_s", "build_over_plain", "plan_and_build_over_plain", "boxes_entered", "embree_bytes",
    "rss_mesh_bytes", "rss_bytes", "pixels_tied", "pixels_edge", "pixels_wrong", "pixels_hole",
    "baseline_pixels_hole", "depth_error_max", "baseline_depth_error_max", "point_id",
)  # fmt: skip


T = TypeVar("T")

Row = Mapping[str, Any]
"""One row of the table; a missing value is None."""


class Sample(list[float]):
    """A number of one point, in each of its processes. pool: what points of its kind share; None where nobody knows."""

    pool: Pool | None = None

    def over(self, other: Sample) -> Sample:
        """Its ratios to another point's, process by process."""
        ratios = Sample(own / others for own, others in zip(self, other, strict=False))
        ratios.pool = None if self.pool is None else Pool(2 * self.pool.variance, self.pool.freedom)
        return ratios


@dataclass(frozen=True)
class SceneRows:
    """What the table of processes holds of one of the paper's scenes.

    paper_scene: its name in the paper; scene: the name of what was measured; stand_in: it is not the scene itself.
    rows: all its rows, whatever their status. points: the same by workload, split_x, split_y, geometry and culling,
    aligned rays only. pools: by workload and column, of these points.
    """

    paper_scene: str
    scene: str
    stand_in: bool
    rows: tuple[Row, ...]
    points: Mapping[tuple[Any, ...], list[Row]]
    pools: dict[tuple[str, str], Pool | None] = field(default_factory=dict, compare=False)

    def sample(self, rows: Sequence[Row], column: str) -> Sample:
        """A column of a point's processes. Raises NotMeasuredError for values that are missing or not positive."""
        sample, key = Sample(read_positive(row, column) for row in rows), (str(rows[0]["workload"]), column)
        if key not in self.pools:
            by_point: dict[str, list[float]] = {}
            for row in (row for of_point in self.points.values() for row in of_point):
                if row["status"] == "ok" and row["workload"] == key[0] and row[column] is not None:
                    by_point.setdefault(row["point_id"], []).append(float(row[column]))
            self.pools[key] = Pool.of(by_point.values())
        sample.pool = self.pools[key]
        return sample

    def widest_packets(self, workload: str) -> int:
        """Rays of the widest packets among its points, 1 if there are none."""
        return max((int(row["packet_width"] or 1) for row in self.rows if row["workload"] == workload), default=1)

    def processes(
        self,
        workload: str,
        split: tuple[int, int],
        *,
        culling: bool,
        geometry: str = "copied",
        packet_width: int | None = None,
    ) -> list[Row]:
        """The measured rows of one aligned point, one a process; packet_width None = the only one there is.

        Raises NotMeasuredError, with the reason, when there is none, or when they are of more than one point.
        """
        rows = self.points.get((workload, *split, geometry, culling), [])
        if packet_width is not None:
            rows = [row for row in rows if row["packet_width"] == packet_width]
        measured = [row for row in rows if row["status"] == "ok"]
        name = f"{workload} of {geometry} geometry at {split[0]:,} x {split[1]:,}, culling {'on' if culling else 'off'}"
        if packet_width is not None:
            name += f", packet width {packet_width}"
        points = len({row["point_id"] for row in measured})
        if points > 1:
            raise NotMeasuredError(f"{name}: {points} points, expected one")
        if measured:
            return measured
        if rows:
            reason = str(rows[0]["error"]).partition(";")[0]  # what follows is advice
            raise NotMeasuredError(f"{name}: {rows[0]['status']}, {reason}")
        raise NotMeasuredError(f"{name}: not in the table")

    def speedups(
        self,
        split: tuple[int, int],
        *,
        culling: bool,
        packet_width: int = 1,
        column: str = "speedup",
        workload: str = FRAME.name,
        **options: Any,
    ) -> Sample:
        """A point's speed-up in every process. The speed-ups of two points are compared rather than their times: each
        was paired with the same baseline in its own rounds, so the slow moments of a machine cancel."""
        rows = self.processes(workload, split, culling=culling, packet_width=packet_width, **options)
        return self.sample(rows, column)

    def over_splits(self, **options: Any) -> tuple[dict[int, Sample], dict[int, str]]:
        """Over horizontal splits 1 ... 1,024: the speed-ups that were measured, and why the others were not.

        options: those of `speedups`.
        """
        return measured_at(SPLITS, lambda split: self.speedups((split, 1), **options))


def measured_at(splits: Sequence[int], read: Callable[[int], T]) -> tuple[dict[int, T], dict[int, str]]:
    """What is read at each number of splits, and why it was not measured at the others."""
    values: dict[int, T] = {}
    missing: dict[int, str] = {}
    for split in splits:
        try:
            values[split] = read(split)
        except NotMeasuredError as error:
            missing[split] = str(error)
    return values, missing


def estimate(sample: Sample) -> Estimate:
    """Mean and interval of one value per process. Raises NotMeasuredError for too few."""
    try:
        return Estimate.of(sample, sample.pool)
    except ValueError as error:
        raise NotMeasuredError(str(error)) from None


def best(candidates: Mapping[Any, Sample]) -> tuple[Any, Estimate]:
    """The best of some points and its estimate, see `best_of`. Raises NotMeasuredError for none or too few."""
    if not candidates:
        raise NotMeasuredError("nothing to choose from was measured")
    try:
        return best_of(candidates, next(iter(candidates.values())).pool)
    except ValueError as error:
        raise NotMeasuredError(f"to choose the best on some processes and report it on others: {error}") from None


def collect_scenes(table: pd.DataFrame | None) -> dict[str, SceneRows]:
    """The rows of each of the paper's scenes that was measured, by its name in the paper and in the paper's order.

    Where both a scene and its stand-in are in the table, the stand-in is left out. Scenes of other names are no
    concern of the paper's.
    Raises NotMeasuredError for an empty table, for rows from several processors and for rows of one workload that
    differ in image size, threads or build quality.
    """
    if table is None or table.empty:
        raise NotMeasuredError("the table is empty")
    rows = [row for row in _rows(table) if _is_compared(row)]
    measured = [row for row in rows if row["status"] == "ok"]
    if not measured:
        raise NotMeasuredError("no row of the table was measured")
    cpus = sorted({str(row["cpu"]) for row in measured if row["cpu"] is not None})
    if len(cpus) > 1:
        raise NotMeasuredError(f"rows from several machines do not compare: cpu is {' and '.join(cpus)}")
    scenes = {}
    for name in PAPER_SCENES:
        of_scene = [row for row in rows if _is_paper_scene(row, name)]
        if not any(row["status"] == "ok" for row in of_scene):
            of_scene = [row for row in rows if row["stands_for"] == name]
        if of_scene:
            scenes[name] = _index(name, of_scene)
    _check_settings(scenes)
    return scenes


class Evidence:
    """A table of processes and its scenes, which are collected once for all claims."""

    def __init__(self, table: pd.DataFrame | None) -> None:
        self._table = table

    @cached_property
    def scenes(self) -> dict[str, SceneRows]:
        """As `collect_scenes`, which raises NotMeasuredError."""
        return collect_scenes(self._table)


def _rows(table: pd.DataFrame) -> list[Row]:
    """A column that is not there and a value that is missing mean the same: not measured."""
    columns = []
    for name in USED_COLUMNS:
        column = table[name] if name in table.columns else pd.Series(pd.NA, index=table.index)
        missing = column.isna().tolist()
        columns.append([None if gone else value for value, gone in zip(column.tolist(), missing, strict=True)])
    return [dict(zip(USED_COLUMNS, values, strict=True)) for values in zip(*columns, strict=True)]


def _is_compared(row: Row) -> bool:
    """The paper's figures are of one frame; of all hits they are counted, so that what else is gathered is left out."""
    return row["workload"] != MULTIFRAME.name and (row["workload"] != GATHER.name or row["what"] == "count")


def _is_paper_scene(row: Row, name: str) -> bool:
    if row["scene"] != name or row["triangles"] is None:
        return False
    return bool(abs(row["triangles"] - PAPER_SCENES[name]) <= _TRIANGLES_TOLERANCE * PAPER_SCENES[name])


def _index(name: str, rows: Sequence[Row]) -> SceneRows:
    points: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["method"] == ALIGNED.name:
            key = tuple(row[field] for field in ("workload", "split_x", "split_y", "geometry", "culling"))
            points.setdefault(key, []).append(row)
    return SceneRows(name, str(rows[0]["scene"]), rows[0]["stands_for"] is not None, tuple(rows), points)


def read_positive(row: Row, name: str) -> float:
    """Raises NotMeasuredError when the value is missing or not a positive, finite number."""
    value = read_number(row, name)
    if value <= 0:
        raise NotMeasuredError(f"{name} is {value} at {row['split_x']:,} x {row['split_y']:,}, expected more than 0")
    return value


def read_number(row: Row, name: str) -> float:
    """Raises NotMeasuredError when the value is missing or not finite."""
    value = row[name]
    if value is None or not math.isfinite(value):
        raise NotMeasuredError(f"{name} is missing at {row['split_x']:,} x {row['split_y']:,}")
    return float(value)


def _check_settings(scenes: Mapping[str, SceneRows]) -> None:
    measured = [row for scene in scenes.values() for row in scene.rows if row["status"] == "ok"]
    # Pictures are compared with nothing, so they alone may be of any size.
    for workload in (*TIMED, BUILD.name, MEMORY.name):
        for name in _SETTINGS:
            values = {row[name] for row in measured if row["workload"] == workload and row[name] is not None}
            if len(values) > 1:
                named = " and ".join(sorted(str(value) for value in values))
                raise NotMeasuredError(f"{workload} rows do not compare: {name} is {named}")
