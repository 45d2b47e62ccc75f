"""The memory of one thread's queries to Embree: packet, lane mask, arguments and context."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.embree import layout
from atra.embree.layout import IntersectArguments, Packet, RayQueryContext
from atra.errors import EmbreeError

_DIRECTION_FIELDS = (layout.RAY_DIR_X, layout.RAY_DIR_Y, layout.RAY_DIR_Z)


class Workspace:
    """The query memory of one thread for packets of `width` rays.

    coherent: as for `set_coherent`. direction: three numbers, the direction of parallel rays; None: rays share their
    origin, which is zero, unless kernels set it.
    packet: as kernels take it, with every lane active. flags: (1,) uint32, the flags of a query.
    """

    def __init__(self, width: int, *, coherent: bool, direction: Sequence[float] | None = None) -> None:
        packet_bytes = layout.packet_words(width) * 4
        sizes = (packet_bytes, width * 4, width * 4, layout.CONTEXT_BYTES, layout.ARGUMENTS_BYTES)
        packet, all_lanes, valid, context, arguments = (_zeros(size) for size in sizes)
        self.width = width
        self._arguments = arguments  # keeps it alive: Embree is given its address
        self.flags = arguments[:4].view(np.uint32)  # the first field of IntersectArguments
        self.packet = Packet(
            packet.view(np.float32),
            packet.view(np.uint32),
            all_lanes.view(np.int32),
            valid.view(np.int32),
            context.view(np.int64),
            arguments.ctypes.data,
        )
        floats, ids = self.packet.floats, self.packet.ids
        self._lanes(floats, layout.RAY_TNEAR, width)[:] = layout.AFTER_START
        if direction is not None:
            self.set_direction(direction)
        self._lanes(ids, layout.RAY_MASK, width)[:] = layout.INVALID_ID
        ids[layout.RAY_WORDS * width :] = layout.INVALID_ID
        self.packet.all_lanes[:] = -1
        self.packet.valid[:] = -1

        query_context = RayQueryContext.from_buffer(context.data)
        query_context.inst_id = query_context.inst_prim_id = layout.INVALID_ID
        self.set_coherent(coherent)
        query = IntersectArguments.from_buffer(arguments.data)
        query.feature_mask = layout.FEATURE_ALL
        query.context = context.ctypes.data

    @staticmethod
    def _lanes(words: np.ndarray, field: int, width: int) -> np.ndarray:
        return words[field * width : (field + 1) * width]

    @property
    def wrong_width(self) -> int:
        """The packet width that Embree passed to the filter if it was not the one sent; else 0."""
        return int(self.packet.context[RayQueryContext.wrong_width.offset // 8])

    def set_coherent(self, coherent: bool) -> None:
        """Tell Embree whether the rays of a packet are alike in origin and direction, and may be traced together."""
        IntersectArguments.from_buffer(self._arguments.data).flags = layout.FLAG_COHERENT if coherent else 0

    def set_direction(self, direction: Sequence[float]) -> None:
        """Set the direction of all rays, three numbers; it only has an effect for kernels of parallel rays."""
        for field, value in zip(_DIRECTION_FIELDS, direction, strict=True):
            self._lanes(self.packet.floats, field, self.width)[:] = value

    def gather_with(self, filter_address: int, block_address: int) -> None:
        """Let queries call a filter that gathers into the `Target` at block_address; 0, 0: no filter any more."""
        query = IntersectArguments.from_buffer(self._arguments.data)
        query.flags = query.flags & ~layout.FLAG_FILTER_IN_ARGUMENTS
        query.flags |= layout.FLAG_FILTER_IN_ARGUMENTS if filter_address else 0
        query.filter = filter_address
        self.packet.context[RayQueryContext.target_address.offset // 8] = block_address

    def set_row_bytes(self, row_bytes: int) -> None:
        """Set the distance in bytes between the image rows that the filter writes."""
        self.packet.context[RayQueryContext.row_bytes.offset // 8] = row_bytes


def check_widths(workspaces: Iterable[Workspace]) -> None:
    """Raise EmbreeError if Embree passed packets of another width than were sent to the filter."""
    for workspace in workspaces:
        if workspace.wrong_width:
            handed, width = workspace.wrong_width, workspace.width
            raise EmbreeError(f"Embree handed the filter {handed} rays instead of {width}; hits were lost")


def _zeros(size: int) -> NDArray[np.uint8]:
    """Zeroed bytes in cache lines of their own, which two threads never share."""
    line = layout.PACKET_ALIGNMENT_BYTES
    memory = aligned_empty((-(-size // line) * line,), np.uint8)
    memory[:] = 0
    return memory
