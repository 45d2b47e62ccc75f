"""Frames: what several images traced at once hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits


@dataclass(frozen=True, eq=False)
class Frames:
    """The nearest hits of K images of one size, in order; `frames[k]` is frame k as `Hits`.

    depth: (K, H, W) float32, along each frame's own view axis, inf = miss. prim_id: (K, H, W) uint32 in the numbering
    of the frame's mesh, `MISS` = miss. offset: the sub-pixel position of the rays. meshes, cameras: of each frame.
    threads: as of `Hits`.
    """

    depth: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    offset: tuple[float, float]
    meshes: tuple[Mesh, ...] = field(repr=False)
    cameras: tuple[View, ...] = field(repr=False)
    threads: int | None = field(default=None, repr=False)

    @property
    def images(self) -> tuple[Hits, ...]:
        """All frames, in order."""
        return tuple(self)

    def __len__(self) -> int:
        return len(self.cameras)

    def __getitem__(self, frame: int) -> Hits:
        mesh, camera = self.meshes[frame], self.cameras[frame]
        return Hits(self.depth[frame], self.prim_id[frame], self.offset, mesh, camera, self.threads)

    def __iter__(self) -> Iterator[Hits]:
        return (self[frame] for frame in range(len(self)))
