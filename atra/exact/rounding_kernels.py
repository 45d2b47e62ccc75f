"""Bounds of float32's error of a triangle's depth, for the triangle itself and its copies on the reference rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import CORNERS, cell_range, find_columns, find_rows

FLOAT32_UNIT = 2.0**-24
"""Largest relative error of one rounding in float32."""

ALLOWED_MULTIPLE = 4.0
"""Factor on the roundings counted here that `atra.judge.compare` allows: a few roundings may add up."""

COPY_RATIO = 2.0
"""Largest ratio of a copy's roundings to those of the mesh itself.

A shift s on the image plane lengthens corners and edges up to 1 + s times, and three lengths go into an error; in a
view of 60 degrees s is at most 0.87.
"""

LEAST_FACING = 5.0
"""Least roundings of `normal . direction`: of the direction's column, row and sum, the product, and the quotient."""

COPY_MULTIPLE, INSTANCE_MULTIPLE = 5.0, 4.0
"""Ratios up to which all roundings of a copy, and of an instance, are accepted in any case.

Triangles such as walls along an axis have almost no roundings themselves, so a ratio alone would refuse their copies.
An instance gets less: its rays are transformed by a matrix that is rounded itself.
"""

MOST_ROUNDINGS = 1024.0
"""Roundings of the mesh itself above which there are no copies: the plane then passes close to the eye."""

SIGN_ROUNDINGS = 2.0**21
"""Roundings of a copy above which a hit behind the eye may come out before it: an eighth of all digits of float32."""

CHUNK = 1024
"""Triangles that a thread takes at a time."""


class ParallelRays(NamedTuple):
    """Parallel rays of an image in ray space; (3,) float64 each except `middle`.

    forward: their direction. column, row: steps from one pixel to the next. middle: (2,) float64, the eye's pixel
    position. farthest: largest distance of a ray's start from the eye, the sizes of its column's and row's parts added.
    """

    forward: NDArray[np.float64]
    column: NDArray[np.float64]
    row: NDArray[np.float64]
    middle: NDArray[np.float64]
    farthest: NDArray[np.float64]


@njit(forceinline=True)
def _enlarge(points, faces, triangle, shear_x, shear_y, depth, largest):  # type: ignore[no-untyped-def]
    """Raise `largest` (4, 3) to the sizes of a sheared triangle, by component: corners, the two edges at the first
    corner, normal. Returns the size of normal . first corner."""
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    z0, z1, z2 = depth[v0, 2], depth[v1, 2], depth[v2, 2]
    px = points[v0, 0] - (shear_x[0] + shear_y[0]) * z0
    py = points[v0, 1] - (shear_x[1] + shear_y[1]) * z0
    pz = points[v0, 2] - (shear_x[2] + shear_y[2]) * z0
    ax = points[v1, 0] - (shear_x[0] + shear_y[0]) * z1 - px
    ay = points[v1, 1] - (shear_x[1] + shear_y[1]) * z1 - py
    az = points[v1, 2] - (shear_x[2] + shear_y[2]) * z1 - pz
    bx = points[v2, 0] - (shear_x[0] + shear_y[0]) * z2 - px
    by = points[v2, 1] - (shear_x[1] + shear_y[1]) * z2 - py
    bz = points[v2, 2] - (shear_x[2] + shear_y[2]) * z2 - pz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    largest[0, 0] = max(largest[0, 0], abs(px), abs(px + ax), abs(px + bx))
    largest[0, 1] = max(largest[0, 1], abs(py), abs(py + ay), abs(py + by))
    largest[0, 2] = max(largest[0, 2], abs(pz), abs(pz + az), abs(pz + bz))
    largest[1, 0] = max(largest[1, 0], abs(ax))
    largest[1, 1] = max(largest[1, 1], abs(ay))
    largest[1, 2] = max(largest[1, 2], abs(az))
    largest[2, 0] = max(largest[2, 0], abs(bx))
    largest[2, 1] = max(largest[2, 1], abs(by))
    largest[2, 2] = max(largest[2, 2], abs(bz))
    largest[3, 0] = max(largest[3, 0], abs(nx))
    largest[3, 1] = max(largest[3, 1], abs(ny))
    largest[3, 2] = max(largest[3, 2], abs(nz))
    return abs(nx * px + ny * py + nz * pz)


@njit(forceinline=True)
def _roundings(largest, volume):  # type: ignore[no-untyped-def]
    """Relative errors of the volume normal . corner, in roundings: from the corners alone; from corners and normal."""
    of_corners, of_normal = 0.0, 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        of_corners += largest[3, k] * largest[0, k]
        products = largest[1, i] * largest[2, j] + largest[1, j] * largest[2, i]
        of_normal += products * max(largest[1, k], largest[2, k])
    if not volume > 0.0:
        return np.inf, np.inf
    return of_corners / volume, (of_corners + of_normal) / volume


@njit(forceinline=True)
def _is_too_far_off(largest, volume, most_at_corner, most):  # type: ignore[no-untyped-def]
    at_corner, anywhere = _roundings(largest, volume)
    return at_corner > most_at_corner or anywhere > most


@kernel
def judge_copies(  # type: ignore[no-untyped-def]
    counter_address, points_pixels, points_own, points_ray, faces, shears_x, shears_y, cell_width, cell_height,
    admitted_multiple, in_every_cell, depth_error, left_out,
):  # fmt: skip
    """Bound the depth error of each triangle of the mesh, and find triangles whose copies would have too large errors.

    points_pixels: (V, 3) float64 homogeneous pixels. points_own: (V, 3) float64, ray space of the triangle's own
    camera. points_ray: (V, 3) float64, to be sheared. shears_x: (nx, 3), shears_y: (ny, 3) float64, per unit depth.
    depth_error: (F,) float64, relative error, ALLOWED_MULTIPLE times the mesh's own roundings; inf if the plane passes
    through the eye. left_out: (F,) uint8, 1 if the mesh itself has more than MOST_ROUNDINGS, or a copy in some cell has
    more than COPY_RATIO times the mesh's roundings and, with those of n . d, more than admitted_multiple times. That is
    asked of cells that see the triangle. in_every_cell: copies are in the others, too, where they must not be hit, so a
    copy with more than SIGN_ROUNDINGS in any cell is left out.

    With first corner v0, edges a and b there, normal n = a x b, and direction d, a depth is n . v0 / n . d.
    Rounding of the corners, and of products with n, changes n . v0 by sum_k |n_k| max_i |v_ik|. Rounding of n changes
    it by the products that n is made of times the way from v0 to the hit. Both are counted by component, since the
    normal of a wall along an axis is exact. At v0 there is no such way, so the first sum has a bound of its own. For
    n . d the direction errs twice as much as corners, being a sum, and three roundings are added. All sizes of a copy
    are linear in its shear and largest at the image's corners; only if these are too large are single cells tested.
    """
    largest, nothing = np.empty((4, 3)), np.zeros(3)
    nx, ny = len(shears_x), len(shears_y)
    polygon, first, second = np.empty((CORNERS, 3)), np.empty((CORNERS, 3)), np.empty((CORNERS, 3))
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            largest[:] = 0.0
            volume = _enlarge(points_own, faces, triangle, nothing, nothing, points_pixels, largest)
            at_corner, of_mesh = _roundings(largest, volume)
            depth_error[triangle] = FLOAT32_UNIT * ALLOWED_MULTIPLE * of_mesh
            if not of_mesh <= MOST_ROUNDINGS:
                left_out[triangle] = 1
                continue
            # A copy with c roundings at its first corner has 2 c + 3 in n . d.
            admitted = (admitted_multiple * (at_corner + LEAST_FACING) - 3.0) / 3.0
            most_at_corner, most = max(COPY_RATIO * at_corner, admitted), max(COPY_RATIO * of_mesh, admitted)
            largest[:] = 0.0
            for j in (0, ny - 1):
                for i in (0, nx - 1):
                    volume = _enlarge(points_ray, faces, triangle, shears_x[i], shears_y[j], points_pixels, largest)
            left_out[triangle] = 0
            if not _is_too_far_off(largest, volume, most_at_corner, most):
                continue
            if in_every_cell and _roundings(largest, volume)[1] > SIGN_ROUNDINGS:
                left_out[triangle] = 1
                continue
            met = find_rows(points_pixels, faces, triangle, cell_height, ny, polygon, first)
            for j in range(met.first, met.last + 1):
                left, right = find_columns(met, polygon, j, cell_width, cell_height, nx, first, second)
                for i in range(left, right + 1):
                    largest[:] = 0.0
                    volume = _enlarge(points_ray, faces, triangle, shears_x[i], shears_y[j], points_pixels, largest)
                    if _is_too_far_off(largest, volume, most_at_corner, most):
                        left_out[triangle] = 1


@njit(forceinline=True)
def _load_edges(points, faces, triangle, axis, sizes):  # type: ignore[no-untyped-def]
    """Store a triangle's sizes by component in `sizes` (3, 3): corners, normal, and the error of normal . way from the
    first corner per rounding. Returns normal . axis and its roundings."""
    v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    facing, of_facing = 0.0, 0.0
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        ai, aj = points[v1, i] - points[v0, i], points[v1, j] - points[v0, j]
        bi, bj = points[v2, i] - points[v0, i], points[v2, j] - points[v0, j]
        normal = ai * bj - aj * bi
        sizes[0, k] = max(abs(points[v0, k]), abs(points[v1, k]), abs(points[v2, k]))
        sizes[1, k] = abs(normal)
        along = max(abs(points[v1, k] - points[v0, k]), abs(points[v2, k] - points[v0, k]))
        sizes[2, k] = (abs(ai * bj) + abs(aj * bi)) * along
        facing += normal * axis[k]
        of_facing += abs(normal * axis[k])
    return facing, of_facing


@kernel
def judge_translations(  # type: ignore[no-untyped-def]
    counter_address, points_pixels, points_own, points_ray, faces, own, first, shears_x, shears_y, cell_width,
    cell_height, is_instanced, admitted_multiple, left_out,
):  # fmt: skip
    """Find triangles whose copies, translated onto parallel reference rays, would have too large errors.

    Arguments and `left_out` as for `judge_copies`. own, first: `ParallelRays` of the triangle's own camera and of the
    first one. is_instanced: rays are translated instead of triangles.

    A translation lengthens no edge, but may move a triangle from near the eye, where float32 is fine, to the start of
    reference rays far away. The error of a corner then does not depend on the depth, and near the image plane it may
    exceed it. With first corner v0, normal n and ray o + t d, a depth is n . (v0 - o) / n . d. Its roundings are those
    of the corners and the origin's two summands, times n; those of n, times the way from v0 to the hit; and those of
    n . d, times the depth. A copy may have `admitted_multiple` times those of the mesh, at all its depths and ways.
    """
    sizes, copy = np.empty((3, 3)), np.empty((3, 3))
    nx, ny = len(shears_x), len(shears_y)
    while True:
        start = fetch_add(counter_address, 1) * CHUNK
        if start >= len(faces):
            return
        for triangle in range(start, min(start + CHUNK, len(faces))):
            left_out[triangle] = 0
            x_low, x_high, y_low, y_high = np.inf, -np.inf, np.inf, -np.inf
            nearest, farthest = np.inf, -np.inf
            for corner in range(3):
                vertex = faces[triangle, corner]
                x, y, depth = points_pixels[vertex, 0], points_pixels[vertex, 1], 0.0
                for k in range(3):
                    depth += points_own[vertex, k] * own.forward[k]
                x_low, x_high, y_low, y_high = min(x_low, x), max(x_high, x), min(y_low, y), max(y_high, y)
                nearest, farthest = min(nearest, depth), max(farthest, depth)
            left, right = cell_range(x_low, x_high, cell_width, nx)
            top, bottom = cell_range(y_low, y_high, cell_height, ny)
            if left > right or top > bottom:
                continue
            facing, of_facing = _load_edges(points_own, faces, triangle, own.forward, sizes)
            facing_copy, of_facing_copy = _load_edges(points_ray, faces, triangle, first.forward, copy)
            if of_facing == 0.0 and of_facing_copy == 0.0:
                continue  # a wall along rays and axes, whose n . d is exact: no ray hits it
            x = max(0.0, x_low - own.middle[0], own.middle[0] - x_high)
            y = max(0.0, y_low - own.middle[1], own.middle[1] - y_high)
            of_mesh, of_normal, of_copy, of_normal_copy = 0.0, 0.0, 0.0, 0.0
            for k in range(3):
                own_start = x * abs(own.column[k]) + y * abs(own.row[k])
                of_mesh += sizes[1, k] * (sizes[0, k] + own_start)
                of_normal += sizes[2, k]
                size = 0.0
                for i in (left, right):
                    for j in (top, bottom):
                        shift = shears_x[i, k] + shears_y[j, k]
                        if is_instanced:
                            size = max(size, copy[0, k] + abs(shift))
                        else:
                            for corner in range(3):
                                size = max(size, abs(points_ray[faces[triangle, corner], k] - shift))
                of_copy += copy[1, k] * (size + first.farthest[k])
                of_normal_copy += copy[2, k]
            facing, facing_copy = abs(facing), abs(facing_copy)
            if farthest < 0.0 and -farthest * facing_copy > MOST_ROUNDINGS * FLOAT32_UNIT * of_copy:
                continue  # too far behind the image plane for rounding to move it in front
            of_facing, of_facing_copy = of_facing + 3.0 * facing, of_facing_copy + 3.0 * facing_copy
            if facing == facing_copy:
                facing = facing_copy = 1.0  # both may be 0
            for way in (0.0, 1.0):
                for depth in (max(nearest, 0.0), max(farthest, 0.0)):
                    has_copy = of_copy + way * of_normal_copy + depth * of_facing_copy
                    has_mesh = of_mesh + way * of_normal + depth * of_facing
                    if has_copy * facing > admitted_multiple * has_mesh * facing_copy or facing == 0.0:
                        left_out[triangle] = 1
