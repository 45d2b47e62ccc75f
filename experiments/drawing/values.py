"""Columns of a table as numbers to draw."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

MILLISECONDS = 1e3
MEBIBYTES = 2.0**-20


def column(table: pd.DataFrame, name: str) -> pd.Series:
    """The column, or missing values where an older table has none."""
    return table[name] if name in table else pd.Series(pd.NA, index=table.index, dtype="object")


def numbers(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """The column as float64, NaN where missing."""
    return pd.to_numeric(column(table, name), errors="coerce").to_numpy(np.float64, na_value=np.nan)


def only_measured(table: pd.DataFrame, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values, NaN in rows that were skipped, failed or left out as unsteady; (N,) float64."""
    return np.where(table["status"].eq("ok").fillna(False).to_numpy(bool), values, np.nan)


def interval(table: pd.DataFrame, name: str, factor: float = 1.0) -> tuple[NDArray[np.float64], ...]:
    """A quantity and the ends of its interval. name: of the columns, with {} before the unit, "render_time{}_s"."""
    return tuple(numbers(table, name.format(end)) * factor for end in ("", "_low", "_high"))


def row_interval(row: pd.Series, name: str, factor: float = 1.0) -> tuple[float, float, float]:
    """The same of one row."""
    value, low, high = (float(end[0]) for end in interval(row.to_frame().T, name, factor))
    return value, low, high


def varies(table: pd.DataFrame, name: str) -> bool:
    """The column holds more than one value."""
    return bool(column(table, name).nunique() > 1)


def drawable(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which values a logarithmic axis can show."""
    return np.isfinite(values) & (values > 0)


def say_number(value: float) -> str:
    """Three digits, or all before the point."""
    if value == 0:
        return "0"
    return f"{value:,.0f}" if value >= 99.95 else f"{value:#.3g}".rstrip(".")


def say_things(count: int, thing: str) -> str:
    """`count` of a thing, such as "1 pixel" or "1,200 pixels"."""
    return f"{count:,} {thing}" + "s" * (count != 1)
