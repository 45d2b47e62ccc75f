"""Rays and triangles, decided without rounding."""

from __future__ import annotations

from atra.compiled.store import kernel
from atra.exact.lines_kernels import crossing_sign, major_axis, plane_sign


@kernel
def decide_crossings(corners, origins, directions, ray_ids, prim_ids, exact, crosses):  # type: ignore[no-untyped-def]
    """Write whether rays cross triangles in front of their origins, (M,) bool, of M pairs.

    corners: (F, 3, 3) float64. origins, directions: (N, 3) float64. ray_ids, prim_ids: (M,) int64. exact: (PARTS,)
    float64, memory.
    """
    for i in range(len(ray_ids)):
        origin, direction, corner = origins[ray_ids[i]], directions[ray_ids[i]], corners[prim_ids[i]]
        o, d = (origin[0], origin[1], origin[2]), (direction[0], direction[1], direction[2])
        p, q, r = (
            (corner[0, 0], corner[0, 1], corner[0, 2]),
            (corner[1, 0], corner[1, 1], corner[1, 2]),
            (corner[2, 0], corner[2, 1], corner[2, 2]),
        )
        sign = crossing_sign(o, d, p, q, r, major_axis(d[0], d[1], d[2]), exact.ctypes.data)
        crosses[i] = sign != 0 and plane_sign(o, d, p, q, r, 0.0, exact.ctypes.data) != -sign
