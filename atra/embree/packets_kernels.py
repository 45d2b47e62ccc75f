"""Packets: how loops hand rays to Embree, and read the hits that come back."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from atra.compiled.store import njit
from atra.embree import layout
from atra.embree.layout import HIT_GEOM_ID, HIT_PRIM_ID, RAY_DIR_X, RAY_ORG_X, RAY_TFAR, RAY_WORDS

MISS = np.uint32(layout.INVALID_ID)
INFINITY = np.float32(np.inf)
START = np.float32(layout.AFTER_START)
"""tnear of rays that do not hit what they start on."""

SMALLEST_COMPONENT = np.float32(1e-17)
"""Components of a ray that are smaller are 0.

Embree takes the reciprocal of a component below 1e-18 as that of +1e-18, and its packets choose near and far planes by
the sign that the component had before: with a tiny negative one they miss what they should hit. No image shows the
difference: it is that of 1e-17 of a depth.
"""


class RayGrid(NamedTuple):
    """The rays of an image: a pixel's direction (or origin, where rays are parallel) is its column's plus its row's.

    columns: (3, >= W) float32, rows: (3, >= H) float32.
    """

    columns: NDArray[np.float32]
    rows: NDArray[np.float32]


class PixelTiles(NamedTuple):
    """What a loop over pixels shares out: tiles of an image in the order in which they are traced.

    corners: (N, 2) int32, column and row of each tile's upper left pixel. width, height: pixels of a tile, as many as
    whole packets have; tiles at the image's borders are cut there.
    """

    corners: NDArray[np.int32]
    width: int
    height: int


class Image(NamedTuple):
    """What a loop over pixels writes. depth: (H, W) float32, inf = miss. prim_id: (H, W) uint32, MISS = miss."""

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]


_address = types.intp
_one_ray = types.void(_address, _address, _address)
_packet = types.void(_address, _address, _address, _address)
_intersect1 = types.ExternalFunction("rtcIntersect1", _one_ray)
_intersect4 = types.ExternalFunction("rtcIntersect4", _packet)
_intersect8 = types.ExternalFunction("rtcIntersect8", _packet)
_intersect16 = types.ExternalFunction("rtcIntersect16", _packet)
_occluded1 = types.ExternalFunction("rtcOccluded1", _one_ray)
_occluded4 = types.ExternalFunction("rtcOccluded4", _packet)
_occluded8 = types.ExternalFunction("rtcOccluded8", _packet)
_occluded16 = types.ExternalFunction("rtcOccluded16", _packet)


@njit(forceinline=True)
def intersect(width, valid, scene, packet):  # type: ignore[no-untyped-def]
    """Closest hits of the packet's rays where `valid`, a lane mask, is not 0; packets of 1 are always traced."""
    if width == 8:
        _intersect8(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
    elif width == 1:
        _intersect1(scene, packet.floats.ctypes.data, packet.arguments_address)
    elif width == 4:
        _intersect4(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
    else:
        _intersect16(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)


@njit(forceinline=True)
def occluded(width, valid, scene, packet):  # type: ignore[no-untyped-def]
    """Set tfar to -inf where a ray hits anything; `valid` as for `intersect`."""
    if width == 8:
        _occluded8(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
    elif width == 1:
        _occluded1(scene, packet.floats.ctypes.data, packet.arguments_address)
    elif width == 4:
        _occluded4(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)
    else:
        _occluded16(valid.ctypes.data, scene, packet.floats.ctypes.data, packet.arguments_address)


@njit(forceinline=True)
def ray_component(component):  # type: ignore[no-untyped-def]
    """A component of a direction (or origin) as Embree is given it."""
    return component if abs(component) >= SMALLEST_COMPONENT else np.float32(0.0)


@njit(forceinline=True)
def set_pixel_ray(packet, width, lane, parallel, rays, x, y):  # type: ignore[no-untyped-def]
    """The direction (or origin, where rays are parallel) of pixel (x, y) into a lane of a packet of `width`."""
    first = (RAY_ORG_X if parallel else RAY_DIR_X) * width + lane
    packet.floats[first] = ray_component(rays.columns[0, x] + rays.rows[0, y])
    packet.floats[first + width] = ray_component(rays.columns[1, x] + rays.rows[1, y])
    packet.floats[first + 2 * width] = ray_component(rays.columns[2, x] + rays.rows[2, y])


@njit(forceinline=True)
def set_no_hit(packet, width, lane):  # type: ignore[no-untyped-def]
    """Nothing hit so far."""
    packet.ids[(RAY_WORDS + HIT_PRIM_ID) * width + lane] = MISS
    packet.ids[(RAY_WORDS + HIT_GEOM_ID) * width + lane] = MISS


@njit(forceinline=True)
def set_unlimited(packet, width):  # type: ignore[no-untyped-def]
    """All lanes reach to infinity and have hit nothing so far."""
    for lane in range(width):
        packet.floats[RAY_TFAR * width + lane] = INFINITY
        set_no_hit(packet, width, lane)


@njit(forceinline=True)
def hit_distance(packet, width, lane):  # type: ignore[no-untyped-def]
    """The ray parameter of the hit, or the limit that was given where there is none."""
    return packet.floats[RAY_TFAR * width + lane]


@njit(forceinline=True)
def hit_prim_id(packet, width, lane):  # type: ignore[no-untyped-def]
    """The triangle in the scene, or what stood there before."""
    return packet.ids[(RAY_WORDS + HIT_PRIM_ID) * width + lane]
