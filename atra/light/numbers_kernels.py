"""Random numbers as hashes of pixel, sample and dimension, so pictures do not depend on the order of work; vectors."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit

_GOLDEN = np.uint32(0x9E3779B9)
_TO_UNIT = np.float32(2.0**-24)
ZERO, HALF, ONE, TWO, FOUR = (np.float32(value) for value in (0.0, 0.5, 1.0, 2.0, 4.0))
_QUARTER_TURN = np.float32(np.pi / 2)
_S3, _S5, _S7, _S9 = (np.float32(value) for value in (-1 / 6, 1 / 120, -1 / 5040, 1 / 362880))
_C4, _C6, _C8 = (np.float32(value) for value in (1 / 24, -1 / 720, 1 / 40320))


@njit
def mixed(bits):  # type: ignore[no-untyped-def]
    """A bijective hash of uint32 in which each bit depends on all.

    Source: the constants of C. Wellons, "Prospecting for hash functions", 2018 (lowbias32).
    """
    bits = np.uint32(bits ^ (bits >> np.uint32(16)))
    bits = np.uint32(bits * np.uint32(0x7FEB352D))
    bits = np.uint32(bits ^ (bits >> np.uint32(15)))
    bits = np.uint32(bits * np.uint32(0x846CA68B))
    return np.uint32(bits ^ (bits >> np.uint32(16)))


@njit
def key_of(pixel, sample_key):  # type: ignore[no-untyped-def]
    """A uint32 key for a sample of a pixel."""
    return mixed(np.uint32(np.uint32(pixel) ^ np.uint32(sample_key)))


@njit
def bits_of(key, dimension):  # type: ignore[no-untyped-def]
    """uint32, a key's random bits for a dimension."""
    return mixed(np.uint32(key + np.uint32(dimension) * _GOLDEN))


@njit
def unit_of(bits):  # type: ignore[no-untyped-def]
    """uint32 -> float32 in [0, 1)."""
    return np.float32(np.uint32(bits) >> np.uint32(8)) * _TO_UNIT


@njit
def circle(turns):  # type: ignore[no-untyped-def]
    """(cos, sin) of an angle of 0 to 1 turns, to about 1e-7: polynomials, which vectorise."""
    quarters = np.floor(FOUR * turns + HALF)
    angle = (FOUR * turns - quarters) * _QUARTER_TURN
    square = angle * angle
    sine = angle * (ONE + square * (_S3 + square * (_S5 + square * (_S7 + square * _S9))))
    cosine = ONE + square * (-HALF + square * (_C4 + square * (_C6 + square * _C8)))
    quadrant = np.int32(quarters)
    swapped = quadrant & np.int32(1) != 0
    x = sine if swapped else cosine
    y = cosine if swapped else sine
    x = -x if (quadrant + np.int32(1)) & np.int32(2) != 0 else x
    y = -y if quadrant & np.int32(2) != 0 else y
    return x, y


@njit
def on_sphere(u, v):  # type: ignore[no-untyped-def]
    """(u, v) in the unit square -> a unit vector, uniform over the sphere."""
    z = ONE - TWO * u
    radius = np.sqrt(max(ZERO, ONE - z * z))
    x, y = circle(v)
    return radius * x, radius * y, z


@njit(forceinline=True)
def vector(rows, first, index):  # type: ignore[no-untyped-def]
    """Three numbers of a column, from row `first` on."""
    return rows[first, index], rows[first + 1, index], rows[first + 2, index]


@njit(forceinline=True)
def set_vector(rows, first, index, value):  # type: ignore[no-untyped-def]
    """Write three numbers to a column, from row `first` on."""
    rows[first, index], rows[first + 1, index], rows[first + 2, index] = value


@njit
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def along(a, length, b):  # type: ignore[no-untyped-def]
    """a + length b."""
    return a[0] + length * b[0], a[1] + length * b[1], a[2] + length * b[2]


@njit
def scaled(factor, a):  # type: ignore[no-untyped-def]
    return factor * a[0], factor * a[1], factor * a[2]


@njit(error_model="numpy")
def unit(a):  # type: ignore[no-untyped-def]
    return scaled(ONE / np.sqrt(dot(a, a)), a)


@njit
def around(normal, direction):  # type: ignore[no-untyped-def]
    """A direction uniform over the sphere -> one distributed as its cosine with the normal.

    Source: P. Shirley, "Ray Tracing in One Weekend": a unit sphere that touches the surface.
    """
    moved = along(normal, ONE, direction)
    return unit(moved) if dot(moved, moved) > np.float32(1e-6) else normal


LUMINANCE = 0.2126, 0.7152, 0.0722
"""Weights of linear sRGB's channels (Rec. 709)."""

_RED, _GREEN, _BLUE = (np.float32(weight) for weight in LUMINANCE)


@njit(forceinline=True)
def luminance(colour):  # type: ignore[no-untyped-def]
    return _RED * colour[0] + _GREEN * colour[1] + _BLUE * colour[2]
