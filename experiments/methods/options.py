"""Options that several methods have, and what rows are called that were measured with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from functools import partial
from inspect import signature
from typing import Any

from experiments.harness.column import WHOLE, Column
from experiments.harness.method import LANES, Tracing
from experiments.harness.options import option, whole


def keywords_of(make: Callable[..., Any], options: Any, tracing: Tracing) -> dict[str, Any]:
    """The keyword arguments of a tracer's constructor that a method's options, or those of the whole point, have."""
    known = {field.name: getattr(options, field.name) for field in fields(options)} | vars(tracing)
    return {name: known[name] for name in signature(make).parameters if name in known}


# What makes a field: a dataclass needs one of its own.
split_x_option = partial(whole, None, "columns of cells", 1)
"""None = the largest power of two up to 128 that divides the width."""
split_y_option = partial(whole, 1, "rows of cells", 1)
packet_width_option = partial(
    option, None, "rays in a packet; 1 = single rays, null = the widest native packets", choices=(1, *LANES)
)
packet_rows_option = partial(
    option, None, "rows of pixels in a packet; null = the best fit for the cell", null="automatic"
)
robust_option = partial(
    option, False, "no ray slips through between two triangles; off: Embree's fast setting, as in the paper"
)
"""The paper, and all tables without the column, measured Embree's fast setting."""


def say_robust(row: Mapping[str, Any]) -> list[str]:
    """What a row is called that was measured with it: nothing where it was not, or is older than the option."""
    return ["robust"] if row.get("robust") in (True,) else []


_LARGEST_DEFAULT_SPLIT = 128

VERIFIED = Column("packets_verified", WHOLE, "packets of pixels traced again in the second pass of a frame")


def split_of(options: Any) -> tuple[int, int]:
    """Columns and rows of cells; the options must be resolved."""
    assert options.split_x is not None
    return options.split_x, options.split_y


def resolve_split(options: Any, width: int) -> Any:
    """The options with split_x set; width & -width is the largest power of two that divides the width."""
    default = min(_LARGEST_DEFAULT_SPLIT, width & -width)
    return options if options.split_x is not None else replace(options, split_x=default)
