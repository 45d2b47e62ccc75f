"""The image that is drawn, the view that it is drawn from, and what both ways of drawing have in common."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.target_kernels import LINE
from atra.compiled.store import njit
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View

SPAN = LINE
"""Pixels along a row over which nearness is a float32 multiple of its slope; no function of `lanes`, so that the
number of lanes changes no bit."""

NARROW = 32
"""Widest box, in pixels, of a triangle that is drawn without looking for the ends of its rows."""

GENTLE = 2.0
"""Largest change of nearness (1 / depth) over a span of pixels, relative to its minimum, for a triangle to be gentle:
float32 along the row then changes it by few units. Steeper ones are computed in float64, between their corners."""

CACHE_LINE = 64
"""Bytes of a cache line."""

EYE_NUMBERS = 18
"""Numbers of an `Eye`: position, to_pixels and depth_axis."""

_LEAST_DEPTH = 1e-25
"""Depth that a corner has at least, of the mesh's distance from the eye: its inverse has to be a float32."""


class ImageAddresses(NamedTuple):
    """depth, prim_id: addresses of the first pixel, 4 bytes each, rows one after another."""

    depth: int
    prim_id: int
    width: int
    height: int


class Band(NamedTuple):
    """The rows top ... bottom of the image while they are drawn, in memory of the thread that does.

    nearness, prim_id: addresses of their first pixel, 4 bytes each. stride: pixels from row to row.
    """

    nearness: int
    prim_id: int
    stride: int
    top: int
    bottom: int


class Eye(NamedTuple):
    """What triangles are drawn from. Addresses of float64: position (3), to_pixels (3 x 4), of homogeneous eye space,
    with the samples at whole numbers, and depth_axis (3), the view axis in eye space. least_depth: what smaller depths
    count as, on either side of the eye plane; 0 where rays are parallel."""

    position: int
    to_pixels: int
    depth_axis: int
    least_depth: float


@njit(forceinline=True)
def eye_at(numbers, least_depth):  # type: ignore[no-untyped-def]
    """The `Eye` whose numbers, position, to_pixels and depth_axis, follow one another from an address on."""
    return Eye(numbers, numbers + 3 * 8, numbers + 15 * 8, least_depth)


def eye_of(mesh: Mesh, camera: View, offset: tuple[float, float]) -> tuple[Eye, NDArray[np.float64]]:
    """What a mesh is seen from, around its own origin, with the samples of an offset at whole numbers.

    Returns the eye, and its numbers (18,) float64, which have to live as long as it is used.
    """
    mesh, camera = own_space(mesh, camera)
    numbers = np.concatenate([camera.eye, camera.to_pixels.reshape(-1), camera.axes[2]])
    for row, part in zip((numbers[3:7], numbers[7:11]), offset, strict=True):
        row -= part * numbers[11:15]
    least_depth = 0.0 if camera.is_parallel else least_depth_of(mesh, numbers[:3])
    return eye_at.py_func(numbers.ctypes.data, least_depth), numbers


def least_depth_of(mesh: Mesh, eye: NDArray[np.float64]) -> float:
    """As of `Eye`, where rays are not parallel."""
    return _LEAST_DEPTH * float(np.abs(mesh.bounds - eye).max())


class ThreadMemory(NamedTuple):
    """Addresses of memory of one thread. band: an image of a band, such as nearness and then prim_id. exact: SUMMANDS
    float64 for edges. first, last: float64, where each row of a triangle starts and ends, with room for whole vectors.
    points: a cluster's vertices in pixels. listed, doubles, floats: of `triangles`. tiles: of `culling`. here: int64,
    the clusters of a band."""

    band: int
    exact: int
    first: int
    last: int
    points: int
    listed: int
    doubles: int
    floats: int
    tiles: int
    here: int
