"""Which columns of the table the page shows together, and in which unit."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from experiments.results.settings import settings_that_vary
from experiments.results.table import workload_rows
from experiments.workloads import WORKLOADS
from experiments.workloads.images import IMAGE_COLUMNS
from experiments.workloads.resources import RESOURCE_COLUMNS

IDENTITY = ("scene", "workload", "method", "geometry", "split_x", "split_y", "culling", "packet_width")
"""Columns that tell one point from another; shown in every view, and with them every other setting that varies."""

_SHARED = {"pixels": IMAGE_COLUMNS, "memory": RESOURCE_COLUMNS}
"""Columns of several workloads, by name of their view."""

_LEFT_OUT = ("_q1", "_q3", "_q1_s", "_q3_s", "_low_s", "_high_s")
"""Ends of columns that only the view of everything has: quartiles, and intervals of all but ratios."""

_TRUST = ("status", "error", "rounds", "load_average", "doubts", "cpu", "measured_at")


@dataclass(frozen=True)
class Column:
    """How the page shows a column.

    kind: "text", "whole", "real" or "truth". unit: shown in the heading, "" if none. factor: value to shown number.
    """

    name: str
    heading: str
    kind: str
    unit: str
    factor: float


@dataclass(frozen=True)
class View:
    """A choice of columns; rows of other workloads are left out, unless `workloads` is None."""

    name: str
    columns: tuple[str, ...]
    workloads: tuple[str, ...] | None


def describe_columns(table: pd.DataFrame) -> tuple[Column, ...]:
    return tuple(_describe(str(name), table[name]) for name in table.columns)


def views_of(table: pd.DataFrame) -> tuple[View, ...]:
    """A view for each workload and for what several share, of the columns that have values; then what makes points
    trustworthy, and one of everything."""
    identity = [name for name in IDENTITY if name in table] + settings_that_vary(table, IDENTITY)
    shared = {column for columns in _SHARED.values() for column in columns}
    groups = [(one.name, [one.name], [column for column in one.columns if column not in shared]) for one in WORKLOADS]
    for name, common in _SHARED.items():
        groups.append((name, [one.name for one in WORKLOADS if set(common) <= set(one.columns)], list(common)))
    views = []
    for name, workloads, columns in groups:
        rows = workload_rows(table, *workloads)
        names = [column.name for column in columns if not column.name.endswith(_LEFT_OUT)]
        own = [one for one in names if one not in identity and rows[one].notna().any()]
        if own:
            views.append(View(name, (*identity, *own), tuple(workloads)))
    trust = [name for name in _TRUST if name in table]
    return (*views, View("trust", (*identity, *trust), None), View("everything", tuple(map(str, table.columns)), None))


def _describe(name: str, values: pd.Series) -> Column:
    kind = _kind(values)
    if kind in ("real", "whole"):
        if name.endswith("_s"):
            return Column(name, name.removesuffix("_s").replace("_", " "), kind, "ms", 1e3)
        if name.endswith("_bytes"):
            return Column(name, name.removesuffix("_bytes").replace("_", " "), kind, "MiB", 2.0**-20)
    return Column(name, name.replace("_", " "), kind, "", 1.0)


def _kind(values: pd.Series) -> str:
    if pd.api.types.is_bool_dtype(values.dtype):
        return "truth"
    if pd.api.types.is_integer_dtype(values.dtype):
        return "whole"
    return "real" if pd.api.types.is_float_dtype(values.dtype) else "text"
