"""The second pass of a frame: trace what the aligned pass left out, pixel by pixel, up to the depth already found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from atra.alignment.aligned_kernels import Hidden, verify_kernel
from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions
from atra.alignment.visibility import Tiles, nearest_in_tiles
from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import Image, RayGrid
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.geometry.mesh import Mesh, position_keys
from atra.geometry.view import View
from atra.tracing.embree import build_scene
from atra.tracing.geometry import LeftOut, plan_plain_geometry
from atra.tracing.rays import SQUAREST_SHAPE, image_ray_grid, share_direction

SECOND_PASS_TILE = (8, 4)
"""Tile size of the second pass, (width, height) in pixels: whole packets of any shape."""


class SecondPass:
    """Traces an image in packets of pixels, tile by tile, and lets nearer hits replace those of the first pass.

    A packet is skipped if its hits are nearer than anything in the scene can be in its tile; otherwise it is traced
    from that depth to the depth found.

    scene: triangles in the camera's ray space, with the mesh's prim_ids; `close` closes it. nearest: (tile rows, tile
    columns) float32, no ray of a tile meets the scene before this depth; inf = never.
    """

    def __init__(
        self,
        scene: EmbreeScene,
        camera: View,
        tiles: Tiles,
        nearest: NDArray[np.float32],
        packet_width: int,
        pool: WorkerPool,
    ) -> None:
        self.scene = scene
        self._camera, self._tiles, self._nearest = camera, tiles, nearest
        self._packet_shape, self._pool = SQUAREST_SHAPE[packet_width], pool
        self._packets_traced = np.zeros((1, 1), np.int64)

    def trace(
        self,
        workspaces: Sequence[Workspace],
        offset: tuple[float, float],
        depth: NDArray[np.float32],
        prim_id: NDArray[np.uint32],
    ) -> None:
        """Update the first pass's image; depth, prim_id: (H, W), changed in place."""
        camera, tiles, scene = self._camera, self._tiles, self.scene.address
        rays, image = RayGrid(*image_ray_grid(camera, offset)), Image(depth, prim_id)
        hidden = Hidden(self._nearest, tiles.tile_width, tiles.tile_height)
        kernel = verify_kernel(*self._packet_shape, camera.is_parallel)
        self._packets_traced = np.zeros((len(workspaces), 16), np.int64)  # separate cache lines per thread

        share_direction(workspaces, camera)

        def work(worker: int, counter: int) -> None:
            kernel(counter, scene, workspaces[worker].packet, rays, hidden, image, self._packets_traced[worker])

        self._pool.run(work)

    @property
    def packets_traced(self) -> int:
        """Packets traced in the last frame."""
        return int(self._packets_traced[:, 0].sum())

    def close(self) -> None:
        self.scene.close()


def left_out_passes(
    meshes: Sequence[Mesh],
    alignment: Alignment,
    left_out: Sequence[LeftOut | None],
    options: CellOptions,
    pool: WorkerPool,
) -> list[SecondPass | None]:
    """Build a second pass for each image of an alignment; None where no copy was left out. meshes: one per image."""
    passes: list[SecondPass | None] = []
    for mesh, camera, without in zip(meshes, alignment.cameras, left_out, strict=True):
        if without is None:
            passes.append(None)
            continue
        if options.robust:
            shown = with_neighbours(mesh, without.prim_ids)
        else:
            shown = np.zeros(mesh.triangle_count, np.bool_)
            shown[without.prim_ids] = True
        plain = plan_plain_geometry(mesh, camera, ~shown)
        tiles = Tiles(*SECOND_PASS_TILE, camera.width, camera.height)
        nearest = nearest_in_tiles(mesh, camera, tiles, without)
        scene = build_scene(plain, pool.threads, build_quality=options.build_quality, robust=options.robust)
        passes.append(SecondPass(scene, camera, tiles, nearest, options.rays_per_packet, pool))
    return passes


def with_neighbours(mesh: Mesh, prim_ids: NDArray[np.integer]) -> NDArray[np.bool_]:
    """(F,) bool: the triangles `prim_ids`, (N,) with N > 0, and all that share a corner's position with one of them.

    Copies and the mesh are rounded differently, so a ray could slip through between a copy and an uncopied neighbour.
    Tracing the neighbours in the mesh as well closes the gap.
    """
    keys = position_keys(mesh)
    wanted = np.unique(keys[mesh.faces[prim_ids]])
    found = np.minimum(np.searchsorted(wanted, keys), len(wanted) - 1)
    is_near: NDArray[np.bool_] = (wanted[found] == keys)[mesh.faces].any(axis=1)
    return is_near
