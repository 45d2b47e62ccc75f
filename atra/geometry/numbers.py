"""Checks and conversions of numbers and vectors that users give."""

from __future__ import annotations

from math import inf, isfinite, nan
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.whole_numbers import is_whole_number

Vector = tuple[float, float, float]
"""Three floats of Python."""


def as_number(value: Any) -> float:
    """`value` as a float; NaN, which no range contains, if it is no number."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return nan


def checked_positive(name: str, value: object, what: str) -> float:
    """`value` as a float; raises InputError naming it unless it is finite and above 0."""
    number = as_number(value)
    if not 0.0 < number < inf:
        raise InputError(f"{name} is {value!r}, expected a finite {what} above 0")
    return number


def checked_angle(name: str, value: object) -> float:
    """`value` as a float; raises InputError naming it unless it lies between 0 and 180 degrees."""
    angle = as_number(value)
    if not 0.0 < angle < 180.0:
        raise InputError(f"{name} is {value!r}, expected an angle between 0 and 180 degrees")
    return angle


def checked_pixels(name: str, value: object) -> int:
    """`value` as an int of Python; raises InputError naming it unless it is a whole number of at least 1."""
    if not is_whole_number(value) or value < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
    return int(value)  # NumPy's small integers would overflow in products


def checked_array(name: str, given: ArrayLike, expected: str, *shapes: tuple[int, ...]) -> NDArray[np.float64]:
    """`given` as float64; raises InputError naming it unless it has one of `shapes` and holds finite real numbers."""
    try:
        array = np.asarray(given)
        if array.dtype.kind not in "iuf":
            raise TypeError(f"it has dtype {array.dtype}")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array of real numbers: {error}") from None
    if array.shape not in shapes:
        raise InputError(f"{name} has shape {array.shape}, expected {expected}")
    if not np.isfinite(array).all():
        raise InputError(f"{name} is {array.tolist()}, expected finite numbers")
    return array.astype(np.float64)


def as_vector(array: NDArray[np.float64]) -> Vector:
    """Three numbers of an array (3,) as floats of Python."""
    x, y, z = array.tolist()
    return x, y, z


def unit_vector(name: str, vector: ArrayLike) -> NDArray[np.float64]:
    """(3,) float64, three finite numbers scaled to length 1. Raises InputError, naming them, if all are zero."""
    components = np.asarray(vector, np.float64)
    largest = np.abs(components).max()
    if largest == 0.0:
        raise InputError(f"{name} is {tuple(components.tolist())}, expected a direction of non-zero length")
    # Squares of very large or small numbers would leave float64; scaling by a power of two is exact.
    scaled = np.ldexp(components, -np.frexp(largest)[1])
    return np.asarray(scaled / np.linalg.norm(scaled))


def checked_vector(name: str, value: object) -> Vector:
    """`value` as three finite floats; raises InputError naming it otherwise."""
    try:
        x, y, z = (float(v) for v in value)  # type: ignore[attr-defined]
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is {value!r}, expected three numbers") from None
    if not (isfinite(x) and isfinite(y) and isfinite(z)):
        raise InputError(f"{name} is {(x, y, z)}, expected finite numbers")
    return x, y, z


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The cross product of two vectors, (3,) each, to the bit as `np.cross`, which takes far longer for one pair."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
