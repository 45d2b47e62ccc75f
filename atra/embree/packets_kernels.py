"""Packets of rays: how kernels pass them to Embree and read their hits."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.embree import layout
from atra.embree.layout import HIT_GEOM_ID, HIT_PRIM_ID, RAY_DIR_X, RAY_ORG_X, RAY_TFAR, RAY_WORDS
from atra.prim_ids import MISS as MISS

INFINITY = np.float32(np.inf)
START = np.float32(layout.AFTER_START)
"""tnear of rays that do not hit what they start on."""

SMALLEST_COMPONENT = np.float32(1e-17)
"""Smaller components of a ray are replaced by 0.

Embree takes the reciprocal of a component below 1e-18 as that of +1e-18, but its packets choose near and far planes by
the original sign, so that rays with a tiny negative component miss triangles. The change moves no hit visibly.
"""


class RayGrid(NamedTuple):
    """The rays of an image: a pixel's direction (for parallel rays its origin) is its column's plus its row's.

    columns: (3, >= W) float32. rows: (3, >= H) float32.
    """

    columns: NDArray[np.float32]
    rows: NDArray[np.float32]


class PixelTiles(NamedTuple):
    """Tiles of an image in the order in which threads take them.

    corners: (N, 2) int32, column and row of each tile's upper left pixel. width, height: of a tile, in pixels.
    """

    corners: NDArray[np.int32]
    width: int
    height: int


class TracedImage(NamedTuple):
    """The image that a kernel writes. depth: (H, W) float32, inf = miss. prim_id: (H, W) uint32, MISS = miss."""

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]


def _query(name: str) -> Any:
    """A function of Embree's for packets of any width; valid: lane mask, not read for packets of 1."""
    signatures = {width: types.void(*[types.intp] * (3 if width == 1 else 4)) for width in (1, 4, 8, 16)}
    query1, query4, query8, query16 = (
        types.ExternalFunction(f"rtc{name}{width}", signature) for width, signature in signatures.items()
    )

    @njit(forceinline=True)
    def query(width, valid, scene, packet):  # type: ignore[no-untyped-def]
        if width == 8:
            query8(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
        elif width == 1:
            query1(scene, packet.floats.ctypes.data, packet.arguments_address)
        elif width == 4:
            query4(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
        else:
            query16(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)

    return query


intersect, occluded = _query("Intersect"), _query("Occluded")
"""Query a scene with a packet: find the closest hits, or only set tfar to -inf where a ray hits anything."""


@njit(forceinline=True)
def ray_component(component):  # type: ignore[no-untyped-def]
    """A component of a direction or origin, 0 where it is below SMALLEST_COMPONENT."""
    return component if abs(component) >= SMALLEST_COMPONENT else np.float32(0.0)


@njit(forceinline=True)
def set_pixel_ray(packet, width, lane, parallel, rays, x, y):  # type: ignore[no-untyped-def]
    """Store the direction (for parallel rays the origin) of pixel (x, y) in a lane of a packet of `width`."""
    first = (RAY_ORG_X if parallel else RAY_DIR_X) * width + lane
    packet.floats[first] = ray_component(rays.columns[0, x] + rays.rows[0, y])
    packet.floats[first + width] = ray_component(rays.columns[1, x] + rays.rows[1, y])
    packet.floats[first + 2 * width] = ray_component(rays.columns[2, x] + rays.rows[2, y])


@njit(forceinline=True)
def set_no_hit(packet, width, lane):  # type: ignore[no-untyped-def]
    """Store in a lane that its ray has hit nothing so far."""
    packet.ids[(RAY_WORDS + HIT_PRIM_ID) * width + lane] = MISS
    packet.ids[(RAY_WORDS + HIT_GEOM_ID) * width + lane] = MISS


@njit(forceinline=True)
def set_unlimited(packet, width):  # type: ignore[no-untyped-def]
    """Let the rays of all lanes reach to infinity; they have hit nothing so far."""
    for lane in range(width):
        packet.floats[RAY_TFAR * width + lane] = INFINITY
        set_no_hit(packet, width, lane)


@njit(forceinline=True)
def hit_distance(packet, width, lane):  # type: ignore[no-untyped-def]
    """The ray parameter of a lane's hit, or the ray's end if it hit nothing."""
    return packet.floats[RAY_TFAR * width + lane]


@njit(forceinline=True)
def hit_prim_id(packet, width, lane):  # type: ignore[no-untyped-def]
    """The triangle that a lane's ray hit, by its number in the scene."""
    return packet.ids[(RAY_WORDS + HIT_PRIM_ID) * width + lane]
