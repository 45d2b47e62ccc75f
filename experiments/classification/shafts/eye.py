"""One ray per pixel through a BVH in world space; each tile of the image starts from a list of nodes of its own."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.embree.packets_kernels import PixelTiles
from atra.errors import InputError, MemoryBudgetError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import NARROWEST_WORLD_PITCH, check_range, check_world_range, from_eye_space
from atra.geometry.view import View
from atra.tracing.rays import check_pinhole
from atra.tracing.tracer import Tracer
from experiments.classification.bvh.binary import bvh_of
from experiments.classification.bvh.images import Start
from experiments.classification.bvh.starts import NO_SHAFTS, Shafts
from experiments.classification.bvh.tracer import OwnBvh, PreparedBvh
from experiments.classification.shafts.lists_kernels import build_lists
from experiments.classification.shafts.options import ShaftOptions
from experiments.classification.shafts.shafts import ShaftLists, building_of, stored_lists
from experiments.classification.shafts.shape_kernels import (
    ACROSS,
    AXIS,
    CORNER,
    DOWN,
    EYE,
    HIGH,
    LOW,
    MIDDLE,
    PLANE_COUNT,
    PLANES,
    SHAPE,
)
from experiments.classification.shafts.tracer import PreparedShafts

_SLOPE_SLACK = 2.0**-18
"""Margin on the slopes of a tile's border: many roundings of a float32 direction."""

_SLACK, _ROBUST_SLACK = 4.0, 64.0
"""Margin of the test of boxes against a shaft, in float32 spacings of the largest coordinate; see
`shafts.shafts.ROBUST_SLACK`. The eye may be as far away as the farthest corner, on the other side."""


class PreparedEye(PreparedShafts):
    """A BVH in world space, which serves every eye, and a list of nodes for each tile of a camera's image."""

    start: ClassVar[Start] = Start.tile

    def _build(self) -> None:
        self.bvh = bvh_of(self._mesh, self._mesh.local_vertices, self._pool)
        self._build_lists()

    def _build_lists(self) -> None:
        start = perf_counter()
        largest = max(float(np.abs(self.bvh.bounds).max()), float(np.abs(self._shared).max()))
        slack = (_ROBUST_SLACK if self.options.robust else _SLACK) * float(np.spacing(np.float32(largest)))
        shapes = shapes_of_tiles(self.camera, self._shared.astype(np.float64), self.tiles, slack)
        building = building_of(self.bvh, self.options, NO_SHAFTS.grid)

        def build(counter: int, part: slice, lengths: Any, nodes: Any, memory: Any) -> None:
            build_lists(counter, building, np.arange(len(lengths)), shapes[part], lengths, nodes, memory)

        starts, lengths, lists, unique = stored_lists(len(shapes), self.options, self._pool, build)
        shafts = Shafts(NO_SHAFTS.grid, NO_SHAFTS.rows, starts[None], lists, empty_is_miss=True)
        taken_s = perf_counter() - start
        self.lists = ShaftLists(shafts, self.bvh, len(shapes), len(shapes), unique, lengths, taken_s)

    def still_serves(self, camera: View) -> bool:
        """Take any camera, with new lists."""
        self._take(camera)
        try:
            self._build_lists()
        except MemoryBudgetError:  # building anew raises it where it is expected
            return False
        return True

    @property
    def _shared(self) -> NDArray[np.float32]:
        """(3,) float32, the eye, around the mesh's origin."""
        return (np.asarray(self.camera.eye) - self._mesh.origin).astype(np.float32)


@dataclass(frozen=True)
class EyeShafts(OwnBvh):
    """Rays that start from the lists of their tiles as a method."""

    prepared: ClassVar[type[PreparedBvh]] = PreparedEye

    def check(self, mesh: Mesh, camera: View) -> None:
        """Raise InputError for parallel rays, a lens, and pixels so narrow that rays along the world's axes merge."""
        check_pinhole(camera, "EyeTracer")
        if not np.array_equal(from_eye_space(camera), np.eye(3)):
            raise InputError(
                f"pixels are {camera.pixel_pitch:g} wide at depth 1, expected at least {NARROWEST_WORLD_PITCH:g}, or "
                "rays in the world's axes merge; use BvhTracer"
            )
        check_world_range(mesh)
        check_range(mesh, camera)


def EyeTracer(mesh: Mesh, camera: View, **options: Any) -> Tracer:
    """One ray per pixel, single or in packets; each tile of 32 x 16 pixels starts from the list of its own shaft.

    All rays of such a shaft start at the eye. The BVH is in world space and serves every eye, so a camera that moves
    needs new lists only. Rays start at the eye rounded to float32: an eye far from the mesh's origin makes images less
    precise than those of `BvhTracer`, though the same to the bit for all options. options: fields of `ShaftOptions`;
    those on voxels, memory, subsets and orders are not used. Raises what `BvhTracer` does; InputError for parallel rays
    and for pixels so narrow that rays along the world's axes would merge. Source: A. Reshetov, A. Soupikov, J. Hurley,
    "Multi-level ray tracing algorithm", 2005, for starting the rays of a tile below the root; J. Hendrich et al., "Ray
    classification for accelerated BVH traversal", 2019, for the lists.
    """
    return EyeShafts(ShaftOptions(**options)).tracer(mesh, camera)


def shapes_of_tiles(camera: View, eye: NDArray[np.float64], tiles: PixelTiles, slack: float) -> NDArray[np.float64]:
    """(T, SHAPE) float64: the shafts from an eye through the tiles of an image, all sub-pixel offsets included.

    slack: margin around a shaft's planes within which a box counts as inside.
    """
    right, down, forward = camera.axes
    corners, plane = tiles.corners.astype(np.int64), camera.plane
    x0, x1 = (plane.columns(x, 0.0) * plane.pitch_x for x in _ends(corners[:, 0], tiles.width, camera.width))
    y0, y1 = (plane.rows(y, 0.0) * plane.pitch_y for y in _ends(corners[:, 1], tiles.height, camera.height))
    more = _SLOPE_SLACK * (1.0 + np.maximum(np.abs(x0), np.abs(x1)) ** 2 + np.maximum(np.abs(y0), np.abs(y1)) ** 2)
    shapes = np.zeros((len(corners), SHAPE))
    shapes[:, LOW : LOW + 3] = shapes[:, HIGH : HIGH + 3] = eye
    shapes[:, AXIS] = EYE
    shapes[:, CORNER : CORNER + 3] = forward + x0[:, None] * right + y0[:, None] * down
    shapes[:, ACROSS : ACROSS + 3] = (x1 - x0)[:, None] * right
    shapes[:, DOWN : DOWN + 3] = (y1 - y0)[:, None] * down
    shapes[:, MIDDLE : MIDDLE + 3] = forward + ((x0 + x1)[:, None] * right + (y0 + y1)[:, None] * down) / 2
    planes = shapes[:, PLANES:].reshape(-1, PLANE_COUNT, 4)
    planes[:, 0, :3] = right - (x0 - more)[:, None] * forward
    planes[:, 1, :3] = (x1 + more)[:, None] * forward - right
    planes[:, 2, :3] = down - (y0 - more)[:, None] * forward
    planes[:, 3, :3] = (y1 + more)[:, None] * forward - down
    planes[:, 4, :3] = forward
    planes[:, :, 3] = slack * np.abs(planes[:, :, :3]).sum(axis=2) - planes[:, :, :3] @ eye
    return shapes


def _ends(first: NDArray[np.int64], size: int, limit: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last pixel of tiles along one side of the image."""
    return first, np.minimum(first + size, limit)
