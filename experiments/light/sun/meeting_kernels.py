"""Kernels that trace parallel rays of one tile for all tiles at once: one answer bit per ray and tile."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from atra.compiled.intrinsics import address_at, emitting, fetch_add, pointer_at, uint32_at
from atra.compiled.lanes import nonzero_lanes
from atra.compiled.memory import store
from atra.compiled.store import callback, kernel
from atra.compiled.vectors import bits_of, splat
from atra.embree import layout
from atra.embree.filters_kernels import CONTEXT, HIT, RAY_COUNT, USER_DATA, VALID, refuse
from atra.embree.layout import RayQueryContext
from atra.embree.packets_kernels import INFINITY, intersect
from experiments.light.sun.tiles_kernels import ALL, SIDE

_ANSWERS = RayQueryContext.depth_address.offset


@intrinsic
def _set_bits_at(typingctx: Any, address: Any, bits: Any) -> Any:
    """Set bits in the uint16 at an address; bits: int64 below 2^16."""

    def emit(builder: ir.IRBuilder, address: ir.Value, bits: ir.Value) -> None:
        kind = ir.IntType(16)
        pointer = pointer_at(builder, address, kind.as_pointer())
        builder.store(builder.or_(builder.load(pointer), builder.trunc(bits, kind)), pointer)

    return types.void(types.int64, types.int64), emitting(emit)


@cache
def noting_filter(width: int) -> int:
    """Address of the filter for packets of `width` rays; compiled once per process, cached on disk.

    The filter sets the bits of rays that hit a triangle in the answer of the triangle's tile, and rejects the hit. The
    user data is one int64 per triangle, its tile.
    """
    hit_prim_id = layout.HIT_PRIM_ID * width * 4

    @callback(types.void(types.int64))
    def note_met(arguments):  # type: ignore[no-untyped-def]
        context, valid = address_at(arguments + CONTEXT), address_at(arguments + VALID)
        given = uint32_at(arguments + RAY_COUNT)
        if given == np.uint32(width):
            prim_id = uint32_at(address_at(arguments + HIT) + hit_prim_id)
            tile = address_at(address_at(arguments + USER_DATA) + np.int64(prim_id) * 8)
            _set_bits_at(address_at(context + _ANSWERS) + 2 * tile, bits_of(nonzero_lanes(valid, width)))
            store(splat(np.int32(0), width), valid)
        else:
            refuse(context, valid, given)

    _keep_alive.append(note_met)
    return note_met.address


_keep_alive: list[object] = []
"""Embree may call filters as long as a scene lives."""


class Shots(NamedTuple):
    """Rays of one tile in packets: a few neighbouring texels at a few positions in each.

    texels: (N, 2) float32, x and y of each packet's first texel. lanes: (G, W, 2) float32, ray origins relative to it,
    for G packets with the same texels. block: (size, size) int32, the packet that a texel is in. place: (size, size)
    int32, its first lane there. together: positions of a texel in one packet.
    """

    texels: NDArray[np.float32]
    lanes: NDArray[np.float32]
    block: NDArray[np.int32]
    place: NDArray[np.int32]
    together: int


@cache
def meeting_kernel(width: int) -> Callable[..., None]:
    """The kernel for packets of `width`."""

    @kernel
    def meet(counter_address, scene, packet, shots, answers):  # type: ignore[no-untyped-def]
        """Trace the rays of the tile; `noting_filter` writes the bits of all tiles.

        packet: its direction is (0, 0, 1). answers: (N G, K) uint16, written: by packet and tile.
        """
        first, groups = layout.RAY_ORG_X * width, len(shots.lanes)
        while True:
            number = fetch_add(counter_address, 1)
            if number >= len(answers):
                return
            answers[number, :] = 0
            texels, group = number // groups, number % groups
            for lane in range(width):
                for axis in range(2):
                    start = shots.texels[texels, axis] + shots.lanes[group, lane, axis]
                    packet.floats[first + axis * width + lane] = start
                packet.floats[layout.RAY_TFAR * width + lane] = INFINITY
            packet.context[_ANSWERS // 8] = answers.ctypes.data + number * answers.strides[0]
            intersect(width, packet.all_lanes, scene, packet)

    return meet


@kernel
def spread_answers(counter_address, answers, shots, prisms, covered, offsets, met):  # type: ignore[no-untyped-def]
    """Unpack answer bits into booleans.

    answers: (N G, K) uint16. covered: (K,) uint64, from `find_triangles`. offsets: (P, 2) float64. met: (K, size, size,
    P) bool, written.
    """
    size, groups, together = met.shape[1], len(shots.lanes), shots.together
    while True:
        tile = fetch_add(counter_address, 1)
        if tile >= len(met):
            return
        if covered[tile] == ALL:
            met[tile] = True
            continue
        per_x, per_y = SIDE / 2 / prisms.half[tile, 0], SIDE / 2 / prisms.half[tile, 1]
        left = size / 2 + prisms.middle[tile, 0] - prisms.half[tile, 0]
        top = size / 2 + prisms.middle[tile, 1] - prisms.half[tile, 1]
        for y in range(size):
            for x in range(size):
                row, place = shots.block[y, x] * groups, shots.place[y, x]
                for position in range(len(offsets)):
                    bits = np.int64(answers[row + position // together, tile])
                    found = bits >> (place + position % together) & 1
                    if covered[tile] != np.uint64(0):
                        i = min(max(np.int64((x + offsets[position, 0] - left) * per_x), 0), SIDE - 1)
                        j = min(max(np.int64((y + offsets[position, 1] - top) * per_y), 0), SIDE - 1)
                        found |= np.int64(covered[tile] >> np.uint64(SIDE * j + i)) & 1
                    met[tile, y, x, position] = found != 0
