"""Which columns of the table the page shows together, and in which unit."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from experiments.results.settings import settings_that_vary
from experiments.results.table import workload_rows
from experiments.workloads import WORKLOADS

IDENTITY = ("scene", "workload", "method", "geometry", "split_x", "split_y", "culling", "packet_width")
"""Columns that tell one point from another; shown in every view, and with them every other setting that varies."""

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
    """A choice of columns; rows of other workloads are left out, unless `workload` is None."""

    name: str
    columns: tuple[str, ...]
    workload: str | None


def describe_columns(table: pd.DataFrame) -> tuple[Column, ...]:
    return tuple(_describe(str(name), table[name]) for name in table.columns)


def views_of(table: pd.DataFrame) -> tuple[View, ...]:
    """One view a workload of the table, with the columns that have values; then what makes points trustworthy, and one
    of everything."""
    identity = [name for name in IDENTITY if name in table] + settings_that_vary(table, IDENTITY)
    views = []
    for workload in WORKLOADS:
        rows = workload_rows(table, workload.name)
        own = [
            column.name
            for column in workload.columns
            if column.name not in identity and rows[column.name].notna().any()
        ]
        if own:
            views.append(View(workload.name, (*identity, *own), workload.name))
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
