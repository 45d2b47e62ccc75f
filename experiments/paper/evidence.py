"""Table -> the numbers a claim asks for, scene by scene; whatever is missing is refused with its reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import pandas as pd

from experiments.methods.aligned import ALIGNED
from experiments.results.statistics import NotMeasuredError, Pool, Sample
from experiments.workloads.build import BUILD
from experiments.workloads.frame import FRAME
from experiments.workloads.gather import GATHER
from experiments.workloads.memory import MEMORY
from experiments.workloads.multiframe import MULTIFRAME
from experiments.workloads.reported import PAPER_SIZE

PAPER_SCENES = {"cornell_box": 1_112, "mitsuba": 61_600, "fireplace_room": 143_173, "sponza": 262_267}
"""The paper's scenes with the triangles it reports, smallest first."""

SPLITS = tuple(2**power for power in range(11))
"""Splits of one axis in the paper's figures 5 to 7."""

TIMED = (FRAME.name, GATHER.name)
"""Workloads whose speed-ups are judged."""

_SETTINGS = ("width", "height", "threads", "build_quality")
# A copy of a scene from another source may have lost degenerate triangles; a different model differs by far more.
_TRIANGLES_TOLERANCE = 1e-3
_POINT = ("workload", "split_x", "split_y", "geometry", "culling")
USED_COLUMNS: tuple[str, ...] = (
    "scene", "stands_for", "triangles", "triangles_traced", "what", "method", "packet_width", *_POINT, *_SETTINGS,
    "status", "error", "cpu", "speedup", "speedup_vs_packets", "build_over_plain", "plan_and_build_over_plain",
    "boxes_entered", "embree_bytes", "rss_mesh_bytes", "rss_bytes", "pixels_tied", "pixels_edge", "pixels_wrong",
    "pixels_hole", "baseline_pixels_hole", "depth_error_max", "baseline_depth_error_max", "point_id",
)  # fmt: skip

T = TypeVar("T")


class Scene:
    """What the table of processes holds of one of the paper's scenes.

    name: in the paper; measured: the name of what was measured; stand_in: it is not the scene itself. rows: all its
    rows, whatever their status. aligned: those of aligned rays.
    """

    def __init__(self, name: str, rows: pd.DataFrame) -> None:
        self.name, self.measured = name, str(rows["scene"].iloc[0])
        self.stand_in = rows["stands_for"].iloc[0] is not None
        self.rows, self.aligned = rows, rows[rows["method"] == ALIGNED.name]
        self._points = dict(iter(self.aligned.groupby(list(_POINT), sort=False, dropna=False)))
        self._pools: dict[tuple[str, str], Pool | None] = {}

    def widest_packets(self, workload: str) -> int:
        """Rays of the widest packets among its points, 1 if there are none."""
        return int(self.rows.loc[self.rows["workload"] == workload, "packet_width"].dropna().max() or 1)

    def processes(
        self, workload: str, split: tuple[int, int], *, culling: bool, geometry: str = "copied",
        packet_width: int | None = None,
    ) -> pd.DataFrame:  # fmt: skip
        """The measured rows of one aligned point, one a process; packet_width None = the only one there is.

        Raises NotMeasuredError, with the reason, when there is none, or when they are of more than one point.
        """
        rows = self._points.get((workload, *split, geometry, culling), self.rows[:0])
        name = f"{workload} of {geometry} geometry at {split[0]:,} x {split[1]:,}, culling {'on' if culling else 'off'}"
        if packet_width is not None:
            rows, name = rows[rows["packet_width"] == packet_width], f"{name}, packet width {packet_width}"
        measured = rows[rows["status"] == "ok"]
        if (points := measured["point_id"].nunique()) > 1:
            raise NotMeasuredError(f"{name}: {points} points, expected one")
        if rows.empty:
            raise NotMeasuredError(f"{name}: not in the table")
        if measured.empty:
            reason = str(rows["error"].iloc[0]).partition(";")[0]  # what follows is advice
            raise NotMeasuredError(f"{name}: {rows['status'].iloc[0]}, {reason}")
        return measured

    def sample(self, column: str, workload: str, split: tuple[int, int], **point: Any) -> Sample:
        """A number of a point in each of its processes. Raises NotMeasuredError where one is missing or not positive.

        The speed-ups of two points are compared rather than their times: each was paired with the same baseline in its
        own rounds, so the slow moments of a machine cancel.
        """
        values = read_numbers(self.processes(workload, split, **point), column)
        if values.min() <= 0:
            raise NotMeasuredError(f"{column} is {values.min()} at {_say(split)}, expected more than 0")
        if (workload, column) not in self._pools:
            rows = self.aligned[(self.aligned["status"] == "ok") & (self.aligned["workload"] == workload)]
            of_points = rows[column].dropna().astype(float).groupby(rows["point_id"], sort=False)
            self._pools[workload, column] = Pool.of([values.to_numpy() for _, values in of_points])
        return Sample(values.tolist(), self._pools[workload, column])


def read_numbers(rows: pd.DataFrame, column: str) -> np.ndarray:
    """(P,) float64, a column of a point's processes. Raises NotMeasuredError for one that is missing or not finite."""
    values = pd.to_numeric(rows[column], errors="coerce").to_numpy(np.float64)
    if not np.isfinite(values).all():
        raise NotMeasuredError(f"{column} is missing at {_say(rows[['split_x', 'split_y']].iloc[0])}")
    return values


def _say(split: Sequence[int]) -> str:
    return " x ".join(f"{cells:,}" for cells in split)


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


def collect_scenes(table: pd.DataFrame | None) -> dict[str, Scene]:
    """The rows of each of the paper's scenes that was measured, by its name in the paper and in the paper's order.

    Where both a scene and its stand-in are in the table, the stand-in is left out. Scenes of other names are no
    concern of the paper's.
    Raises NotMeasuredError for an empty table, for rows from several processors and for rows of one workload that
    differ in image size, threads or build quality.
    """
    if table is None or table.empty:
        raise NotMeasuredError("the table is empty")
    # A column that is not there and a value that is missing mean the same: not measured.
    rows = table.reindex(columns=list(USED_COLUMNS)).astype(object)
    rows = rows.where(rows.notna(), None)
    # The paper's figures are of one frame; of all hits they are counted, so that what else is gathered is left out.
    rows = rows[(rows["workload"] != MULTIFRAME.name) & ((rows["workload"] != GATHER.name) | (rows["what"] == "count"))]
    ok = rows["status"] == "ok"
    if not ok.any():
        raise NotMeasuredError("no row of the table was measured")
    cpus = sorted(map(str, rows.loc[ok, "cpu"].dropna().unique()))
    if len(cpus) > 1:
        raise NotMeasuredError(f"rows from several machines do not compare: cpu is {' and '.join(cpus)}")
    triangles, scenes = pd.to_numeric(rows["triangles"]), {}
    for name, reported in PAPER_SCENES.items():
        itself = (rows["scene"] == name) & ((triangles - reported).abs() <= _TRIANGLES_TOLERANCE * reported)
        chosen = itself if (itself & ok).any() else rows["stands_for"] == name
        if chosen.any():
            scenes[name] = Scene(name, rows[chosen])
    _check_settings(scenes)
    return scenes


def _check_settings(scenes: Mapping[str, Scene]) -> None:
    # Pictures are compared with nothing, so they alone may be of any size.
    for workload in (*TIMED, BUILD.name, MEMORY.name):
        for name in _SETTINGS:
            values = {
                value for scene in scenes.values()
                for value in scene.rows.loc[
                    (scene.rows["status"] == "ok") & (scene.rows["workload"] == workload), name
                ].dropna()
            }  # fmt: skip
            if len(values) > 1:
                named = " and ".join(sorted(map(str, values)))
                raise NotMeasuredError(f"{workload} rows do not compare: {name} is {named}")


def paper_scene(scenes: Mapping[str, Scene], name: str) -> Scene:
    """The scene itself, measured at the paper's image size. Raises NotMeasuredError for anything else."""
    if name not in scenes:
        raise NotMeasuredError(f"{name}: {ABSENT}")
    scene = scenes[name]
    if scene.stand_in:
        raise NotMeasuredError(f"stand-ins only: {scene.measured} for {name}")
    timed = scene.rows[scene.rows["workload"].isin(TIMED) & (scene.rows["status"] == "ok")]
    for size in zip(timed["width"], timed["height"], strict=True):
        if size != PAPER_SIZE:
            told, paper = f"{size[0]} x {size[1]}", _say(PAPER_SIZE)
            raise NotMeasuredError(f"images of {told}, the paper's are {paper}")
    return scene


ABSENT = "neither the scene nor its stand-in is in the table"
