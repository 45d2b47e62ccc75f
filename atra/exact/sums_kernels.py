"""Sums and products of float64 without rounding: lists of parts that do not overlap, ascending in size.

Source: J. R. Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates", 1997.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.compiled.vectors import multiply_add

UNIT = np.float64(2.0**-53)
"""Largest relative error of one rounding in float64."""

out_of_line = njit(forceinline=False)
"""As `njit`, for what a loop calls rarely: it is not copied into its callers. Numba hands `forceinline` on to all that
a function calls, so each loop over rays had hundreds of copies of exact sums and took minutes to compile."""


@njit(forceinline=True)
def add(sum_, count, part):  # type: ignore[no-untyped-def]
    """Add a number to an exact sum of `count` parts, none of them 0; returns the new count."""
    kept = 0
    for k in range(count):
        total = part + sum_[k]
        other = total - part
        rest = (part - (total - other)) + (sum_[k] - other)
        part = total
        if rest != 0.0:
            sum_[kept] = rest
            kept += 1
    if part != 0.0:
        sum_[kept] = part
        kept += 1
    return kept


@out_of_line
def add_product(sum_, count, a, b):  # type: ignore[no-untyped-def]
    """Add a b."""
    high = a * b
    return add(sum_, add(sum_, count, multiply_add(a, b, -high)), high)


@out_of_line
def add_triple(sum_, count, a, b, c):  # type: ignore[no-untyped-def]
    """Add a b c."""
    high = a * b
    low = multiply_add(a, b, -high)
    if low != 0.0:
        count = add_product(sum_, count, low, c)
    return add_product(sum_, count, high, c) if high != 0.0 else count


@njit(forceinline=True)
def sign_of(sum_, count):  # type: ignore[no-untyped-def]
    """The sign, -1, 0 or 1, of an exact sum: that of its largest part."""
    largest = sum_[count - 1] if count else 0.0
    return 1 if largest > 0.0 else -1 if largest < 0.0 else 0


@njit(forceinline=True)
def value_of(sum_, count):  # type: ignore[no-untyped-def]
    """An exact sum, rounded."""
    value = 0.0
    for k in range(count):
        value += sum_[k]
    return value
