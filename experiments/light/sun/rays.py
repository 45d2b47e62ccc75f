"""Rays of one square tile; each stands for a ray of every one of many tiles."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.filters_kernels import memory_monitor
from atra.embree.scene import EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.geometry.ray_space import padded_vertices
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, PLAN_BYTES_PER_COPY, check_needed_bytes
from experiments.light.sun.meeting_kernels import Shots, meeting_kernel, noting_filter, spread_answers
from experiments.light.sun.tiles_kernels import BoxTree, Prisms, carry_triangles, find_triangles

SHAPES = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4)}
"""Texels of a packet across and down, by their number."""

_COPIES = 1 << 22
"""Initial room for copies; memory is only taken as far as it is used."""

_BUILD_QUALITY = "low"
"""A BVH of copies serves only one direction, which does not repay a better build."""


@dataclass
class TileRays:
    """Whether parallel rays of tiles hit a mesh: tracing one tile's rays answers for K tiles; made by `tile_rays`.

    size: rays along a side of a tile, 1 apart, around (0, 0). covered: (K,) uint64, blocks of each tile that triangles
    cover. triangle_count: copies for all tiles.
    """

    prisms: Prisms
    size: int
    packet_width: int
    pool: WorkerPool
    scene: EmbreeScene
    covered: NDArray[np.uint64]
    triangle_count: int

    def __post_init__(self) -> None:
        self._workspaces = [
            Workspace(self.packet_width, coherent=True, direction=(0.0, 0.0, 1.0)) for _ in range(self.pool.threads)
        ]

    def trace(self, offsets: ArrayLike, out: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """(K, size, size, P) bool: which rays hit anything; ray (y, x, p) starts at (x, y) + offset p - size / 2.
        Values outside a tile's rectangle (`Prisms`) are undefined.

        offsets: (P, 2), positions in a texel. out: an earlier result of the same shape, overwritten.
        """
        positions = np.array(offsets, np.float64)
        shots = shots_of(self.size, positions, self.packet_width)
        answers = np.empty((len(shots.texels) * len(shots.lanes), len(self.covered)), np.uint16)
        met = np.empty((len(self.covered), self.size, self.size, len(positions)), np.bool_) if out is None else out
        scene, kernel = self.scene.address, meeting_kernel(self.packet_width)
        self.pool.run(lambda worker, counter: kernel(counter, scene, self._workspaces[worker].packet, shots, answers))
        check_widths(self._workspaces)
        self.pool.run(
            lambda _, counter: spread_answers(counter, answers, shots, self.prisms, self.covered, positions, met)
        )
        return met


@contextmanager
def tile_rays(
    tree: BoxTree, prisms: Prisms, size: int, threads: int | None = None, packet_width: int | None = None
) -> Iterator[TileRays]:
    """Plan and build `TileRays`, and close them at the end.

    tree: the mesh. prisms: what each tile's rays sweep, and the maps onto the rays of the one tile, which start at z =
    0 along z. Triangles are copied for each tile they lie in front of (paper §3.3); a tile fully covered by one
    triangle needs no copies. Raises MemoryBudgetError.
    """
    width = resolve_packet_width(packet_width)
    with closing(WorkerPool(resolve_threads(threads))) as pool:
        vertices, tile_of, covered = _copied(pool, tree, prisms)
        with closing(EmbreeScene(
            vertices, np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3), build_quality=_BUILD_QUALITY,
            threads=pool.threads, robust=True, filter_address=noting_filter(width), user_data=tile_of,
            monitor_address=memory_monitor(),
        )) as scene:  # fmt: skip
            yield TileRays(prisms, size, width, pool, scene, covered, len(tile_of))


def _copied(
    pool: WorkerPool, tree: BoxTree, prisms: Prisms
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.uint64]]:
    """The copies of triangles for all tiles on the one tile, (3 N, 3), the tile of each, and the covered blocks."""
    count, faces = len(prisms.onto), len(tree.faces)
    starts, counts, covered = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.uint64)

    def find(kept: NDArray[np.uint32]) -> int:
        """Count the copies. kept: their triangles, as far as there is room."""
        total = np.zeros(1, np.int64)
        found = [(np.empty(faces, np.uint32), np.empty(faces, np.uint64)) for _ in range(pool.threads)]
        pool.run(
            lambda worker, counter: find_triangles(
                counter, total.ctypes.data, tree, prisms, *found[worker], kept, starts, counts, covered
            )
        )
        return int(total[0])

    kept = np.empty(_COPIES, np.uint32)
    copies = find(kept)
    needed = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY[_BUILD_QUALITY])
    what = f"{copies:,} copies of triangles for {count:,} tiles"
    check_needed_bytes(needed, None, what, "use fewer tiles, or more memory")
    if copies > len(kept):
        kept = np.empty(copies, np.uint32)
        find(kept)
    vertices, tile_of = padded_vertices(3 * copies), np.empty(copies, np.int64)
    where = tree, prisms, kept, starts, counts, vertices, tile_of
    pool.run(lambda _, counter: carry_triangles(counter, *where))
    return vertices, tile_of, covered


def shots_of(size: int, positions: NDArray[np.float64], width: int) -> Shots:
    """The rays of a tile in packets of `width`, with as many positions of a texel in one packet as fit."""
    together = 1 << (min(width, len(positions)).bit_length() - 1)
    across, down = SHAPES[width // together]
    y, x = np.mgrid[:size, :size]
    columns = -(-size // across)
    block, texel = y // down * columns + x // across, y % down * across + x % across
    number = np.arange(columns * -(-size // down))
    texels = np.stack([number % columns * across, number // columns * down], axis=1) - size / 2
    groups = -(-len(positions) // together)
    some = np.resize(positions, (groups * together, 2)).reshape(groups, 1, together, 2)  # pads with the first ones
    beside = np.array([(x, y) for y in range(down) for x in range(across)])[:, None]
    lanes = (some + beside).reshape(groups, width, 2).astype(np.float32)
    place = (texel * together).astype(np.int32)
    return Shots(texels.astype(np.float32), lanes, block.astype(np.int32), place, together)
