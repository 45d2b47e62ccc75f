"""Brute force: every ray is tested against every triangle in float64.

The arithmetic is that of the tests' plainer reference, operation by operation, so that both find the same triangles;
only the divisions are postponed until a ray comes near a triangle.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.exact.intersection import FLOAT64_TOLERANCE, NOISE
from atra.prim_ids import MISS

_NEAR = 1e-9
"""Tolerance of the test without divisions, a share of the determinant; above FLOAT64_TOLERANCE, so it loses no hit."""

_BLOCK = 128
"""Rays per pass over the triangles, few enough for the first-level cache."""

_MISS = int(MISS)


@njit(forceinline=True)
def _cross(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(forceinline=True)
def _dot(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    return ax * bx + ay * by + az * bz


@kernel
def nearest_triangles(counter_address, origins, directions, corners, edges_1, edges_2, eye_square, depth, prim_id):  # type: ignore[no-untyped-def]
    """Find the nearest triangle of every ray; threads share blocks of rays.

    origins, directions: (3, N) float64. corners, edges_1, edges_2: (F, 3) float64, first corner and the edges leaving
    it, in the rays' space. eye_square: squared length of what was subtracted from all positions. depth: (N,) float64
    and prim_id: (N,) uint32 are written completely, inf and MISS = no hit.
    """
    count = directions.shape[1]
    ox, oy, oz = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    dx, dy, dz = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    while True:
        start = fetch_add(counter_address, 1) * _BLOCK
        if start >= count:
            return
        end = min(start + _BLOCK, count)
        for i in range(_BLOCK):
            ray = min(start + i, end - 1)  # the last block is filled up with its last ray
            ox[i], oy[i], oz[i] = origins[0, ray], origins[1, ray], origins[2, ray]
            dx[i], dy[i], dz[i] = directions[0, ray], directions[1, ray], directions[2, ray]
        depth[start:end] = np.inf
        prim_id[start:end] = _MISS
        for triangle in range(len(corners)):
            cx, cy, cz = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
            ax, ay, az = edges_1[triangle, 0], edges_1[triangle, 1], edges_1[triangle, 2]
            bx, by, bz = edges_2[triangle, 0], edges_2[triangle, 1], edges_2[triangle, 2]
            anyone_near = False
            for i in range(_BLOCK):  # no branches, so that it becomes vector code
                px, py, pz = _cross(dx[i], dy[i], dz[i], bx, by, bz)
                determinant = _dot(px, py, pz, ax, ay, az)
                tx, ty, tz = ox[i] - cx, oy[i] - cy, oz[i] - cz
                qx, qy, qz = _cross(tx, ty, tz, ax, ay, az)
                u, v = _dot(px, py, pz, tx, ty, tz), _dot(dx[i], dy[i], dz[i], qx, qy, qz)
                rest = determinant - u - v
                near = _NEAR * abs(determinant)
                anyone_near |= ((u >= -near) & (v >= -near) & (rest >= -near)) | (
                    (u <= near) & (v <= near) & (rest <= near)
                )
            if not anyone_near:
                continue
            area = _dot(ax, ay, az, ax, ay, az), _dot(bx, by, bz, bx, by, bz)
            for i in range(end - start):
                px, py, pz = _cross(dx[i], dy[i], dz[i], bx, by, bz)
                determinant = _dot(px, py, pz, ax, ay, az)
                size = np.sqrt(_dot(dx[i], dy[i], dz[i], dx[i], dy[i], dz[i]) * area[0] * area[1])
                if abs(determinant) <= NOISE * size:
                    continue
                tx, ty, tz = ox[i] - cx, oy[i] - cy, oz[i] - cz
                qx, qy, qz = _cross(tx, ty, tz, ax, ay, az)
                ahead = _dot(bx, by, bz, qx, qy, qz)
                reach = _dot(tx, ty, tz, tx, ty, tz) + eye_square
                if abs(ahead) <= NOISE * np.sqrt(reach * area[0] * area[1]):
                    continue
                u = _dot(px, py, pz, tx, ty, tz) / determinant
                v = _dot(dx[i], dy[i], dz[i], qx, qy, qz) / determinant
                t = ahead / determinant
                inside = min(min(u, v), 1.0 - u - v) >= -FLOAT64_TOLERANCE and t > 0.0
                if inside and t < depth[start + i] * (1.0 - FLOAT64_TOLERANCE):
                    depth[start + i] = t
                    prim_id[start + i] = triangle
