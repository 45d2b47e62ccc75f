"""Crossings: whether the ray of a sample crosses a triangle, decided exactly, which way, and at what depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.intrinsics import fetch_add
from atra.compiled.store import kernel, njit
from atra.compiled.threads import WorkerPool
from atra.exact.edges_kernels import side, turn
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.raster.clusters import POINT_BYTES, VERTICES
from atra.raster.corners import holds_eye, homogeneous
from atra.raster.image import eye_of
from atra.raster.set_up import NEAR_AND_FAR
from atra.raster.triangles import project_vertices

_CHUNK = 512 * VERTICES
"""Vertices a thread takes at a time."""


class ViewOfMesh(NamedTuple):
    """vertices: (V, 3) float32. eye: (3,) float64. to_pixels: (12,) float64, rows of `Eye.to_pixels`."""

    vertices: NDArray[np.float32]
    eye: NDArray[np.float64]
    to_pixels: NDArray[np.float64]


def projected(
    mesh: Mesh, camera: View, offset: tuple[float, float], pool: WorkerPool
) -> tuple[ViewOfMesh, NDArray[np.float64]]:
    """The view with the samples of `offset` at whole numbers, and at least (V, 4) float64, of `project_vertices`."""
    mesh, camera = own_space(mesh, camera)
    (eye, numbers), count = eye_of(mesh, camera, offset), len(mesh.vertices)
    whole = -(-count // VERTICES) * VERTICES
    columns, points = np.zeros((3, whole), np.float32), np.empty((whole, 4))
    columns[:, :count] = mesh.vertices.T
    rest = camera.is_parallel, columns.ctypes.data, whole, eye, points.ctypes.data
    pool.run(lambda _, counter: project(counter, *rest))
    return ViewOfMesh(mesh.vertices, numbers[:3], numbers[3:15]), points


@kernel
def project(counter_address, parallel, vertices, count, eye, points):  # type: ignore[no-untyped-def]
    """All vertices to pixels, by `project_vertices`. vertices, points: addresses; count: of vertices, whole vectors."""
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= count:
            return
        size = min(_CHUNK, count - start)
        project_vertices(parallel, vertices + start * 4, count, size, eye, points + start * POINT_BYTES)


@njit(forceinline=True)
def homogeneous_of(view, vertex):  # type: ignore[no-untyped-def]
    """`homogeneous` of a vertex."""
    return homogeneous(view.to_pixels, corner_of(view, vertex))


@njit(forceinline=True)
def corner_of(view, vertex):  # type: ignore[no-untyped-def]
    """A vertex, in the world's axes, seen from the eye."""
    vertices, eye = view.vertices, view.eye
    return vertices[vertex, 0] - eye[0], vertices[vertex, 1] - eye[1], vertices[vertex, 2] - eye[2]


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
    nearest, farthest = max(w0, w1, w2), min(w0, w1, w2)
    if nearest < 0.0:
        return 0
    if nearest > NEAR_AND_FAR * farthest and holds_eye(
        view.eye, corner_of(view, v0), corner_of(view, v1), corner_of(view, v2)
    ):  # the eye lies in its plane, to the last digits of float64
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
def parallel_depth(a, b, c, w0, w1, w2, i, j):  # type: ignore[no-untyped-def]
    """As `depth_at`, where rays are parallel. a, b, c: of `homogeneous`; w: nearness."""
    x0, y0, _ = a
    x1, y1, x2, y2 = b[0] - x0, b[1] - y0, c[0] - x0, c[1] - y0
    area = x1 * y2 - y1 * x2
    at_i, at_j = i - x0, j - y0
    found = w0
    if area != 0.0:
        found += ((at_i * y2 - at_j * x2) * (w1 - w0) + (x1 * at_j - y1 * at_i) * (w2 - w0)) / area
    return max(-min(max(found, min(w0, w1, w2)), max(w0, w1, w2)), 0.0)


@njit
def depth_at(parallel, view, points, v0, v1, v2, i, j):  # type: ignore[no-untyped-def]
    """Depth, float64, at which the ray of sample (i, j), which a triangle covers, crosses it; 0 behind a parallel
    image plane, and between the depths of the corners but for that."""
    a, b, c = homogeneous_of(view, v0), homogeneous_of(view, v1), homogeneous_of(view, v2)
    w0, w1, w2 = points[v0, 2], points[v1, 2], points[v2, 2]
    if parallel:
        return parallel_depth(a, b, c, w0, w1, w2, i, j)
    (a0, b0, c0), (a1, b1, c1), (a2, b2, c2) = a, b, c
    a1, b1, c1 = a1 - a0, b1 - b0, c1 - c0
    a2, b2, c2 = a2 - a0, b2 - b0, c2 - c0
    na, nb, nc = b1 * c2 - c1 * b2, c1 * a2 - a1 * c2, a1 * b2 - b1 * a2
    volume = na * a0 + nb * b0 + nc * c0
    nearness = abs((na * i + nb * j + nc) / volume) if volume != 0.0 else np.inf
    least, most = np.inf, 0.0
    for w in (w0, w1, w2):
        least, most = min(least, w if w > 0.0 else np.inf), np.inf if w < 0.0 else max(most, w)
    return 1.0 / min(max(nearness, least), most)
