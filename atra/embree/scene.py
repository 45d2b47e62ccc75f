"""An Embree scene of triangles, on a device of its own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.device import EmbreeDevice
from atra.embree.library import load_library
from atra.errors import ClosedError, InputError
from atra.whole_numbers import is_whole_number

BUILD_QUALITIES = tuple(layout.BUILD_QUALITY)
"""Embree's build qualities of a BVH, from the fastest build to the best BVH."""


class EmbreeScene(EmbreeDevice):
    """A committed Embree scene of triangles, or of instances of them, on a device of its own.

    vertices: (V, 3) float32 C-contiguous, with 16 readable bytes after the last vertex (`padded_vertices`).
    faces: (F, 3) uint32 C-contiguous.
    filter_address: compiled RTCFilterFunctionN, 0 = none; Embree passes `user_data` to it.
    transforms: (I, 3, 4) float32 C-contiguous, affine, row-major. If given, the scene holds an instance of the
    triangles for each, with `inst_id` 0 ... I - 1. The filter then sees rays in the triangles' own space.
    device: arguments of `EmbreeDevice`, which also says how a scene is closed.

    Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        *,
        filter_address: int = 0,
        user_data: NDArray | None = None,
        transforms: NDArray[np.float32] | None = None,
        **device: Any,
    ) -> None:
        super().__init__(**device)
        try:
            scene = self._new_scene()
            if len(faces):
                self._add_triangles(scene, vertices, faces, filter_address=filter_address, user_data=user_data)
            self._build(scene)
            if transforms is not None:
                triangles, scene = scene, self._new_scene()
                for inst_id, transform in enumerate(transforms):
                    self._add_instance(scene, triangles, transform, inst_id)
                self._build(scene)
        except BaseException:
            self.close()
            raise
        self._scene = scene

    @property
    def address(self) -> int:
        """The RTCScene handle for compiled code. Raises ClosedError after `close`."""
        if self.closed:
            raise ClosedError("this Embree scene is closed and cannot be traced any more")
        return self._scene


def resolve_packet_width(packet_width: int | None) -> int:
    """The packet width to use; None = the widest native one.

    Raises InputError for a width that is not native: Embree would give the filter other lanes than were sent.
    """
    native = load_library().native_packet_widths
    if packet_width is None:
        return native[-1]
    if not is_whole_number(packet_width) or packet_width not in native:
        raise InputError(f"packet_width is {packet_width!r}, this machine supports {', '.join(map(str, native))}")
    return int(packet_width)
