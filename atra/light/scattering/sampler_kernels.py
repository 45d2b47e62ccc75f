"""Sample points of paths: Sobol' points, scrambled by Owen's method again for each pixel and pair of dimensions."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import mixed, unit_of

PAIRS = 4
"""Pairs of numbers for each surface of a path."""

DIRECTION, LOBE, CHOICE, PLACE = 0, 1, 2, 3
"""What they are for: a scattered direction; the kind of scattering, and whether the path goes on; which emitter; where
on it."""

JITTER = 0xFFFF
"""The pair for a place within the pixel."""

APERTURE = 0xFFFE
"""The pair for a place within the aperture."""

LEAST_LEFT, MOST_LEFT = 1.0 / 3.0, 0.5
"""Least and most share of the squared error that is left where the points double. Most: that of independent points."""

_GOLDEN = np.uint32(0x9E3779B9)


@njit(forceinline=True)
def pair_of(key, sample, pair):  # type: ignore[no-untyped-def]
    """Two float32 numbers in [0, 1), the point of number `sample` of a sequence for (key, pair), both uint32.

    Points 0 to 2^k - 1 fall one into each of 2^k equal cells, of any proportions.
    Source: B. Burley, "Practical hash-based Owen scrambling", 2020; the hash is N. Vegdahl's, 2021.
    """
    seed = mixed(np.uint32(key + np.uint32(pair) * _GOLDEN))
    index = _reversed(_scrambled(_reversed(np.uint32(sample)), seed))
    first = _reversed(_scrambled(index, mixed(seed ^ np.uint32(0x68BC21EB))))
    second = _reversed(_scrambled(_second(index), mixed(seed ^ np.uint32(0x02E5BE93))))
    return unit_of(first), unit_of(second)


@njit(forceinline=True)
def _reversed(bits):  # type: ignore[no-untyped-def]
    bits = np.uint32((bits << np.uint32(16)) | (bits >> np.uint32(16)))
    bits = _swapped(bits, np.uint32(8), np.uint32(0x00FF00FF))
    bits = _swapped(bits, np.uint32(4), np.uint32(0x0F0F0F0F))
    bits = _swapped(bits, np.uint32(2), np.uint32(0x33333333))
    return _swapped(bits, np.uint32(1), np.uint32(0x55555555))


@njit(forceinline=True)
def _swapped(bits, shift, mask):  # type: ignore[no-untyped-def]
    return np.uint32(((bits & mask) << shift) | ((bits >> shift) & mask))


@njit(forceinline=True)
def _scrambled(bits, seed):  # type: ignore[no-untyped-def]
    """A hash in which a bit depends on lower ones alone: Owen's scrambling of the number with its bits reversed."""
    bits = np.uint32(bits ^ np.uint32(bits * np.uint32(0x3D20ADEA)))
    bits = np.uint32(bits + seed)
    bits = np.uint32(bits * np.uint32((seed >> np.uint32(16)) | np.uint32(1)))
    bits = np.uint32(bits ^ np.uint32(bits * np.uint32(0x05526C56)))
    return np.uint32(bits ^ np.uint32(bits * np.uint32(0x53A22864)))


@njit(forceinline=True)
def _second(index):  # type: ignore[no-untyped-def]
    """The second coordinate of Sobol's point of a number, its bits reversed: Pascal's triangle modulo 2."""
    index = _folded(index, np.uint32(1), np.uint32(0xAAAAAAAA))
    index = _folded(index, np.uint32(2), np.uint32(0xCCCCCCCC))
    index = _folded(index, np.uint32(4), np.uint32(0xF0F0F0F0))
    index = _folded(index, np.uint32(8), np.uint32(0xFF00FF00))
    return _folded(index, np.uint32(16), np.uint32(0xFFFF0000))


@njit(forceinline=True)
def _folded(index, shift, mask):  # type: ignore[no-untyped-def]
    return np.uint32(index ^ ((index & mask) >> shift))
