"""One scene of triangles on a device of its own: built once, traced, closed once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.embree import layout
from atra.embree.device import EmbreeDevice
from atra.embree.library import load_library
from atra.errors import EmbreeError, InputError
from atra.whole_numbers import is_whole_number

BUILD_QUALITIES = tuple(layout.BUILD_QUALITY)
"""How well Embree builds a BVH, and how long that takes, from the quickest to the best."""


class EmbreeScene(EmbreeDevice):
    """A committed Embree scene of triangles, or of instances of them, on a device of its own.

    vertices: (V, 3) float32 C-contiguous with at least 16 readable bytes after the last vertex,
    as `padded_vertices` of `atra.geometry.ray_space` has.
    faces: (F, 3) uint32 C-contiguous.
    filter_address: compiled RTCFilterFunctionN, or 0 for none; `user_data` is handed to it.
    transforms: (I, 3, 4) float32 C-contiguous: the triangles are put once into an inner scene, and the scene holds one
    instance of it per row-major affine transform, with `inst_id` 0 ... I - 1. The filter and `user_data` stay with the
    triangles; rays reach the filter transformed back into the triangles' space, with the ray parameter they have.
    Other arguments, and the lifetime, as for `EmbreeDevice`.

    Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        *,
        build_quality: str = "medium",
        threads: int = 1,
        filter_address: int = 0,
        user_data: NDArray | None = None,
        monitor_address: int = 0,
        transforms: NDArray[np.float32] | None = None,
        compact: bool = False,
        robust: bool = False,
        filter_in_arguments: bool = False,
    ) -> None:
        super().__init__(
            build_quality=build_quality,
            threads=threads,
            monitor_address=monitor_address,
            compact=compact,
            robust=robust,
            filter_in_arguments=filter_in_arguments,
        )
        try:
            scene = self._new_scene()
            if len(faces):
                self._add_triangles(scene, vertices, faces, filter_address=filter_address, user_data=user_data)
            self._commit(scene)
            if transforms is not None:
                triangles, scene = scene, self._new_scene()
                for inst_id, transform in enumerate(transforms):
                    self._add_instance(scene, triangles, transform, inst_id)
                self._commit(scene)
        except BaseException:
            self.close()
            raise
        self._scene = scene

    @property
    def address(self) -> int:
        """The RTCScene handle for compiled code. Raises EmbreeError after `close`."""
        if self.closed:
            raise EmbreeError("this Embree scene is closed and cannot be traced any more")
        return self._scene


def resolve_packet_width(packet_width: int | None) -> int:
    """The packet width to use: the widest native one for None, else the given one.

    Raises InputError for a width this machine does not support natively: Embree would split or pad such packets, and
    the filter would see other lanes than were sent.
    """
    native = load_library().native_packet_widths
    if packet_width is None:
        return native[-1]
    if not is_whole_number(packet_width) or packet_width not in native:
        raise InputError(f"packet_width is {packet_width!r}, this machine supports {', '.join(map(str, native))}")
    return int(packet_width)
