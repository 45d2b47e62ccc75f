"""Crossings: whether the ray of a sample crosses a triangle, decided exactly, which way, and at what depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.kernels.caching import kernel
from atra.kernels.gathering.listing import project
from atra.kernels.raster.exact import side, turn
from atra.kernels.raster.spans import holds_eye, inverse_of
from atra.parallel import WorkerPool

_LEAST_DEPTH = 1e-25
"""As in `atra.kernels.raster.frames`."""


class ViewOfMesh(NamedTuple):
    """vertices: (V, 3) float32. eye: (3,) float64. to_pixels: (3, 4) float64, with the samples at whole numbers."""

    vertices: NDArray[np.float32]
    eye: NDArray[np.float64]
    to_pixels: NDArray[np.float64]


def projected(
    mesh: Mesh, camera: View, offset: tuple[float, float], pool: WorkerPool, points: NDArray[np.float64]
) -> ViewOfMesh:
    """The view with the samples of `offset` at whole numbers; points: (V, 4) float64, written as `project` does."""
    to_pixels = camera.to_pixels.copy()
    to_pixels[:2] -= np.outer(offset, to_pixels[2])
    eye = np.array(camera.eye)
    least_depth = 0.0 if camera.is_parallel else _LEAST_DEPTH * float(np.abs(mesh.bounds - eye).max())
    pool.run(lambda _, counter: project(counter, mesh.vertices, eye, to_pixels, camera.axes[2], least_depth, points))
    return ViewOfMesh(mesh.vertices, eye, to_pixels)


@njit(inline="always")
def homogeneous(view, vertex):  # type: ignore[no-untyped-def]
    """(x, y, 1) times the depth of a vertex, or (x, y, 1) where rays are parallel; x and y its pixel position."""
    u, v = view.vertices[vertex, 0] - view.eye[0], view.vertices[vertex, 1] - view.eye[1]
    w, m = view.vertices[vertex, 2] - view.eye[2], view.to_pixels
    return (
        m[0, 0] * u + m[0, 1] * v + m[0, 2] * w + m[0, 3],
        m[1, 0] * u + m[1, 1] * v + m[1, 2] * w + m[1, 3],
        m[2, 0] * u + m[2, 1] * v + m[2, 2] * w + m[2, 3],
    )


@njit(inline="always")
def _from_eye(view, vertex):  # type: ignore[no-untyped-def]
    vertices, eye = view.vertices, view.eye
    return vertices[vertex, 0] - eye[0], vertices[vertex, 1] - eye[1], vertices[vertex, 2] - eye[2]


@njit
def _holds_eye(view, v0, v1, v2):  # type: ignore[no-untyped-def]
    """Whether the eye lies in the plane of a triangle, to the last digits of float64: then it is seen edge-on."""
    return holds_eye(_from_eye(view, v0), _from_eye(view, v1), _from_eye(view, v2))


@njit
def pinhole_plane(view, v0, v1, v2):  # type: ignore[no-untyped-def]
    """Nearness A i + B j + C on the plane of a triangle, as `atra.kernels.raster.spans` has it."""
    a0, b0, c0 = homogeneous(view, v0)
    a1, b1, c1 = homogeneous(view, v1)
    a2, b2, c2 = homogeneous(view, v2)
    a1, b1, c1 = a1 - a0, b1 - b0, c1 - c0
    a2, b2, c2 = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = b1 * c2 - c1 * b2, c1 * a2 - a1 * c2, a1 * b2 - b1 * a2
    inverse = inverse_of(na * a0 + nb * b0 + nc * c0)
    return na * inverse, nb * inverse, nc * inverse


@njit
def facing_of(parallel, view, points, v0, v1, v2, exact):  # type: ignore[no-untyped-def]
    """1 where rays leave through a triangle that turns counterclockwise seen from outside, -1 where they enter; 0 for
    one that no ray crosses: it is edge-on, or all of it is behind the eye."""
    x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
    x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
    x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
    facing = turn(x0, y0, x1, y1, x2, y2, exact)
    if parallel:
        return facing if min(w0, w1, w2) < 0.0 else 0
    if min(w0, w1, w2) > 0.0:
        return facing
    if max(w0, w1, w2) < 0.0 or _holds_eye(view, v0, v1, v2):
        return 0
    for w in (w0, w1, w2):
        if w < 0.0:
            facing = -facing
    return facing


@njit
def covers(parallel, points, v0, v1, v2, i, j, exact):  # type: ignore[no-untyped-def]
    """Whether sample (i, j) lies in the projection of the part in front of the eye of a triangle whose facing is not
    0. A corner behind the eye turns the side of its edges that counts, each corner once."""
    x0, y0, w0 = points[v0, 0], points[v0, 1], points[v0, 2]
    x1, y1, w1 = points[v1, 0], points[v1, 1], points[v1, 2]
    x2, y2, w2 = points[v2, 0], points[v2, 1], points[v2, 2]
    facing = turn(x0, y0, x1, y1, x2, y2, exact)
    return (
        side(x1, y1, x2, y2, i, j, exact) == (-facing if not parallel and w0 < 0.0 else facing)
        and side(x2, y2, x0, y0, i, j, exact) == (-facing if not parallel and w1 < 0.0 else facing)
        and side(x0, y0, x1, y1, i, j, exact) == (-facing if not parallel and w2 < 0.0 else facing)
    )


@njit
def depth_at(parallel, view, points, v0, v1, v2, i, j):  # type: ignore[no-untyped-def]
    """Depth, float64, at which the ray of sample (i, j), which a triangle covers, crosses it; 0 behind a parallel
    image plane, and between the depths of the corners but for that."""
    a0, b0, c0 = homogeneous(view, v0)
    a1, b1, c1 = homogeneous(view, v1)
    a2, b2, c2 = homogeneous(view, v2)
    w0, w1, w2 = points[v0, 2], points[v1, 2], points[v2, 2]
    if parallel:
        x1, y1, x2, y2 = a1 - a0, b1 - b0, a2 - a0, b2 - b0
        area = x1 * y2 - y1 * x2
        at_i, at_j = i - a0, j - b0
        found = w0
        if area != 0.0:
            found += ((at_i * y2 - at_j * x2) * (w1 - w0) + (x1 * at_j - y1 * at_i) * (w2 - w0)) / area
        return max(-min(max(found, min(w0, w1, w2)), max(w0, w1, w2)), 0.0)
    a1, b1, c1 = a1 - a0, b1 - b0, c1 - c0
    a2, b2, c2 = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = b1 * c2 - c1 * b2, c1 * a2 - a1 * c2, a1 * b2 - b1 * a2
    volume = na * a0 + nb * b0 + nc * c0
    nearness = abs((na * i + nb * j + nc) / volume) if volume != 0.0 else np.inf
    least, most = np.inf, 0.0
    for w in (w0, w1, w2):
        least, most = min(least, w if w > 0.0 else np.inf), np.inf if w < 0.0 else max(most, w)
    return 1.0 / min(max(nearness, least), most)


@njit(inline="always")
def _inside_of_image(low, high, last):  # type: ignore[no-untyped-def]
    """The first and last whole number of 0 ... last from `low` to `high`."""
    return max(int(np.ceil(max(low, 0.0))), 0), int(np.floor(min(high, float(last))))


@kernel
def list_crossings(parallel, view, points, faces, width, height, exact, pixels, prim_ids, facings, depths):  # type: ignore[no-untyped-def]
    """Every crossing of an image, triangle by triangle, each sample of its box tested; returns how many there are.

    points: of `project`. pixels: (N,) int64, y * width + x; prim_ids: (N,) uint32, facings: (N,) int8, depths: (N,)
    float64: written as far as they reach.
    """
    count = 0
    for triangle in range(len(faces)):
        v0, v1, v2 = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
        facing = facing_of(parallel, view, points, v0, v1, v2, exact)
        if facing == 0:
            continue
        left, right, top, bottom = 0, width - 1, 0, height - 1
        if parallel or min(points[v0, 2], points[v1, 2], points[v2, 2]) > 0.0:
            x0, x1, x2 = points[v0, 0], points[v1, 0], points[v2, 0]
            y0, y1, y2 = points[v0, 1], points[v1, 1], points[v2, 1]
            left, right = _inside_of_image(min(x0, x1, x2), max(x0, x1, x2), right)
            top, bottom = _inside_of_image(min(y0, y1, y2), max(y0, y1, y2), bottom)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                if not covers(parallel, points, v0, v1, v2, float(x), float(y), exact):
                    continue
                depth = depth_at(parallel, view, points, v0, v1, v2, float(x), float(y))
                if depth <= 0.0:
                    continue
                if count < len(pixels):
                    pixels[count], prim_ids[count] = y * width + x, triangle
                    facings[count], depths[count] = facing, depth
                count += 1
    return count
