"""Rays of one square tile; each stands for a ray of every one of many tiles."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.choices import check_choice, check_flags
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.filters_kernels import memory_monitor
from atra.embree.scene import BUILD_QUALITIES, EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.errors import InputError
from atra.geometry.ray_space import padded_vertices
from atra.geometry.view import check_offset
from atra.tracing.budgets import EMBREE_BYTES_PER_COPY, PLAN_BYTES_PER_COPY, check_needed_bytes
from atra.tracing.lifetime import Lifetime
from experiments.light.sun.meeting_kernels import Shots, meeting_kernel, noting_filter, spread_answers
from experiments.light.sun.tiles_kernels import BoxTree, Prisms, carry_triangles, find_triangles

SHAPES = {1: (1, 1), 2: (2, 1), 4: (2, 2), 8: (4, 2), 16: (4, 4)}
"""Texels of a packet across and down, by their number."""

_COPIES = 1 << 22
"""Initial room for copies; memory is only taken as far as it is used."""


class TileRays(Lifetime):
    """Whether parallel rays of tiles hit a mesh: tracing one tile's rays answers for K tiles.

    tree: the mesh. prisms: what each tile's rays sweep, and the maps onto the rays of the one tile, which start at z =
    0 along z. size: rays along a side of a tile, 1 apart, around (0, 0). Other arguments: as for `atra.PixelTracer`.
    Triangles are copied for each tile they lie in front of (paper §3.3); a tile fully covered by one triangle needs no
    copies. Raises InputError for an option's value, MemoryBudgetError in `plan`.
    """

    def __init__(
        self,
        tree: BoxTree,
        prisms: Prisms,
        size: int,
        *,
        threads: int | None = None,
        packet_width: int | None = None,
        build_quality: str = "medium",
        robust: bool = True,
    ) -> None:
        super().__init__()
        check_choice("build_quality", build_quality, BUILD_QUALITIES)
        check_flags(robust=robust)
        self._build_quality, self._robust = build_quality, robust
        self.tree, self.prisms, self.size = tree, prisms, size
        self.packet_width = resolve_packet_width(packet_width)
        self._pool = WorkerPool(resolve_threads(threads))
        self._workspaces = [
            Workspace(self.packet_width, coherent=True, direction=(0.0, 0.0, 1.0)) for _ in range(self._pool.threads)
        ]
        self._scene: EmbreeScene | None = None
        self._tile_of = np.empty(0, np.int64)

    def _build(self) -> tuple[float, float]:
        plan_time_s = self._plan()
        return plan_time_s, self._build_scene()

    def _plan(self) -> float:
        start, count = perf_counter(), len(self.prisms.onto)
        self._starts, self._counts = np.empty(count, np.int64), np.empty(count, np.int64)
        self._covered = np.empty(count, np.uint64)
        kept = np.empty(_COPIES, np.uint32)
        copies = self._find(kept)
        needed = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY[self._build_quality])
        what = f"{copies:,} copies of triangles for {count:,} tiles"
        check_needed_bytes(needed, None, what, "use fewer tiles, or more memory")
        if copies > len(kept):
            kept = np.empty(copies, np.uint32)
            self._find(kept)
        self._vertices, self._tile_of = padded_vertices(3 * copies), np.empty(copies, np.int64)
        where = self.tree, self.prisms, kept, self._starts, self._counts, self._vertices, self._tile_of
        self._pool.run(lambda _, counter: carry_triangles(counter, *where))
        return perf_counter() - start

    def _find(self, kept: NDArray[np.uint32]) -> int:
        """Count the copies. kept: their triangles, as far as there is room."""
        total, faces = np.zeros(1, np.int64), len(self.tree.faces)
        found = [(np.empty(faces, np.uint32), np.empty(faces, np.uint64)) for _ in range(self._pool.threads)]
        outputs = kept, self._starts, self._counts, self._covered
        self._pool.run(
            lambda worker, counter: find_triangles(
                counter, total.ctypes.data, self.tree, self.prisms, *found[worker], *outputs
            )
        )
        return int(total[0])

    def _build_scene(self) -> float:
        filter_address, monitor_address = noting_filter(self.packet_width), memory_monitor()
        start = perf_counter()
        faces = np.arange(len(self._vertices), dtype=np.uint32).reshape(-1, 3)
        self._close_scene()
        self._scene = EmbreeScene(
            self._vertices,
            faces,
            build_quality=self._build_quality,
            threads=self._pool.threads,
            robust=self._robust,
            filter_address=filter_address,
            user_data=self._tile_of,
            monitor_address=monitor_address,
        )
        return perf_counter() - start

    @property
    def triangle_count(self) -> int:
        """Copies for all tiles; 0 before `build`."""
        return len(self._tile_of)

    def trace(self, offsets: ArrayLike, out: NDArray[np.bool_] | None = None) -> NDArray[np.bool_]:
        """(K, size, size, P) bool: which rays hit anything; ray (y, x, p) starts at (x, y) + offset p - size / 2.
        Values outside a tile's rectangle (`Prisms`) are undefined.

        offsets: (P, 2), positions in a texel. out: an earlier result of the same shape, overwritten. Raises InputError
        for offsets of another shape or outside [0, 1) x [0, 1) and an `out` that does not fit, MemoryBudgetError,
        ClosedError after `close`.
        """
        positions = np.array(offsets, np.float64)
        if positions.ndim != 2 or positions.shape[1] != 2 or not len(positions):
            raise InputError(f"offsets have shape {positions.shape}, expected (P, 2) with P of at least 1")
        for offset in positions.tolist():
            check_offset(tuple(offset))
        shape = len(self.prisms.onto), self.size, self.size, len(positions)
        if out is not None and (out.shape != shape or out.dtype != np.bool_ or not out.flags.c_contiguous):
            raise InputError(f"out is {out.dtype} of {out.shape}, expected an earlier result, bool of {shape}")
        shots = shots_of(self.size, positions, self.packet_width)
        packets = len(shots.texels) * len(shots.lanes)
        what = f"answers of {shape[0]:,} tiles to {len(positions)} positions in each texel"
        check_needed_bytes(shape[0] * 2 * packets + int(np.prod(shape)), None, what, "ask for fewer positions at once")
        with self._in_use():
            assert self._scene is not None
            scene, kernel = self._scene.address, meeting_kernel(self.packet_width)
            answers = np.empty((packets, shape[0]), np.uint16)
            met = np.empty(shape, np.bool_) if out is None else out
            self._pool.run(
                lambda worker, counter: kernel(counter, scene, self._workspaces[worker].packet, shots, answers)
            )
            check_widths(self._workspaces)
            self._pool.run(
                lambda _, counter: spread_answers(counter, answers, shots, self.prisms, self._covered, positions, met)
            )
        return met

    def _release(self) -> None:
        self._pool.close()
        self._close_scene()

    def _close_scene(self) -> None:
        if self._scene is not None:
            self._scene.close()


def positions_together(width: int, positions: int) -> int:
    """Positions of a texel that share a packet of `width` rays: a power of two."""
    return 1 << (min(width, positions).bit_length() - 1)


def shots_of(size: int, positions: NDArray[np.float64], width: int) -> Shots:
    """The rays of a tile in packets of `width`, with as many positions of a texel in one packet as fit."""
    together = positions_together(width, len(positions))
    across, down = SHAPES[width // together]
    y, x = np.mgrid[:size, :size]
    columns = -(-size // across)
    block, texel = y // down * columns + x // across, y % down * across + x % across
    number = np.arange(columns * -(-size // down))
    texels = np.stack([number % columns * across, number // columns * down], axis=1) - size / 2
    groups = -(-len(positions) // together)
    some = np.resize(positions, (groups * together, 2)).reshape(groups, 1, together, 2)  # pads with the first ones
    beside = np.array([(x, y) for y in range(down) for x in range(across)])[:, None]
    lanes = (some + beside).reshape(groups, width, 2)
    return Shots(
        texels.astype(np.float32),
        lanes.astype(np.float32),
        block.astype(np.int32),
        (texel * together).astype(np.int32),
        together,
    )
