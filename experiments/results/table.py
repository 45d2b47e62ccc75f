"""Records -> tables: one row a point, and one row a process of it."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from atra.errors import InputError
from experiments.harness.column import REAL, TEXT, TRUTH, WHOLE, Column, option_columns
from experiments.harness.method import TIES_HELP
from experiments.harness.point import Workload
from experiments.harness.records import Record
from experiments.methods import METHODS, find_method
from experiments.results.intervals import with_intervals
from experiments.results.people import csv_columns
from experiments.results.processes import BAND, by_point, check_one_environment, drifted, is_replacement
from experiments.results.time_warnings import WRONG, say_warnings, warnings_of, why_wrong
from experiments.workloads import WORKLOADS, find_workload
from scenes.built_in import BUILT_IN


def _first(values: Sequence[Any]) -> Any:
    return values[0]


def _worst(statuses: Sequence[str]) -> str:
    return next(status for status in ("failed", "skipped", WRONG, "ok") if status in statuses)


def _of_all(values: Sequence[str]) -> str:
    return " and ".join(sorted(set(values)))


def _told(name: str, record: Record) -> str:
    """What the point, or else the environment, says of the machine or of software, as text."""
    value = record.configuration.get(name) or record.environment.get(name)
    return " ".join(map(str, value)) if isinstance(value, list) else "none" if value is None else str(value)


def _field(name: str, dtype: str, help: str) -> Column:
    return Column(name, dtype, help, lambda record: record.configuration.get(name))


def _vector(name: str, help: str) -> Column:
    return Column(name, TEXT, help, lambda record: _say_vector(record.configuration.get(name)))


_POINT_COLUMNS = (
    _field("scene", TEXT, "name of the scene"),
    Column(
        "stands_for", TEXT, "scene of the paper that a procedural stand-in replaces", lambda record: _stands_for(record)
    ),
    _field("triangles", WHOLE, "triangles of the mesh"),
    _field("subdivided", WHOLE, "number of times that each triangle was cut into four"),
    _field("copies", WHOLE, "copies of the scene's triangles, side by side in one mesh"),
    _field("mesh_sha256", TEXT, "hash of the mesh as traced"),
    _field("view", TEXT, "the scene's own camera, or which was made from it"),
    _vector("eye", "position of the camera"),
    _vector("target", "point that the camera looks at"),
    _vector("up", "direction that is up in the image"),
    _field("fov_y_degrees", REAL, "vertical field of view"),
    _field("width", WHOLE, "pixels"),
    _field("height", WHOLE, "pixels"),
    _field("workload", TEXT, "what was measured at the point"),
    _field("method", TEXT, "with what"),
)
_TRACING_COLUMNS = (
    _field("threads", WHOLE, "threads that traced"),
    _field("build_quality", TEXT, "Embree's, for its BVH"),
    _field("ties", TEXT, TIES_HELP),
    _field("process", WHOLE, "which of the processes that measured the point"),
)
_OUTCOME_COLUMNS = (
    Column(
        "status",
        TEXT,
        "ok, wrong (the image), skipped, failed or unsteady",
        lambda record: WRONG if why_wrong(record) else record.status,
        _worst,
    ),
    Column("error", TEXT, "why, when not ok", lambda record: record.error or why_wrong(record), _first),
    Column("processes", WHOLE, "processes that measured it", lambda record: 1, sum),
    Column("processes_left_out", WHOLE, "processes left out, the machine not being as it mostly was"),
    Column("processes_replaced", WHOLE, "processes measured again: strayed or disturbed", lambda record: None),
    Column("rounds", WHOLE, "rounds that ran in every process", over=min),
    Column("warnings", TEXT, "what makes the times less trustworthy", warnings_of, say_warnings),
    Column("others_share", REAL, "share of the point's cores that other processes took during the rounds", over=max),
    Column("stolen_share", REAL, "share of the point's cores that other machines on the same hardware took", over=max),
    Column("load_average", REAL, "load of the machine before the point", lambda record: _load(record), max),
    Column("cpu", TEXT, "processor", lambda record: record.environment.get("cpu")),
    *(
        Column(name, TEXT, help, partial(_told, name), _of_all)
        for name, help in (
            ("instruction_set", "the one that Embree and Numba were held to; none = all there are"),
            ("cpu_extensions", "instruction sets of the processor"),
            ("affinity", "cores it could run on"),
            ("git_commit", "commit of the project"),
            ("embree_version", "version of Embree"),
            ("numba_version", "version of Numba"),
            ("python_version", "version of Python"),
        )
    ),
    Column("measured_at", TEXT, "when", lambda record: record.environment.get("taken_at"), min),
    Column("point_id", TEXT, "identity of the point; name of its first record", lambda record: record.point_id, _first),
    Column("grids", TEXT, "grids of the sweep that it is part of", lambda record: None),
)


def columns(workloads: Sequence[Workload] | None = None) -> dict[str, Column]:
    """Every column of the table, by name and in order: the point, its options, what holds for all, what was measured,
    and what became of it. Options and columns of one name are one column. workloads: those of the rows, by default all.

    Times are seconds and medians over rounds; what was not measured is missing, never zero. Raises ValueError for two
    columns of one name and different types.
    """
    workloads = WORKLOADS if workloads is None else workloads
    options = [
        *(column for method in METHODS for column in option_columns(method.options, "method_options")),
        *(column for workload in workloads for column in option_columns(workload.options, "workload_options")),
    ]
    measured = [column for kind in workloads for column in kind.columns]
    counted = [column for method in METHODS for column in method.counters]
    by_name: dict[str, Column] = {}
    for column in (*_POINT_COLUMNS, *options, *_TRACING_COLUMNS, *measured, *counted, *_OUTCOME_COLUMNS):
        if by_name.setdefault(column.name, column).dtype != column.dtype:
            raise ValueError(f"column {column.name} is {by_name[column.name].dtype} and {column.dtype}")
    return by_name


_ALWAYS = ("scene", "workload", "method", "status", "point_id", "grids")
"""Columns without which a file is no table of ours."""

_UNSTEADY = {
    "status": "unsteady",
    "error": f"rtcIntersect1 over packets was more than {BAND:.0%} off the median of the sweep",
}


@dataclass(frozen=True)
class Tables:
    """What came of a sweep. points: one row a point, of all its processes together, less those left out. processes:
    one row a process, with the `point_id` of its point; those left out are "unsteady"."""

    points: pd.DataFrame
    processes: pd.DataFrame


def make_tables(records: Sequence[Record], grids: Mapping[str, Sequence[str]] | None = None) -> Tables:
    """Rows in the order in which points come first among the records.

    grids: names of the grids each point is part of, by the `point_id` of its first process.
    Raises InputError as `check_one_environment`.
    """
    check_one_environment(records)
    out = drifted(records)
    points, processes = [], []
    for of_point in by_point(records):
        first = of_point[0].point_id
        known = {"point_id": first, "grids": ",".join((grids or {}).get(first, ())) or None}
        kept = [record for record in of_point if record.point_id not in out]
        left_out = {
            "processes_left_out": len(of_point) - len(kept),
            "processes_replaced": sum(map(is_replacement, of_point)),
        }
        points.append(_row(kept or of_point) | known | left_out | {"process": None} | ({} if kept else _UNSTEADY))
        processes += [_row([record]) | known | (_UNSTEADY if record.point_id in out else {}) for record in of_point]
    of_processes = frame_of(processes)
    return Tables(with_intervals(frame_of(points), of_processes), of_processes)


def make_table(records: Sequence[Record], grids: Mapping[str, Sequence[str]] | None = None) -> pd.DataFrame:
    """`make_tables`, the points alone."""
    return make_tables(records, grids).points


def frame_of(rows: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """A table of these rows, which may lack any column."""
    told = {name for row in rows for name in row}
    return _frame({name: [row.get(name) for row in rows] for name in told}, pd.RangeIndex(len(rows)))


def _frame(told: Mapping[str, Any], index: pd.Index) -> pd.DataFrame:
    # Most columns hold nothing: one empty array of their type is enough for all.
    empty = {dtype: pd.array([None] * len(index), dtype=dtype) for dtype in (TEXT, WHOLE, REAL, TRUTH)}
    values = {
        name: pd.array(told.get(name, empty[column.dtype]), dtype=column.dtype) for name, column in columns().items()
    }
    return pd.DataFrame(values, index=index)


def table_files(tables: Tables) -> dict[str, bytes]:
    """The contents of `table.csv`, which has the columns that people read, `table.parquet` and `processes.parquet`, by
    name."""
    files = {"table.csv": tables.points[csv_columns(tables.points)].to_csv(index=False).encode()}
    for name, table in (("table", tables.points), ("processes", tables.processes)):
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        files[f"{name}.parquet"] = buffer.getvalue()
    return files


def read_tables(folder: Path) -> Tables | None:
    """The tables in `folder`, or None if there are none. Raises InputError for a file that is not one of ours."""
    points, processes = (read_table(folder / f"{name}.parquet") for name in ("table", "processes"))
    if points is None or processes is None:
        return None
    return Tables(with_intervals(points, processes), processes)


def read_table(path: Path) -> pd.DataFrame | None:
    """One of them, or None if it is not there. Raises InputError for a file that is not one of ours."""
    if not path.exists():
        return None
    try:
        table = pd.read_parquet(path)
        absent = [name for name in _ALWAYS if name not in table]
        if absent:
            raise ValueError(f"it has no column {absent[0]}")
        table = with_names_of_today(table)
        # A column that is newer than the table was not measured.
        known = {name: column.dtype for name, column in columns().items() if name in table}
        return _frame({name: table[name].astype(dtype) for name, dtype in known.items()}, table.index)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} cannot be read as a table of this version ({error}); run the sweep again") from None


def with_names_of_today(table: pd.DataFrame) -> pd.DataFrame:
    """A stored table whose columns and workloads have their names of today."""
    table = table.rename(columns={"doubts": "warnings"})
    for workload in WORKLOADS:
        option = fields(workload.options)[0].name if workload.once else None
        if option in table and "workload" in table:
            is_older = table["workload"].eq(workload.once) & table[option].notna()
            table = table.assign(workload=table["workload"].mask(is_older, workload.name))
    return table


def rows_of(table: pd.DataFrame, *grids: str) -> pd.DataFrame:
    """The rows of points that are part of any of the named grids."""
    of_points = table["grids"].fillna("").str.split(",")
    return table[of_points.map(lambda names: not set(grids).isdisjoint(names)).astype(bool)]


def workload_rows(table: pd.DataFrame, *names: str) -> pd.DataFrame:
    """The rows of the named workloads, measured or not, in the columns in which such rows may have values."""
    # Picked rows are copied column by column, and most columns are of other workloads.
    known = columns([find_workload(name) for name in names])
    rows, is_theirs = table[[name for name in table if name in known]], table["workload"].isin(names).to_numpy(bool)
    return rows if is_theirs.all() else rows[is_theirs] if is_theirs.any() else rows.iloc[:0]


def _row(records: Sequence[Record]) -> dict[str, Any]:
    """The row of one point, from the records of its processes."""
    first = records[0]
    workload, method = find_workload(first.configuration["workload"]), find_method(first.configuration["method"])
    options = (*option_columns(method.options, "method_options"), *option_columns(workload.options, "workload_options"))
    row = {column.name: column.value(records) for column in (*_POINT_COLUMNS, *options, *_TRACING_COLUMNS)}
    # The packet width and threads that ran, where the point leaves them to the machine.
    row |= {name: first.results[name] for name in row if name in first.results}
    if all(record.status == "ok" for record in records):
        measured = {column.name: column.value(records) for column in (*workload.columns, *method.counters)}
        # What ran stands in place of what was asked for, where it is told.
        row |= {name: value for name, value in measured.items() if value is not None or name not in row}
    return row | {column.name: column.value(records) for column in _OUTCOME_COLUMNS}


def _stands_for(record: Record) -> str | None:
    if record.configuration.get("scene_source") != "procedural":
        return None
    stand_in = BUILT_IN.get(str(record.configuration.get("scene")))
    return stand_in.stands_for if stand_in else None


def _load(record: Record) -> float | None:
    load = record.environment.get("load_average")
    return load[0] if load else None


def _say_vector(vector: Sequence[float] | None) -> str | None:
    """ "0, 1, 3.5", every digit kept; None where a record holds none."""
    return None if vector is None else ", ".join(repr(float(value)).removesuffix(".0") for value in vector)
