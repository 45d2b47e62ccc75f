"""The error that float32 may make about the depth of a triangle, as it is and sheared onto the reference rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.geometry.projection_kernels import (
    CORNERS,
    cell_range,
    columns_in_row,
    front_part,
    load_triangle,
    pixel_range,
)

FLOAT32_UNIT = 2.0**-24
"""Largest relative error of one rounding in float32."""

ALLOWED_MULTIPLE = 4.0
"""Times the roundings counted here that a depth may be off, by `atra.judge.compare`: those of a sum and of its summands
rarely are at their worst and of one sign, but a few of them add up."""

COPY_RATIO = 2.0
"""How many times the roundings of the mesh itself a copy may have: its depths were then off by less than four times as
much. A shift s on the image plane lengthens corners and edges up to 1 + s times, and three lengths go into an error; at
60 degrees s is at most 0.87, and little that is seen has more."""

LEAST_FACING = 5.0
"""Roundings that `normal . direction` of the mesh itself has at least: of the direction's column and row, and of the
direction; of the product, and of the quotient (`atra.exact.rounding`)."""

COPY_MULTIPLE, INSTANCE_MULTIPLE = 5.0, 4.0
"""Times the roundings of the mesh itself that all those of a copy may be in any case: walls along an axis, say, have
next to none themselves. ALLOWED_MULTIPLE are allowed, and no depth of a copy came beyond 4/5 of its roundings. Of an
instance some do: what a copy has in its corners, it has in the rays, turned by a matrix that is rounded itself."""

MOST_ROUNDINGS = 1024.0
"""Roundings of the mesh itself from which on there are no copies: the plane almost passes through the eye then, and
only the very same numbers give the same answer."""

CHUNK = 1024
"""Triangles a thread takes at a time."""


class ParallelRays(NamedTuple):
    """Parallel rays of an image in ray space; (3,) float64 each but `middle`.

    forward: their direction. column, row: from one pixel to the next. middle: (2,) float64, the pixel position at the
    eye. farthest: how far from the eye reference rays may start, the parts of column and row added up.
    """

    forward: NDArray[np.float64]
    column: NDArray[np.float64]
    row: NDArray[np.float64]
    middle: NDArray[np.float64]
    farthest: NDArray[np.float64]


@njit(forceinline=True)
def _enlarge(points, faces, triangle, shear_x, shear_y, depth, largest):  # type: ignore[no-untyped-def]
    """Raise `largest` (4, 3) to the sizes, component by component, of a triangle that is sheared: its corners, the two
    edges at the first corner, its normal."""
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
    largest[1, 0], largest[1, 1], largest[1, 2] = (
        max(largest[1, 0], abs(ax)),
        max(largest[1, 1], abs(ay)),
        max(largest[1, 2], abs(az)),
    )
    largest[2, 0], largest[2, 1], largest[2, 2] = (
        max(largest[2, 0], abs(bx)),
        max(largest[2, 1], abs(by)),
        max(largest[2, 2], abs(bz)),
    )
    largest[3, 0], largest[3, 1], largest[3, 2] = (
        max(largest[3, 0], abs(nx)),
        max(largest[3, 1], abs(ny)),
        max(largest[3, 2], abs(nz)),
    )
    return abs(nx * px + ny * py + nz * pz)


@njit(forceinline=True)
def _roundings(largest, volume):  # type: ignore[no-untyped-def]
    """Relative errors of normal . corner, in units of rounding, of a triangle with these sizes: those of the corners,
    and with those of the normal; volume: normal . corner."""
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
    admitted_multiple, depth_error, left_out,
):  # fmt: skip
    """How far off a ray of the mesh itself may be about each triangle, and whether its copies would be too far off.

    points_pixels: (V, 3) float64 homogeneous pixels. points_own: (V, 3) float64, ray space of the triangle's own
    camera; points_ray: what is sheared. shears_x: (nx, 3), shears_y: (ny, 3) float64, by columns and rows of cells, per
    depth.
    depth_error: (F,) float64, ALLOWED_MULTIPLE times the roundings of the mesh itself, relative to the depth; inf where
    the plane passes through the eye. left_out: (F,) uint8, 1 where in some cell a copy would have more roundings than
    COPY_RATIO times the mesh itself and, with those of n . d, than admitted_multiple times, or the mesh itself has more
    than MOST_ROUNDINGS.

    With first corner v0, edges a and b at it, normal n = a x b, a depth is n . v0 / n . d. Rounding the corners, and
    the products with n, errs by sum_k |n_k| max_i |v_ik| of n . v0. Rounding n errs by the products it is made of,
    times the way from v0 to the hit; both component by component, so that a wall along an axis, whose normal is exact,
    is known to be. At v0 itself there is no such way, so the first is held to its own bound. A ray to the triangle
    heads to between its corners: of n . d the direction errs as corners do, twice, as it is a sum, and three roundings
    are added. All sizes of a copy are linear in its shear, so none is larger than at the corners of the image; only
    where these are too much are the cells that the triangle meets looked at one by one.
    """
    largest, nothing = np.empty((4, 3)), np.zeros(3)
    polygon, first, second = (
        np.empty((CORNERS, 3)),
        np.empty((CORNERS, 3)),
        np.empty((CORNERS, 3)),
    )
    nx, ny = len(shears_x), len(shears_y)
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
            # A copy with c at its first corner has 2 c + 3 in n . d.
            admitted = (admitted_multiple * (at_corner + LEAST_FACING) - 3.0) / 3.0
            most_at_corner, most = max(COPY_RATIO * at_corner, admitted), max(COPY_RATIO * of_mesh, admitted)
            largest[:] = 0.0
            for j in (0, ny - 1):
                for i in (0, nx - 1):
                    volume = _enlarge(points_ray, faces, triangle, shears_x[i], shears_y[j], points_pixels, largest)
            left_out[triangle] = 0
            if not _is_too_far_off(largest, volume, most_at_corner, most):
                continue
            nearest, farthest, size = load_triangle(points_pixels, faces, triangle, polygon)
            tiny = 1e-12 * size
            corners = front_part(polygon, nearest, farthest, first)
            y_low, y_high = pixel_range(polygon, corners, 1, tiny)
            top, bottom = cell_range(y_low, y_high, cell_height, ny)
            for j in range(top, bottom + 1):
                left, right = columns_in_row(
                    polygon, corners, j, cell_width, cell_height, nx, y_low, y_high, tiny, first, second
                )
                for i in range(left, right + 1):
                    largest[:] = 0.0
                    volume = _enlarge(points_ray, faces, triangle, shears_x[i], shears_y[j], points_pixels, largest)
                    if _is_too_far_off(largest, volume, most_at_corner, most):
                        left_out[triangle] = 1


@njit(forceinline=True)
def _load_edges(points, faces, triangle, axis, sizes):  # type: ignore[no-untyped-def]
    """Sizes of a triangle, component by component, into `sizes` (3, 3): of its corners, its normal, and what the normal
    errs by per rounding and way from the first corner. Returns normal . axis, and its roundings."""
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
    """Whether copies of a triangle, translated onto parallel reference rays, would be too far off.

    Arguments and `left_out` as for `judge_copies`. own, first: `ParallelRays` of the triangle's own camera and of the
    first one. is_instanced: rays are translated, not triangles.

    A translation lengthens no edge, but it may carry a triangle from near the eye, where float32 is fine, to where the
    reference rays start, as far away as the image is large; the error of a corner does not hang on the depth then, and
    near the image plane it is much of it. With first corner v0, normal n and ray o + t d a depth is
    n . (v0 - o) / n . d. Its roundings are those of the corners and of the origin's two summands, times n; of n, times
    the way from v0 to the hit; and, times the depth, those of n . d. A copy may have `admitted_multiple` times those of
    the mesh itself, at every depth and way that the triangle has.
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
                continue  # a wall along the rays and the axes, whose n . d is exact: no ray meets it
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
                continue  # so far behind the image plane that no rounding brings it before
            of_facing, of_facing_copy = of_facing + 3.0 * facing, of_facing_copy + 3.0 * facing_copy
            if facing == facing_copy:
                facing = facing_copy = 1.0  # also where both are 0
            for way in (0.0, 1.0):
                for depth in (max(nearest, 0.0), max(farthest, 0.0)):
                    has_copy = of_copy + way * of_normal_copy + depth * of_facing_copy
                    has_mesh = of_mesh + way * of_normal + depth * of_facing
                    if has_copy * facing > admitted_multiple * has_mesh * facing_copy or facing == 0.0:
                        left_out[triangle] = 1
