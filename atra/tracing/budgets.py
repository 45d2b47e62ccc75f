"""Budgets of memory: what copies, images and results need, compared with what is free before they are made."""

from __future__ import annotations

import psutil

from atra.errors import InputError, MemoryBudgetError

PLAN_BYTES_PER_COPY = 3 * 12 + 12 + 8
"""Vertices, indices, record."""


EMBREE_BYTES_PER_COPY = {"low": 110, "medium": 110, "high": 160}
"""Growth of the process per triangle at the peak of a build, rounded up."""


def check_memory_budget(copies: int, cell_count: int, build_quality: str, budget_bytes: int | None) -> None:
    """Raise MemoryBudgetError if so many copies would exceed the budget, the memory that is free now, or the 2^32
    vertices Embree can number. budget_bytes: None for no budget."""
    if 3 * copies >= 2**32:
        raise MemoryBudgetError(f"{copies:,} triangle copies over {cell_count:,} cells are more than Embree can index")
    needed = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY[build_quality])
    what = f"{copies:,} triangle copies over {cell_count:,} cells"
    check_needed_bytes(needed, budget_bytes, what, "use fewer cells, culling, or more memory")


def check_needed_bytes(needed: int, budget_bytes: int | None, what: str, cure: str) -> None:
    """Raise MemoryBudgetError if `needed` bytes exceed the budget or the memory that is free now.

    what: the thing that needs them, in the plural; cure: what to do. budget_bytes: None for no budget.
    """
    free = psutil.virtual_memory().available
    for which, limit in (("the memory budget is", budget_bytes), ("the machine has free only", free)):
        if limit is not None and needed > limit:
            raise MemoryBudgetError(
                f"{what} need about {needed / 2**30:.1f} GiB, {which} {limit / 2**30:.1f} GiB; {cure}"
            )


def check_image_size(rows: int, row_stride: int) -> None:
    """Raise InputError if the output has more pixels, rows `row_stride` apart, than a record can count."""
    if rows * row_stride >= 2**31:
        raise InputError(f"an output of {rows} rows of {row_stride} pixels is too large, expected below 2^31 pixels")


def check_image_memory(rows: int, width: int) -> None:
    """Raise MemoryBudgetError if the depth and prim_id of so many pixels are more than the memory that is free."""
    what = f"depth and prim_id of {rows:,} rows of {width:,} pixels"
    check_needed_bytes(rows * width * 8, None, what, "use fewer pixels, or more memory")
