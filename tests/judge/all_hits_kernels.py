"""All crossings of rays, found by testing every ray against every triangle in float64."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit

DECIDABLE = 1e-11
"""Least size of a volume, relative to its largest product, at which float64 is sure of its sign."""

_CHUNK = 64
"""Rays that a thread takes at a time."""


@njit(forceinline=True)
def _cross(ax, ay, az, bx, by, bz):  # type: ignore[no-untyped-def]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@njit(forceinline=True)
def _length(x, y, z):  # type: ignore[no-untyped-def]
    return np.sqrt(x * x + y * y + z * z)


@kernel
def judge_rays(  # type: ignore[no-untyped-def]
    counter_address, origins, directions, corners, edges_1, edges_2, limits, sure, unsure, nearer, thickness, products
):
    """Count the crossings of every ray; threads share rays.

    origins, directions: (N, 3) float64. corners, edges_1, edges_2: (F, 3) float64, in the rays' space. limits: (N,)
    float64, ray parameters. sure, nearer: (N,) int64, sure hits, and those of them before the limit. unsure: (N,)
    int64, hits that float64 cannot decide. thickness: (N,) float64, over sure hits, the sum of parameters where the ray
    leaves minus those where it enters. products: (N,) float64, the sum of the parameters' largest products over their
    divisors, to which rounding is relative.
    """
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(directions):
            return
        for ray in range(start, min(start + _CHUNK, len(directions))):
            ox, oy, oz = origins[ray, 0], origins[ray, 1], origins[ray, 2]
            dx, dy, dz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
            size = _length(dx, dy, dz)
            sure[ray] = unsure[ray] = nearer[ray] = 0
            thickness[ray] = products[ray] = 0.0
            for triangle in range(len(corners)):
                ax, ay, az = edges_1[triangle, 0], edges_1[triangle, 1], edges_1[triangle, 2]
                bx, by, bz = edges_2[triangle, 0], edges_2[triangle, 1], edges_2[triangle, 2]
                tx, ty, tz = ox - corners[triangle, 0], oy - corners[triangle, 1], oz - corners[triangle, 2]
                px, py, pz = _cross(dx, dy, dz, bx, by, bz)
                qx, qy, qz = _cross(tx, ty, tz, ax, ay, az)
                facing = px * ax + py * ay + pz * az
                u, v = px * tx + py * ty + pz * tz, dx * qx + dy * qy + dz * qz
                ahead = bx * qx + by * qy + bz * qz
                if facing < 0.0:
                    facing, u, v, ahead, sign = -facing, -u, -v, -ahead, 1.0
                else:
                    sign = -1.0
                longest = max(_length(ax, ay, az), _length(bx, by, bz))
                slack = DECIDABLE * size * longest * (_length(tx, ty, tz) + longest)
                inside = min(u, v, facing - u - v)
                behind = DECIDABLE * longest * longest * _length(tx, ty, tz)
                if inside < -slack or ahead < -behind:
                    continue
                if inside <= slack or ahead <= behind:
                    unsure[ray] += 1
                    continue
                parameter = ahead / facing
                sure[ray] += 1
                nearer[ray] += parameter < limits[ray]
                thickness[ray] += sign * parameter
                products[ray] += longest * longest * (_length(tx, ty, tz) + size * parameter) / facing
