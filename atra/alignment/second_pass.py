"""The second pass of a frame: trace what the aligned pass left out, pixel by pixel, up to the depth already found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.alignment.cells import CellOptions
from atra.alignment.visibility_kernels import TileGrid, hide
from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import PixelTiles, TracedImage
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.geometry.mesh import Mesh, position_keys
from atra.geometry.view import View
from atra.packets.loop import Packets, trace_packets
from atra.packets.loop_kernels import NEARER
from atra.tracing.geometry import LeftOut, plan_plain_geometry
from atra.tracing.rays import SQUAREST_SHAPE, image_ray_grid

SECOND_PASS_TILE = (8, 4)
"""Tile size for triangles without copies, (width, height) in pixels: whole packets of any shape."""

DEPTH_SLACK = 1e-4
"""Smallest relative margin on the depth of what is left out; a triangle's float32 error replaces it where larger."""


@dataclass(eq=False)
class SecondPass:
    """Traces an image in packets of pixels, tile by tile, and lets nearer hits replace those of the first pass.

    A packet is skipped if its hits are nearer than anything in the scene can be in its tile; otherwise it is traced
    from that depth to the depth found.

    scene: triangles in the camera's ray space, with the mesh's prim_ids. tiles: those whose rays may meet the scene,
    and nearest: (N,) float32, not before this depth. packets_traced: in the last frame.
    """

    scene: EmbreeScene
    camera: View
    tiles: PixelTiles
    nearest: NDArray[np.float32]
    packet_width: int
    packets_traced: int = 0

    def trace(
        self,
        workspaces: Sequence[Workspace],
        offset: tuple[float, float],
        depth: NDArray[np.float32],
        prim_id: NDArray[np.uint32],
        pool: WorkerPool,
    ) -> None:
        """Update the first pass's image; depth, prim_id: (H, W), changed in place."""
        camera, shape = self.camera, SQUAREST_SHAPE[self.packet_width]
        rays, size = image_ray_grid(camera, offset, shape), (camera.width, camera.height)
        packets = Packets(self.scene.address, shape, camera, rays, self.tiles, size, NEARER)
        self.packets_traced = trace_packets(packets, workspaces, pool, TracedImage(depth, prim_id), self.nearest)


def left_out_pass(
    mesh: Mesh, camera: View, left_out: LeftOut | None, options: CellOptions, pool: WorkerPool
) -> SecondPass | None:
    """Build a second pass through the triangles of an image that have no copies; None if all have."""
    if left_out is None:
        return None
    shown = np.zeros(mesh.triangle_count, np.bool_)
    shown[left_out.prim_ids] = True
    if options.robust:
        shown |= _neighbours(mesh, left_out.prim_ids)
    tiles = left_out_tiles(mesh, camera, left_out)
    scene = plan_plain_geometry(mesh, camera, ~shown).build(pool.threads, **options.scene_settings)
    return SecondPass(scene, camera, *tiles, options.rays_per_packet)


def _neighbours(mesh: Mesh, prim_ids: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(F,) bool: the triangles that share a corner's position with one of `prim_ids`, (N,) with N > 0.

    Copies and the mesh are rounded differently, so a ray could slip through between a copy and an uncopied neighbour.
    Tracing the neighbours in the mesh as well closes the gap.
    """
    keys = position_keys(mesh)
    wanted = np.unique(keys[mesh.faces[prim_ids]])
    found = np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)
    is_near: NDArray[np.bool_] = (wanted[found] == keys)[mesh.faces].any(axis=1)
    return is_near


def left_out_tiles(mesh: Mesh, camera: View, left_out: LeftOut) -> tuple[PixelTiles, NDArray[np.float32]]:
    """The tiles whose rays may meet a left-out triangle, and the depths before which they do not."""
    grid = TileGrid(*SECOND_PASS_TILE, camera.width, camera.height)
    return tiles_before(nearest_in_tiles(mesh, camera, left_out), grid)


def tiles_before(nearest: NDArray[np.float32], grid: TileGrid) -> tuple[PixelTiles, NDArray[np.float32]]:
    """The tiles of a grid, (tile rows, tile columns), whose depth is finite, and these depths."""
    rows, columns = np.nonzero(np.isfinite(nearest))
    corners = np.stack([columns * grid.tile_width, rows * grid.tile_height], axis=1).astype(np.int32)
    return PixelTiles(corners, grid.tile_width, grid.tile_height), nearest[rows, columns]


def nearest_in_tiles(mesh: Mesh, camera: View, left_out: LeftOut) -> NDArray[np.float32]:
    """(tile rows, tile columns) float32: no ray of a tile meets a left-out triangle before this depth; inf where none
    is met. For parallel rays it is 0 or inf: what is left out lies near the image plane."""
    grid = TileGrid(*SECOND_PASS_TILE, camera.width, camera.height)
    hidden, slack = np.zeros(grid.shape), np.maximum(left_out.depth_error, DEPTH_SLACK)
    hide(left_out.points_pixels, mesh.traced_faces[left_out.prim_ids], grid, slack, hidden)
    nearest = nearest_of(hidden)
    return np.where(np.isfinite(nearest), np.float32(0.0), nearest) if camera.is_parallel else nearest


def nearest_of(inverse_depth: NDArray[np.float64]) -> NDArray[np.float32]:
    """Nearest depths from the largest inverse depths."""
    with np.errstate(divide="ignore"):
        return (1.0 / inverse_depth).astype(np.float32)
