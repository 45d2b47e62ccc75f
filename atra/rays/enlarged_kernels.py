"""Triangles enlarged in their planes, so that Embree's float32 loses no hit, and the hits that are in doubt then."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numba import types

from atra.compiled.intrinsics import address_at, float_at, int32_at, uint32_at
from atra.compiled.memory import store
from atra.compiled.store import callback, kernel, njit
from atra.compiled.vectors import repeated
from atra.embree.filters_kernels import CONTEXT, HIT, RAY, RAY_COUNT, VALID, refuse
from atra.embree.layout import (
    HIT_NG_X,
    HIT_PRIM_ID,
    HIT_U,
    HIT_V,
    RAY_DIR_X,
    RAY_ID,
    RAY_ORG_X,
    RAY_ORG_Y,
    RAY_ORG_Z,
    RayQueryContext,
)

DOUBT = np.uint32(0xFFFFFFFE)
"""In place of a prim_id: the ray has to be decided without rounding."""

NOWHERE = np.uint32(0xFFFFFFFF)
"""A corner that no mesh has: Embree leaves out the triangles that name it, and the others keep their numbers."""

_FINE = 0.5
"""Larger shares by which a triangle would have to grow make it one that only encloses the mesh's."""

_TARGET = RayQueryContext.target_address.offset


EDGE_ON = 2.0**-5
"""Cosine between a ray and a triangle's normal below which a hit is in doubt: the error grows as its reciprocal."""


class Doubts(NamedTuple):
    """Which hits are in doubt. rims: address of a float32 for each triangle, the least barycentric weight of a hit that
    is not. x, y, z: the mesh's middle, which is Embree's origin, so that vertices there are rounded little. Rays that
    start farther than `reach` from it are in doubt whatever they hit."""

    rims: int
    x: np.float32
    y: np.float32
    z: np.float32
    reach: np.float32


@njit(forceinline=True)
def move_ray(packet, width, lane, doubts):  # type: ignore[no-untyped-def]
    """Let a lane's ray start where it does as seen from the mesh's middle."""
    packet.floats[RAY_ORG_X * width + lane] -= doubts.x
    packet.floats[RAY_ORG_Y * width + lane] -= doubts.y
    packet.floats[RAY_ORG_Z * width + lane] -= doubts.z


@njit(forceinline=True)
def is_far(packet, width, lane, reach):  # type: ignore[no-untyped-def]
    """Whether a ray starts so far away that float32 loses more than triangles were enlarged by."""
    x, y = abs(packet.floats[RAY_ORG_X * width + lane]), abs(packet.floats[RAY_ORG_Y * width + lane])
    return not max(x, y, abs(packet.floats[RAY_ORG_Z * width + lane])) <= reach


@njit(forceinline=True)
def is_doubtful(hit, ray, lane_bytes, rims):  # type: ignore[no-untyped-def]
    """Whether a hit lies on its triangle's rim, or is seen all but edge-on.

    hit, ray: addresses of a lane's first numbers in a packet. lane_bytes: of a field of all lanes.
    """
    u, v = float_at(hit + HIT_U * lane_bytes), float_at(hit + HIT_V * lane_bytes)
    rim = float_at(rims + 4 * np.int64(uint32_at(hit + HIT_PRIM_ID * lane_bytes)))
    facing, normal, way = 0.0, 0.0, 0.0
    for axis in range(3):
        n = np.float64(float_at(hit + (HIT_NG_X + axis) * lane_bytes))
        d = np.float64(float_at(ray + (RAY_DIR_X + axis) * lane_bytes))
        facing, normal, way = facing + n * d, normal + n * n, way + d * d
    is_inside = min(u, v, np.float32(1.0) - u - v) >= rim
    return not (is_inside and facing * facing >= EDGE_ON * EDGE_ON * normal * way)


@kernel
def measure_triangles(vertices, faces, kept, heights):  # type: ignore[no-untyped-def]
    """Write the least height of each triangle, (F,) float64; 0 for those that are not kept."""
    for face in range(len(faces)):
        heights[face] = 0.0
        if kept[face]:
            longest = 0.0
            for k in range(3):
                square = 0.0
                for axis in range(3):
                    way = np.float64(vertices[faces[face, k], axis]) - vertices[faces[face, k - 1], axis]
                    square += way * way
                longest = max(longest, square)
            _, e, f = _edges(vertices, faces, face)
            n = _cross(e, f)
            if longest > 0.0:
                heights[face] = np.sqrt(_square(n) / longest)


@njit
def _edges(vertices, faces, face):  # type: ignore[no-untyped-def]
    i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
    a = np.float64(vertices[i, 0]), np.float64(vertices[i, 1]), np.float64(vertices[i, 2])
    e = vertices[j, 0] - a[0], vertices[j, 1] - a[1], vertices[j, 2] - a[2]
    return a, e, (vertices[k, 0] - a[0], vertices[k, 1] - a[1], vertices[k, 2] - a[2])


@njit
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def enlarge_triangles(vertices, faces, origin, heights, margins, corners, numbers, rims):  # type: ignore[no-untyped-def]
    """Write triangles of three corners of their own, larger than those of the mesh on all sides by `margins`.

    origin: (3,) float64, from which their corners are seen.
    heights, margins: (F,) float64, the least height of each triangle, 0: it is left out. corners: (F, 3, 3) float32.
    numbers: (F, 3) uint32, which corners Embree is to take. rims: (F,) float32, as of `Doubts`.
    """
    for face in range(len(faces)):
        a, e, f = _edges(vertices, faces, face)
        a = a[0] - origin[0], a[1] - origin[1], a[2] - origin[2]
        share = 3.0 * margins[face] / heights[face] if heights[face] > 0.0 else 0.0
        for k in range(3):
            numbers[face, k] = 3 * face + k if heights[face] > 0.0 else NOWHERE
        if share > _FINE:
            _enclose(a, e, f, 2.0 * margins[face], corners[face])
            rims[face] = 1.0
            continue
        rims[face] = 2.0 * share / (3.0 * (1.0 + share))  # as far inside of the triangle as the larger one lies outside
        for axis in range(3):
            middle = a[axis] + (e[axis] + f[axis]) / 3.0
            corners[face, 0, axis] = middle + (a[axis] - middle) * (1.0 + share)
            corners[face, 1, axis] = middle + (a[axis] + e[axis] - middle) * (1.0 + share)
            corners[face, 2, axis] = middle + (a[axis] + f[axis] - middle) * (1.0 + share)


@njit
def _enclose(a, e, f, margin, corners):  # type: ignore[no-untyped-def]
    """Write a triangle around another's rectangle along its longest edge, `margin` wider on all sides."""
    g = f[0] - e[0], f[1] - e[1], f[2] - e[2]
    first, second, third = _square(e), _square(f), _square(g)
    start, along, other = a, e, f
    if second > first and second >= third:
        start, along, other = a, f, e
    elif third > first:
        start, along, other = (a[0] + e[0], a[1] + e[1], a[2] + e[2]), g, (-e[0], -e[1], -e[2])
    normal = _cross(along, other)
    across = _cross(normal, along)
    long, high = np.sqrt(_square(along)), np.sqrt(_square(across))
    height = np.sqrt(_square(normal)) / long
    for axis in range(3):
        x, y = along[axis] / long, across[axis] / high
        corner = start[axis] - margin * (x + y)
        corners[0, axis] = corner
        corners[1, axis] = corner + 2.0 * (long + 2.0 * margin) * x
        corners[2, axis] = corner + 2.0 * (height + 2.0 * margin) * y


@njit
def _square(a):  # type: ignore[no-untyped-def]
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@cache
def doubt_filter(width: int) -> int:
    """Address of the filter that rejects hits in doubt and sets the id of their rays to 1, for packets of `width`.

    The context's target is the address of `Doubts.rims`.
    """
    lane_bytes = 4 * width

    @callback(types.void(types.int64))
    def leave_doubts(arguments):  # type: ignore[no-untyped-def]
        context, valid = address_at(arguments + CONTEXT), address_at(arguments + VALID)
        given = uint32_at(arguments + RAY_COUNT)
        if given != np.uint32(width):
            refuse(context, valid, given)
            return
        ray, hit, rims = address_at(arguments + RAY), address_at(arguments + HIT), address_at(context + _TARGET)
        for lane in range(0, 4 * width, 4):
            if int32_at(valid + lane) != 0 and is_doubtful(hit + lane, ray + lane, lane_bytes, rims):
                store(repeated(np.int32(0), 1), valid + lane)
                store(repeated(np.uint32(1), 1), ray + RAY_ID * lane_bytes + lane)

    _keep_alive.append(leave_doubts)
    return leave_doubts.address


# Embree may call these as long as a scene lives; compiled code must never be collected.
_keep_alive: list[object] = []
