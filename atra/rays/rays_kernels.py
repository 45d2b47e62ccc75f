"""Batches of rays as kernels read them, and whether neighbours in one are coherent."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import float_at
from atra.compiled.memory import doubles_at
from atra.compiled.store import kernel, njit

COHERENT_DIRECTIONS = 0.125
"""Largest difference of the components of coherent directions, whose largest component is 1 to 2."""


class RayBatch(NamedTuple):
    """Rays, one after the other: where their numbers lie in memory.

    origins, directions: address of the first ray's three numbers; a ray's are `vector_bytes` behind those of the one
    before. tnear, tfar: address of the first ray's, in lengths of the direction; the next is `number_bytes` behind.
    is_double: whether they are float64, otherwise float32.
    """

    origins: int
    directions: int
    vector_bytes: int
    tnear: int
    tfar: int
    number_bytes: int
    is_double: bool


def batch_of(
    origins: NDArray[np.floating], directions: NDArray[np.floating], tnear: NDArray[np.floating], tfar: NDArray
) -> RayBatch:
    """Rays as kernels read them; the arrays must stay alive meanwhile."""
    starts = origins.ctypes.data, directions.ctypes.data, origins.strides[0]
    return RayBatch(*starts, tnear.ctypes.data, tfar.ctypes.data, tnear.strides[0], origins.dtype == np.float64)


@njit(forceinline=True)
def vector_at(address, is_double):  # type: ignore[no-untyped-def]
    """Three float64, or float32 made such."""
    if is_double:
        at = doubles_at(address)
        return at[0], at[1], at[2]
    return np.float64(float_at(address)), np.float64(float_at(address + 4)), np.float64(float_at(address + 8))


@njit(forceinline=True)
def origin_of(rays, ray):  # type: ignore[no-untyped-def]
    return vector_at(rays.origins + rays.vector_bytes * ray, rays.is_double)


@njit(forceinline=True)
def direction_of(rays, ray):  # type: ignore[no-untyped-def]
    return vector_at(rays.directions + rays.vector_bytes * ray, rays.is_double)


@njit(forceinline=True)
def interval_of(rays, ray):  # type: ignore[no-untyped-def]
    """(tnear, tfar) of a ray, float64."""
    near, far = rays.tnear + rays.number_bytes * ray, rays.tfar + rays.number_bytes * ray
    if rays.is_double:
        return doubles_at(near)[0], doubles_at(far)[0]
    return np.float64(float_at(near)), np.float64(float_at(far))


@njit(forceinline=True)
def scale_of(x, y, z):  # type: ignore[no-untyped-def]
    """(scale, 1 / scale): the power of two that brings a direction to a largest component of 1 to 2."""
    largest = np.float64(max(abs(x), abs(y), abs(z)))
    bits = largest.view(np.int64) & 0x7FF0000000000000
    return np.int64(0x7FE0000000000000 - bits).view(np.float64), np.int64(bits).view(np.float64)


@njit(forceinline=True)
def scaled_ray(rays, ray):  # type: ignore[no-untyped-def]
    """(o, d, tnear, tfar, scale) of a ray in float64, its direction multiplied by `scale_of`; parameters times `scale`
    are those of the ray as given."""
    x, y, z = direction_of(rays, ray)
    tnear, tfar = interval_of(rays, ray)
    scale, length = scale_of(x, y, z)
    return origin_of(rays, ray), (x * scale, y * scale, z * scale), tnear * length, tfar * length, scale


@njit(forceinline=True)
def are_coherent(rays, first, count, near_by):  # type: ignore[no-untyped-def]
    """Whether `count` rays start within `near_by` of the first one and head the same way, as neighbours of a camera
    do."""
    x, y, z = origin_of(rays, first)
    u, v, w = direction_of(rays, first)
    scale, _ = scale_of(u, v, w)
    for ray in range(first + 1, first + count):
        a, b, c = origin_of(rays, ray)
        moved = max(abs(a - x), abs(b - y), abs(c - z))
        a, b, c = direction_of(rays, ray)
        turned = max(abs(a - u), abs(b - v), abs(c - w)) * scale
        if not (turned <= COHERENT_DIRECTIONS and moved <= near_by):
            return False
    return True


@kernel
def coherent_places(rays, count, places, neighbours, near_by):  # type: ignore[no-untyped-def]
    """The number of places, of so many that lie evenly over a batch of `count` rays, whose neighbours are coherent."""
    coherent = 0
    for place in range(places):
        first = (count - neighbours) * place // (places - 1)
        coherent += are_coherent(rays, first, neighbours, near_by)
    return coherent


@kernel
def first_unfit(vectors, shortest, longest, smallest):  # type: ignore[no-untyped-def]
    """The first of vectors (N, 3) whose largest component is not from `shortest` to `longest` in size; N: all are.
    Components below `smallest` in size become 0."""
    for ray in range(len(vectors)):
        x, y, z = abs(vectors[ray, 0]), abs(vectors[ray, 1]), abs(vectors[ray, 2])
        is_long = (x >= shortest) | (y >= shortest) | (z >= shortest)
        if not (is_long & (x <= longest) & (y <= longest) & (z <= longest)):  # so neither is NaN
            return ray
        if (x < smallest) | (y < smallest) | (z < smallest):
            for axis in range(3):
                if abs(vectors[ray, axis]) < smallest:
                    vectors[ray, axis] = 0.0
    return len(vectors)
