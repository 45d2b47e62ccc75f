"""The surface that a ray hits, in float64: barycentric weights, places and normals of an image's pixels.

Neighbouring pixels mostly see the same triangle, so what only it decides is computed once for every run of them in a
row. What is left of Möller–Trumbore (`atra.geometry.intersection.Volumes`) is linear in a pixel's place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.kernels.caching import kernel
from atra.kernels.intrinsics import fetch_add
from atra.kernels.raster.vectors import bits_of, load, repeated, rounded, store
from atra.prim_ids import MISS

ROWS = 16
"""Rows of pixels that a worker takes at a time."""

_PARALLEL = 1e-14  # of `atra.geometry.intersection`: the determinant below which a triangle is edge-on or has no area
_MISS = int(MISS)
_LANES = 8  # pixels computed together; those behind the end of a run are overwritten by the next


class Triangles(NamedTuple):
    """vertices: (V, 3) float32, world space. faces: (F, 3) uint32."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


class PixelGrid(NamedTuple):
    """eye: (3,) and axes: (3, 3) float64, a camera's place, and right, down, forward as rows. columns: (W,) and rows:
    (H,) float64, where the rays of pixels pass its image plane. is_parallel: they start there and go along forward;
    otherwise they start at the eye, and the plane is at a distance of 1."""

    eye: NDArray[np.float64]
    axes: NDArray[np.float64]
    columns: NDArray[np.float64]
    rows: NDArray[np.float64]
    is_parallel: bool


@njit(inline="always")
def _difference(vertices, to, start):  # type: ignore[no-untyped-def]
    return (
        np.float64(vertices[to, 0]) - np.float64(vertices[start, 0]),
        np.float64(vertices[to, 1]) - np.float64(vertices[start, 1]),
        np.float64(vertices[to, 2]) - np.float64(vertices[start, 2]),
    )


@njit(inline="always")
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(inline="always")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(inline="always")
def _turned(axes, a):  # type: ignore[no-untyped-def]
    return _dot(axes[0], a), _dot(axes[1], a), _dot(axes[2], a)


@njit(inline="always")
def _triangle(mesh, prim_id):  # type: ignore[no-untyped-def]
    """First corner and the two edges leaving it, float64, world space."""
    first, vertices = mesh.faces[prim_id, 0], mesh.vertices
    corner = np.float64(vertices[first, 0]), np.float64(vertices[first, 1]), np.float64(vertices[first, 2])
    return (
        corner,
        _difference(vertices, mesh.faces[prim_id, 1], first),
        _difference(vertices, mesh.faces[prim_id, 2], first),
    )


@njit(inline="always")
def _along_row(camera, triangle, y):  # type: ignore[no-untyped-def]
    """What pixels of row `y` that see the triangle have in common: the column that they are counted from, and slope and
    start there of the volumes `facing`, `u`, `v` and `ahead`, and of the square up to which `facing` is noise."""
    corner, e1, e2 = triangle
    cx, cy, cz = _turned(camera.axes, (corner[0] - camera.eye[0], corner[1] - camera.eye[1], corner[2] - camera.eye[2]))
    e1, e2 = _turned(camera.axes, e1), _turned(camera.axes, e2)
    normal = _cross(e2, e1)
    noise = _PARALLEL * _PARALLEL * _dot(e1, e1) * _dot(e2, e2)
    row = camera.rows[y]
    if camera.is_parallel:
        down = row - cy
        return (
            cx,
            (0.0, normal[2]),
            (-e2[1], e2[0] * down),
            (e1[1], -e1[0] * down),
            (-normal[0], normal[2] * cz - normal[1] * down),
            (0.0, noise),
        )
    to_origin = -cx, -cy, -cz
    u, v = _cross(e2, to_origin), _cross(to_origin, e1)
    return (
        0.0,
        (normal[0], normal[1] * row + normal[2]),
        (u[0], u[1] * row + u[2]),
        (v[0], v[1] * row + v[2]),
        (0.0, _dot(e2, v)),
        (noise, noise * (row * row + 1.0)),
    )


@njit
def _weights(column, along):  # type: ignore[no-untyped-def]
    """u and v of one pixel; NaN where its ray never hits the triangle's plane."""
    start, facing, u, v, ahead, noise = along
    x = column - start
    determinant = facing[0] * x + facing[1]
    if not determinant * determinant > noise[0] * x * x + noise[1]:
        return np.nan, np.nan
    reciprocal = 1.0 / determinant
    if not (ahead[0] * x + ahead[1]) * reciprocal >= 0.0:
        return np.nan, np.nan
    return (u[0] * x + u[1]) * reciprocal, (v[0] * x + v[1]) * reciprocal


@njit(inline="always")
def _linear(slope_and_start, x):  # type: ignore[no-untyped-def]
    return repeated(slope_and_start[0], _LANES) * x + repeated(slope_and_start[1], _LANES)


@njit(inline="always")
def _weights_of_block(address, along):  # type: ignore[no-untyped-def]
    """u and v of a block of pixels, and whether they all have some; address: of their columns."""
    start, facing, u, v, ahead, noise = along
    x = load(address, 0.0, _LANES) - repeated(start, _LANES)
    determinant = _linear(facing, x)
    reciprocal = repeated(1.0, _LANES) / determinant
    has_some = (determinant * determinant > _linear(noise, x * x)) & (
        repeated(0.0, _LANES) <= _linear(ahead, x) * reciprocal
    )
    return _linear(u, x) * reciprocal, _linear(v, x) * reciprocal, bits_of(has_some) == (1 << _LANES) - 1


@njit(inline="always")
def _weigh(columns, start, end, along, u, v):  # type: ignore[no-untyped-def]
    x = start
    while x < end:
        if x + _LANES <= len(columns):
            block_u, block_v, has_some = _weights_of_block(columns.ctypes.data + 8 * x, along)
            if has_some:
                store(rounded(block_u), u.ctypes.data + 4 * x)
                store(rounded(block_v), v.ctypes.data + 4 * x)
                x += _LANES
                continue
        u[x], v[x] = _weights(columns[x], along)
        x += 1


@njit(inline="always")
def _linear_in_two(corner, e1, e2, u, v):  # type: ignore[no-untyped-def]
    return rounded(repeated(corner, _LANES) + repeated(e1, _LANES) * u + repeated(e2, _LANES) * v)


@njit(inline="always")
def _place(columns, start, end, along, triangle, block, points):  # type: ignore[no-untyped-def]
    corner, e1, e2 = triangle
    x = start
    while x < end:
        if x + _LANES <= len(columns):
            u, v, has_some = _weights_of_block(columns.ctypes.data + 8 * x, along)
            if has_some:
                for axis in range(3):
                    place = _linear_in_two(corner[axis], e1[axis], e2[axis], u, v)
                    store(place, block.ctypes.data + 4 * _LANES * axis)
                for lane in range(_LANES):
                    points[x + lane, 0] = block[0, lane]
                    points[x + lane, 1] = block[1, lane]
                    points[x + lane, 2] = block[2, lane]
                x += _LANES
                continue
        at_u, at_v = _weights(columns[x], along)
        for axis in range(3):
            points[x, axis] = corner[axis] + at_u * e1[axis] + at_v * e2[axis]
        x += 1


@njit(inline="always")
def _orient(triangle, normals):  # type: ignore[no-untyped-def]
    x, y, z = _cross(triangle[1], triangle[2])
    length = np.sqrt(x * x + y * y + z * z)
    scale = 1.0 / length if length > 0.0 else np.nan
    for i in range(len(normals)):
        normals[i, 0] = x * scale
        normals[i, 1] = y * scale
        normals[i, 2] = z * scale


@njit(inline="always")
def _end_of_run(prim_id, start):  # type: ignore[no-untyped-def]
    end = start + 1
    while end < len(prim_id) and prim_id[end] == prim_id[start]:
        end += 1
    return end


@kernel
def weigh_corners(counter_address, mesh, camera, prim_id, absent, weights):  # type: ignore[no-untyped-def]
    """Barycentric weights of the second and third corner, rows of pixels until the shared counter runs past the last.

    prim_id: (H, W) uint32. weights: (2, H, W) float32, u and v, written completely, NaN = miss. absent: (1,) uint32, is
    given a `prim_id` that the mesh does not have, if there is one.
    """
    while True:
        top = fetch_add(counter_address, 1) * ROWS
        if top >= len(prim_id):
            return
        for y in range(top, min(top + ROWS, len(prim_id))):
            start = 0
            while start < prim_id.shape[1]:
                end = _end_of_run(prim_id[y], start)
                if prim_id[y, start] >= len(mesh.faces):
                    if prim_id[y, start] != _MISS:
                        absent[0] = prim_id[y, start]
                    weights[:, y, start:end] = np.nan
                else:
                    along = _along_row(camera, _triangle(mesh, prim_id[y, start]), y)
                    _weigh(camera.columns, start, end, along, weights[0, y], weights[1, y])
                start = end


@kernel
def place_hits(counter_address, mesh, camera, prim_id, absent, points):  # type: ignore[no-untyped-def]
    """Where rays meet the planes of their triangles, shared out as by `weigh_corners`.

    points: (H, W, 3) float32, world space, written completely, NaN = miss.
    """
    block = np.empty((3, _LANES), np.float32)
    while True:
        top = fetch_add(counter_address, 1) * ROWS
        if top >= len(prim_id):
            return
        for y in range(top, min(top + ROWS, len(prim_id))):
            start = 0
            while start < prim_id.shape[1]:
                end = _end_of_run(prim_id[y], start)
                if prim_id[y, start] >= len(mesh.faces):
                    if prim_id[y, start] != _MISS:
                        absent[0] = prim_id[y, start]
                    points[y, start:end] = np.nan
                else:
                    triangle = _triangle(mesh, prim_id[y, start])
                    along = _along_row(camera, triangle, y)
                    _place(camera.columns, start, end, along, triangle, block, points[y])
                start = end


@kernel
def orient_hits(counter_address, mesh, camera, prim_id, absent, normals):  # type: ignore[no-untyped-def]
    """Unit normals of the triangles that rays hit, shared out as by `weigh_corners`.

    normals: (H, W, 3) float32, world space, written completely, NaN = miss, or a triangle without area.
    """
    while True:
        top = fetch_add(counter_address, 1) * ROWS
        if top >= len(prim_id):
            return
        for y in range(top, min(top + ROWS, len(prim_id))):
            start = 0
            while start < prim_id.shape[1]:
                end = _end_of_run(prim_id[y], start)
                if prim_id[y, start] >= len(mesh.faces):
                    if prim_id[y, start] != _MISS:
                        absent[0] = prim_id[y, start]
                    normals[y, start:end] = np.nan
                else:
                    _orient(_triangle(mesh, prim_id[y, start]), normals[y, start:end])
                start = end
