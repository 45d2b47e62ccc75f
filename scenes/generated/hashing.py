"""Numbers that look random and are the same on every machine: hashes of integers, as multiples of 2^-24.

Scenes made of them use additions, products, quotients and square roots of float64, element by element. IEEE 754 fixes
the last bit of each. Sines, powers and matrix products would follow the machine's libraries.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def uniform(index: NDArray[np.integer], channel: int) -> Floats:
    """Numbers in [0, 1), one for each index; channels are independent of one another.

    Source: the finaliser of SplitMix64 (Steele, Lea and Flood 2014).
    """
    with np.errstate(over="ignore"):
        x = index.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(
            (channel + 1) * 0xD1B54A32D192ED03 & 0xFFFFFFFFFFFFFFFF
        )
        x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        x ^= x >> np.uint64(31)
    return (x >> np.uint64(40)).astype(np.float64) * 2.0**-24


def points(count: int, channel: int) -> Floats:
    """(count, 3) in the cube from -1 to 1; takes three channels."""
    index = np.arange(count, dtype=np.uint64)
    return np.stack([2.0 * uniform(index, channel + axis) - 1.0 for axis in range(3)], axis=1)


def unit(vectors: Floats) -> Floats:
    """The vectors (N, 3) at length 1; the longest axis of a zero vector does not matter, so it is left at zero."""
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    length = np.sqrt(x * x + y * y + z * z)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0)[:, None])


def cube_root_step(count: int) -> float:
    """A power of two near count^(-1/3): the size of each of so many things that share a unit cube."""
    return 0.5 ** ((count.bit_length() + 1) // 3)
