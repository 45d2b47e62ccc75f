"""Which columns of the table the page shows together, and in which unit."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from experiments.results.settings import settings_that_vary

IDENTITY = ("scene", "quantity", "geometry", "method", "split_x", "split_y", "culling", "packet_width")
"""Columns that tell one point from another; shown in every view, and with them every other setting that varies."""

VIEWS: dict[str, tuple[str, ...]] = {
    "frame times": (
        "render_time_s", "render_time_low_s", "render_time_high_s", "baseline_render_time_s", "packets_render_time_s",
        "packets_width",
        "speedup", "speedup_low", "speedup_high", "speedup_vs_packets", "speedup_vs_packets_low",
        "speedup_vs_packets_high",
    ),
    "builds": (
        "triangles", "triangles_traced", "plan_time_s", "build_time_s", "build_time_low_s", "build_time_high_s",
        "baseline_build_time_s",
    ),
    "memory": (
        "triangles_traced", "rss_start_bytes", "rss_mesh_bytes", "rss_bytes", "peak_rss_bytes", "embree_bytes",
    ),
    "pixels": (
        "width", "height", "pixels_equal", "pixels_tied", "pixels_edge", "pixels_wrong", "depth_error_max",
        "depth_error_p999", "baseline_depth_error_max", "baseline_depth_error_p999", "images", "method_wrong",
        "baseline_wrong", "rays_sampled", "sampled_method_wrong", "sampled_baseline_wrong",
    ),
    "trust": ("status", "error", "rounds", "render_time_spread_s", "load_average", "doubts", "cpu", "measured_at"),
}  # fmt: skip
"""Columns beside `IDENTITY`, by name of the view. `everything` is added to them by the page."""

_NEED_A_VALUE = {
    "frame times": "render_time_s",
    "builds": "plan_time_s",
    "memory": "rss_bytes",
    "pixels": "pixels_equal",
}
"""A view leaves out the rows without a value in this column: a memory row has no frame time to show."""


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
    """A choice of columns; rows without a value in `needs` are left out, with a count of them."""

    name: str
    columns: tuple[str, ...]
    needs: str | None


def describe_columns(table: pd.DataFrame) -> tuple[Column, ...]:
    return tuple(_describe(str(name), table[name]) for name in table.columns)


def views_of(table: pd.DataFrame) -> tuple[View, ...]:
    """The views that have columns in this table, and one of everything."""
    present = set(table.columns)
    identity = [name for name in IDENTITY if name in present] + settings_that_vary(table, IDENTITY)
    views = []
    for name, columns in VIEWS.items():
        needs = _NEED_A_VALUE.get(name)
        own = tuple(column for column in columns if column in present and column not in identity)
        if own:
            views.append(View(name, (*identity, *own), needs if needs in present else None))
    return (*views, View("everything", tuple(str(name) for name in table.columns), None))


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
