"""Barycentric weights, positions and normals of an image's hits in float64.

Neighbouring pixels mostly see the same triangle, so values of the triangle are computed once per run of such pixels in
a row. The other volumes of Möller–Trumbore (`atra.exact.intersection.Volumes`) are linear in a pixel's position.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.memory import load, store
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import rounded, splat, where
from atra.exact.intersection import NOISE
from atra.prim_ids import MISS

WEIGHTS, POINTS, NORMALS = 0, 1, 2
"""What is computed of each hit."""

ROWS = 16
"""Rows of pixels that a thread takes at a time."""

_MISS = int(MISS)
_LANES = 8
"""Pixels computed together; the next run overwrites those beyond the end of a run."""


class Triangles(NamedTuple):
    """A mesh as kernels take it. vertices: (V, 3) float32, world space. faces: (F, 3) uint32."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]


class PixelGrid(NamedTuple):
    """A view's pixels as kernels take them.

    axes: right, down, forward. columns: (W,) and rows: (H,) float64, positions of the pixels on the image plane, at
    distance 1 from the eye. is_parallel: rays start there, on a plane through the eye, and go forward.
    """

    eye: tuple[float, float, float]
    axes: tuple[tuple[float, float, float], ...]
    columns: NDArray[np.float64]
    rows: NDArray[np.float64]
    is_parallel: bool


@njit(forceinline=True)
def _difference(vertices, to, start):  # type: ignore[no-untyped-def]
    return (
        np.float64(vertices[to, 0]) - np.float64(vertices[start, 0]),
        np.float64(vertices[to, 1]) - np.float64(vertices[start, 1]),
        np.float64(vertices[to, 2]) - np.float64(vertices[start, 2]),
    )


@njit(forceinline=True)
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(forceinline=True)
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(forceinline=True)
def _turned(axes, a):  # type: ignore[no-untyped-def]
    return _dot(axes[0], a), _dot(axes[1], a), _dot(axes[2], a)


@njit(forceinline=True)
def _triangle(vertices, faces, prim_id):  # type: ignore[no-untyped-def]
    """First corner and the two edges leaving it, world space, float64."""
    first = faces[prim_id, 0]
    corner = np.float64(vertices[first, 0]), np.float64(vertices[first, 1]), np.float64(vertices[first, 2])
    return (
        corner,
        _difference(vertices, faces[prim_id, 1], first),
        _difference(vertices, faces[prim_id, 2], first),
    )


@njit(forceinline=True)
def _along_row(eye, axes, is_parallel, triangle, row):  # type: ignore[no-untyped-def]
    """Values of a triangle that all pixels of a row share: the column at which positions count from 0; slope and value
    there of the volumes `facing`, `u`, `v`, `ahead`; and of the squares up to which `facing` and `ahead` are noise."""
    corner, e1, e2 = triangle
    cx, cy, cz = _turned(axes, (corner[0] - eye[0], corner[1] - eye[1], corner[2] - eye[2]))
    e1, e2 = _turned(axes, e1), _turned(axes, e2)
    normal = _cross(e2, e1)
    noise, eye_square = NOISE * NOISE * _dot(e1, e1) * _dot(e2, e2), _dot(eye, eye)
    if is_parallel:
        down = row - cy
        return (
            cx,
            (0.0, normal[2]),
            (-e2[1], e2[0] * down),
            (e1[1], -e1[0] * down),
            (-normal[0], normal[2] * cz - normal[1] * down),
            (0.0, noise),
            (noise, noise * (down * down + cz * cz + eye_square)),
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
        (0.0, noise * (_dot(to_origin, to_origin) + eye_square)),
    )


@njit(forceinline=True)
def _linear(slope_and_start, x):  # type: ignore[no-untyped-def]
    return splat(slope_and_start[0], _LANES) * x + splat(slope_and_start[1], _LANES)


@njit(forceinline=True)
def _weights(address, along):  # type: ignore[no-untyped-def]
    """u and v of a block of pixels, whose columns lie at an address; NaN if a ray never hits the triangle's plane."""
    start, facing, u, v, ahead, noise, near = along
    x = load(address, 0.0, _LANES) - splat(start, _LANES)
    determinant = _linear(facing, x)
    reciprocal, way = splat(1.0, _LANES) / determinant, _linear(ahead, x)
    is_sure = (determinant * determinant > _linear(noise, x * x)) & (way * way > _linear(near, x * x))
    is_hit, never = is_sure & (way * reciprocal > splat(0.0, _LANES)), splat(np.nan, _LANES)
    return where(is_hit, _linear(u, x) * reciprocal, never), where(is_hit, _linear(v, x) * reciprocal, never)


@njit(forceinline=True)
def _linear_in_two(corner, e1, e2, u, v):  # type: ignore[no-untyped-def]
    return rounded(splat(corner, _LANES) + splat(e1, _LANES) * u + splat(e2, _LANES) * v)


@njit(forceinline=True)
def _end_of_run(prim_id, y, start):  # type: ignore[no-untyped-def]
    end = start + 1
    while end < prim_id.shape[1] and prim_id[y, end] == prim_id[y, start]:
        end += 1
    return end


@cache
def surface_kernel(kind: int) -> Callable[..., None]:
    """The loop over pixels for one kind of value: `WEIGHTS`, `POINTS` or `NORMALS`."""

    @kernel
    def compute(counter_address, mesh, camera, prim_id, absent, found):  # type: ignore[no-untyped-def]
        """Compute what the hits of an image say; threads share rows of pixels.

        prim_id: (H, W) uint32. absent: (1,) uint32, set to a `prim_id` that the mesh does not have, if there is one.
        found: float32, written completely, NaN = miss. Of `WEIGHTS` (2, H, W), barycentric weights of the second and
        third corner; else (H, W, 3), world space: positions, or unit normals, NaN for a triangle without area.
        """
        height, width = prim_id.shape
        vertices, faces = mesh
        eye, axes, columns, rows, is_parallel = camera
        block, padded = np.empty((3, _LANES), np.float32), np.zeros(width + _LANES)
        for x in range(width):
            padded[x] = columns[x]
        column_address, block_address, found_address = padded.ctypes.data, block.ctypes.data, found.ctypes.data
        while True:
            top = fetch_add(counter_address, 1) * ROWS
            if top >= height:
                return
            for y in range(top, min(top + ROWS, height)):
                x = 0
                while x < width:
                    end, seen = _end_of_run(prim_id, y, x), prim_id[y, x]
                    if seen >= len(faces):
                        if seen != _MISS:
                            absent[0] = seen
                        for i in range(x, end):
                            for k in range(2 if kind == WEIGHTS else 3):
                                if kind == WEIGHTS:
                                    found[k, y, i] = np.nan
                                else:
                                    found[y, i, k] = np.nan
                        x = end
                        continue
                    triangle = _triangle(vertices, faces, seen)
                    corner, e1, e2 = triangle
                    if kind == NORMALS:
                        normal = _cross(e1, e2)
                        length = np.sqrt(_dot(normal, normal))
                        scale = 1.0 / length if length > 0.0 else np.nan
                        for i in range(x, end):  # a slice would be counted, which takes as long as a triangle
                            for k in range(3):
                                found[y, i, k] = normal[k] * scale
                        x = end
                        continue
                    along = _along_row(eye, axes, is_parallel, triangle, rows[y])
                    for first in range(x, end, _LANES):
                        u, v = _weights(column_address + 8 * first, along)
                        if kind == WEIGHTS and first + _LANES <= width:
                            store(rounded(u), found_address + 4 * (y * width + first))
                            store(rounded(v), found_address + 4 * ((height + y) * width + first))
                            continue
                        if kind == WEIGHTS:
                            store(rounded(u), block_address)
                            store(rounded(v), block_address + 4 * _LANES)
                        else:
                            for k in range(3):
                                store(_linear_in_two(corner[k], e1[k], e2[k], u, v), block_address + 4 * _LANES * k)
                        for lane in range(min(_LANES, end - first)):
                            for k in range(2 if kind == WEIGHTS else 3):
                                if kind == WEIGHTS:
                                    found[k, y, first + lane] = block[k, lane]
                                else:
                                    found[y, first + lane, k] = block[k, lane]
                    x = end

    return compute
