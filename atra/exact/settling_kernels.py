"""Kernel of the tie rule that decides the ties of an image."""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.exact.intersection import FLOAT64_TOLERANCE, NOISE
from atra.exact.ties_kernels import TILE

MANY = 16
"""Partners of a triangle up to which a pixel is tested against all of them, in whichever tile they are."""


@njit(forceinline=True)
def _intersect(vertices, faces, triangle, ox, oy, oz, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Ray parameter (inf = parallel) of a ray's hit on a triangle's plane, and whether it is inside, edges included.

    Möller–Trumbore in float64, as in `atra.exact.intersection`.
    """
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    x, y, z = np.float64(vertices[v0, 0]), np.float64(vertices[v0, 1]), np.float64(vertices[v0, 2])
    ax, ay, az = vertices[v1, 0] - x, vertices[v1, 1] - y, vertices[v1, 2] - z
    bx, by, bz = vertices[v2, 0] - x, vertices[v2, 1] - y, vertices[v2, 2] - z
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    determinant = px * ax + py * ay + pz * az
    size = (dx * dx + dy * dy + dz * dz) * (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz)
    if determinant * determinant <= NOISE * NOISE * size:
        return np.inf, False
    sx, sy, sz = ox - x, oy - y, oz - z
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    u = (px * sx + py * sy + pz * sz) / determinant
    v = (dx * qx + dy * qy + dz * qz) / determinant
    depth = (bx * qx + by * qy + bz * qz) / determinant
    return depth, min(u, v, 1.0 - u - v) >= -FLOAT64_TOLERANCE


@njit(forceinline=True)
def _is_among(numbers, first, end, wanted):  # type: ignore[no-untyped-def]
    """Whether a number is among the ascending numbers[first:end]."""
    while first < end:
        middle = (first + end) // 2
        if numbers[middle] < wanted:
            first = middle + 1
        elif numbers[middle] > wanted:
            end = middle
        else:
            return True
    return False


@kernel
def settle_ties(  # type: ignore[no-untyped-def]
    counter_address, tiles, may_tie, twins, starts, partners, firsts, listed, vertices, faces,
    eye, axes, across, along, directions, is_parallel, tie_tolerance, prim_id,
):  # fmt: skip
    """Store the lowest of the tied triangles in every pixel; threads share rows of tiles.

    tiles: (tile rows, tile columns) bool, those with ties. may_tie, twins, starts, partners: of `CoplanarOverlaps`.
    firsts: (tiles + 1,) int64 and listed: uint32, ascending in each tile: of triangles with more than MANY partners,
    those partners that may be seen in tile t are among listed[firsts[t]:firsts[t + 1]]. Empty: nothing is known.
    vertices: (V, 3) float32, faces: (F, 3) uint32. eye, axes: of the camera. across, along: (W,), (H,) float64,
    distances of columns and rows from the view axis on the image plane. directions: of `lowest_of_ties`, in
    place of these distances. tie_tolerance: relative difference of equal depths. prim_id: (H, W) uint32, changed in
    place.
    """
    height, width = prim_id.shape
    miss = np.uint32(len(may_tie) - 1)
    while True:
        row = fetch_add(counter_address, 1)
        if row >= tiles.shape[0]:
            return
        for column in range(tiles.shape[1]):
            if not tiles[row, column]:
                continue
            for y in range(row * TILE, min((row + 1) * TILE, height)):
                for x in range(column * TILE, min((column + 1) * TILE, width)):
                    hit = min(prim_id[y, x], miss)
                    if not may_tie[hit]:
                        continue
                    lowest = twins[hit]
                    if starts[lowest] < starts[lowest + 1]:
                        begin, end = np.int64(starts[lowest]), np.int64(starts[lowest + 1])
                        among, first, last = partners, begin, end
                        is_listed = len(firsts) > 0 and end - begin > MANY
                        if is_listed:
                            tile = row * tiles.shape[1] + column
                            among, first, last = listed, firsts[tile], firsts[tile + 1]
                        ox, oy, oz, dx, dy, dz = eye[0], eye[1], eye[2], axes[2, 0], axes[2, 1], axes[2, 2]
                        if directions is not None:
                            a, b, c = directions[0, y, x], directions[1, y, x], directions[2, y, x]
                            dx, dy, dz = c * dx, c * dy, c * dz
                        else:
                            a, b = across[x], along[y]
                        sx = axes[0, 0] * a + axes[1, 0] * b
                        sy = axes[0, 1] * a + axes[1, 1] * b
                        sz = axes[0, 2] * a + axes[1, 2] * b
                        if is_parallel:
                            ox, oy, oz = ox + sx, oy + sy, oz + sz
                        else:
                            dx, dy, dz = dx + sx, dy + sy, dz + sz
                        depth, _ = _intersect(vertices, faces, lowest, ox, oy, oz, dx, dy, dz)
                        for place in range(first, last):
                            other, inside = _intersect(vertices, faces, among[place], ox, oy, oz, dx, dy, dz)
                            if (
                                inside
                                and abs(other - depth) <= tie_tolerance * depth
                                and (not is_listed or _is_among(partners, begin, end, among[place]))
                            ):
                                lowest = among[place]
                                break
                    prim_id[y, x] = lowest
