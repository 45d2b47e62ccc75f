"""Many small Embree scenes with one vertex buffer, on a device of their own."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.embree.device import EmbreeDevice
from atra.errors import ClosedError


class EmbreeScenes(EmbreeDevice):
    """Committed Embree scenes; scene k holds the triangles faces[starts[k]] ... faces[starts[k + 1] - 1].

    vertices, faces: as for `EmbreeScene`; all scenes share the vertices, and a hit's prim_id counts from the scene's
    first triangle. starts: (scenes + 1,) int64, ascending. device: as for `EmbreeScene`.

    Raises EmbreeError naming the call that failed.
    """

    def __init__(
        self, vertices: NDArray[np.float32], faces: NDArray[np.uint32], starts: NDArray[np.int64], **device: Any
    ) -> None:
        super().__init__(**device)
        self._handles = np.zeros(len(starts) - 1, np.int64)
        try:
            for k in np.nonzero(np.diff(starts))[0]:
                self._handles[k] = scene = self._new_scene()
                self._add_triangles(scene, vertices, faces[starts[k] : starts[k + 1]])
                self._build(scene)
        except BaseException:
            self.close()
            raise

    @property
    def handles(self) -> NDArray[np.int64]:
        """(scenes,) int64, RTCScene handles for compiled code, 0 = no triangle. Raises ClosedError after `close`."""
        if self.closed:
            raise ClosedError("these Embree scenes are closed and cannot be traced any more")
        return self._handles
