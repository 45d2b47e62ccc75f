"""Visible-first tracing: align what is probably visible, then check what was left out, only where it could matter.

The image is divided into small tiles. A probe estimates the visible depth of each. The first pass gets the copies of
triangles that may lie nearer than that in some tile of their cell. For the rest, each tile stores the depth before
which no ray of the tile, at any sub-pixel offset, can meet them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions, check_aligned
from atra.alignment.copies import Fill, Points, filled_copies
from atra.alignment.copies_kernels import CopyTarget
from atra.alignment.prepared import PreparedCells
from atra.alignment.rounding import roundings_of_copies
from atra.alignment.second_pass import DEPTH_SLACK, SecondPass, nearest_of, tiles_before
from atra.alignment.visibility_kernels import (
    TileGrid,
    Wanted,
    count_visible,
    fill_visible,
)
from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import TracedImage
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.projection import project_mesh
from atra.geometry.ray_space import unseen_from
from atra.geometry.split import Split
from atra.geometry.view import View
from atra.hits import Hits
from atra.packets.loop import Packets, trace_packets
from atra.tracing.geometry import plan_plain_geometry
from atra.tracing.images import new_images
from atra.tracing.method import Method
from atra.tracing.rays import SQUAREST_SHAPE, check_pinhole, pixel_tiles, ray_grid
from atra.tracing.tracer import Tracer

SEEN_SLACK = 1e-3
"""Relative margin behind the probe's depth within which copies are kept. It exceeds DEPTH_SLACK, or the surfaces that
the probe saw would fail their own test."""

PROBE_STEP = 4
"""The default probe traces a ray every PROBE_STEP pixels, across and down, along the borders of tiles."""

TILE_WIDTHS, TILE_HEIGHT = (4, 8), 4
"""Tile sizes in pixels: the resolution of the visibility estimate. Tiles hold whole packets; they are no wider than
narrow cells, because a copy is kept in every cell that its tile meets."""

WHOLE_BUILD_QUALITY = "low"
"""Build quality of the whole mesh's BVH, which is also compact. Only the probe and a few packets use it, so build time
and size matter more than tracing speed."""


@dataclass(frozen=True, eq=False)
class VisibleFirst(Method):
    """Visible-first tracing as a method. split, probe: see `VisibleFirstTracer`; options: its others."""

    split: tuple[int, int]
    probe: Hits | None = None
    options: CellOptions = field(default_factory=CellOptions)

    def __post_init__(self) -> None:
        if not isinstance(self.probe, Hits | None):
            raise InputError(f"the probe is {self.probe!r:.100}, expected Hits of an image, or None")

    @property
    def rays_per_packet(self) -> int:
        """The packet width, resolved for this machine."""
        return self.options.rays_per_packet

    def alignment(self, camera: View) -> Alignment:
        """The cells of a camera's image. Raises InputError for a split that does not divide it."""
        return Alignment.of_cells(camera, Split.of_image(self.split, camera))

    def check(self, mesh: Mesh, camera: View) -> None:
        """See `Method.check`."""
        check_pinhole(camera, "VisibleFirstTracer")
        check_aligned((mesh,), self.alignment(camera), self.options)
        if self.probe is not None and self.probe.depth.shape != (camera.height, camera.width):
            raise InputError(
                f"the probe is an image of {self.probe.depth.shape}, "
                f"expected {(camera.height, camera.width)} (height, width)"
            )

    def prepare(self, mesh: Mesh, camera: View, pool: WorkerPool) -> PreparedCells:
        """Probe, cull, shear and build: copies of what is probably visible, and a second pass through the mesh."""
        alignment, options = self.alignment(camera), self.options
        prepared, grid = PreparedCells((mesh,), alignment, options, pool), tiles_of(alignment.split)
        start = perf_counter()
        plain = plan_plain_geometry(mesh, camera)
        ready = perf_counter()
        settings = {**options.scene_settings, "build_quality": WHOLE_BUILD_QUALITY, "compact": True}
        whole = plain.build(pool.threads, **settings)
        built = perf_counter()
        if self.probe is None:
            depth = probed_depth(_trace_probe(whole, camera, grid, prepared.workspaces, pool), grid)
        else:
            depth = _farthest_in_tiles(self.probe.depth, grid)
        probed = perf_counter()
        points = project_mesh(mesh, camera, pool)
        counts, nearest, fill = visible_copies(mesh, alignment, grid, depth, points, pool)
        geometry = filled_copies([counts], fill, alignment, options, prepared.row_stride)
        second_pass = SecondPass(whole, camera, *tiles_before(nearest, grid), options.rays_per_packet)
        prepared.second_passes = [second_pass]
        copied = perf_counter()
        prepared.build(geometry)
        prepared.triangle_count += mesh.triangle_count
        prepared.plan_time_s = ready - start + copied - built
        prepared.build_time_s = built - ready + perf_counter() - copied
        prepared.told["probe_time_s"] = probed - built
        return prepared


def tiles_of(split: Split) -> TileGrid:
    """The tiles of an image with these cells."""
    return TileGrid(TILE_WIDTHS[split.cell_width > TILE_WIDTHS[0]], TILE_HEIGHT, split.width, split.height)


def _trace_probe(
    whole: EmbreeScene, camera: View, grid: TileGrid, workspaces: Sequence[Workspace], pool: WorkerPool
) -> NDArray[np.float32]:
    """The default probe: depths along the borders of tiles, which neighbours share. An outline that crosses a tile
    probably separates two of its corners."""
    shape = SQUAREST_SHAPE[workspaces[0].width]
    rows, columns = grid.shape
    width = columns * (grid.tile_width // PROBE_STEP) + 1
    height = rows * (grid.tile_height // PROBE_STEP) + 1

    def positions(count: int, packet: int, pixels: int) -> NDArray[np.integer]:
        return np.minimum(np.arange(count + -count % packet) * PROBE_STEP, pixels)

    x = camera.plane.columns(positions(width, shape[0], camera.width))
    y = camera.plane.rows(positions(height, shape[1], camera.height))
    image, tiles, size = TracedImage(*new_images((height, width), width)), pixel_tiles(width, height), (width, height)
    trace_packets(Packets(whole.address, shape, camera, ray_grid(camera, x, y), tiles, size), workspaces, pool, image)
    return image.depth


def probed_depth(depth: NDArray[np.float32], grid: TileGrid) -> NDArray[np.float64]:
    """(tile rows, tile columns) float64, the second farthest of each tile's corners; of two squares in a tile, the
    farther.

    A single far corner does not count: keeping all that lies before it costs more than checking a few packets. depth:
    float32, what rays every `PROBE_STEP` pixels along the borders of tiles see.
    """
    upper, lower = (pick(depth[:-1], depth[1:]) for pick in (np.maximum, np.minimum))
    second = np.maximum(np.minimum(upper[:, :-1], upper[:, 1:]), np.maximum(lower[:, :-1], lower[:, 1:]))
    rows, columns = grid.shape
    steps = second.reshape(rows, grid.tile_height // PROBE_STEP, columns, grid.tile_width // PROBE_STEP)
    return steps.max(axis=(1, 3)).astype(np.float64)


def _farthest_in_tiles(depth: NDArray[np.float32], grid: TileGrid) -> NDArray[np.float64]:
    """The farthest depth in each tile of an image."""
    rows, columns = grid.shape
    farthest = np.maximum.reduceat(depth, np.arange(rows) * grid.tile_height, axis=0)
    return np.maximum.reduceat(farthest, np.arange(columns) * grid.tile_width, axis=1).astype(np.float64)


def visible_copies(
    mesh: Mesh, alignment: Alignment, grid: TileGrid, depth: NDArray[np.float64], points: Points, pool: WorkerPool
) -> tuple[NDArray[np.int64], NDArray[np.float32], Fill]:
    """The copies of every triangle for the cells in which a probe says it may be visible.

    alignment: the cells of one image. depth: (tile rows, tile columns), what may be nearer is kept (inf: everything, 0:
    nothing); a wrong one costs time, never a hit. points: from `project_mesh`, for its camera. Returns (F,) int64,
    the cells that keep each triangle; (tile rows, tile columns) float32, no ray of a tile meets a left-out triangle
    before this depth, inf where none is left out; and what writes the copies for `filled_copies`.
    """
    split, camera = alignment.split, alignment.camera
    roundings = roundings_of_copies(mesh, camera, alignment, points, pool)
    with np.errstate(divide="ignore"):
        inverse_depth = (1.0 - SEEN_SLACK) / depth
    columns = np.arange(grid.shape[1]) * grid.tile_width
    last_cell = (np.minimum(columns + grid.tile_width, camera.width) - 1) // split.cell_width
    wanted = Wanted(roundings.left_out, inverse_depth, columns // split.cell_width, last_cell, split.cell_height)
    faces, slack = mesh.traced_faces, np.maximum(roundings.depth_error, DEPTH_SLACK)
    counts, hidden = np.empty(mesh.triangle_count, np.int64), np.zeros((pool.threads, *grid.shape))

    def count(worker: int, counter: int) -> None:
        count_visible(counter, points[0], faces, grid, wanted, slack, hidden[worker], counts)

    def fill(_: int, starts: NDArray[np.int64], target: CopyTarget) -> None:
        pool.run(lambda _, counter: fill_visible(counter, *points, faces, grid, wanted, starts, target))

    pool.run(count)
    counts[unseen_from(camera, mesh)] = 0
    return counts, nearest_of(hidden.max(axis=0)), fill


def VisibleFirstTracer(
    mesh: Mesh,
    camera: View,
    split: tuple[int, int],
    probe: Hits | None = None,
    *,
    threads: int | None = None,
    ties: str = "lowest",
    packet_width: int | None = None,
    packet_rows: int | None = None,
    build_quality: str = "medium",
    robust: bool = True,
    memory_budget_bytes: int | None = None,
) -> Tracer:
    """Align what a probe takes for visible, and check the rest per pixel: alignment without overdraw.

    Pass 1 traces aligned copies of the triangles that the probe deems visible and float32 shows as precisely as a ray
    of the mesh itself (`atra.alignment.rounding`). Pass 2 goes over the image in packets of pixels. It skips a packet
    whose hits are nearer than anything left out in its tile can be; other packets are traced through the whole mesh, up
    to the depth found. The image is exact for any probe; a bad one costs time. This lifts the limit of paper §5.

    Parameters
    ----------
    mesh, camera :
        What is traced, and by which rays: pinhole.
    split : (int, int)
        Columns and rows of cells; they must divide the image's width and height.
    probe : optional
        `Hits` of an image of the same size, such as an earlier frame or a nearby camera (default: a few rays are traced
        while setting up).
    threads, ties, packet_width, packet_rows, build_quality, robust, memory_budget_bytes :
        As for `AlignedTracer`; the build quality is that of pass 1.

    Returns
    -------
    Tracer
        Its plan_time_s includes the probe (`counters["probe_time_s"]`), its build_time_s both BVHs.

    Raises
    ------
    InputError
        For a split that does not divide the image, a probe that is no `Hits` or of another size, and parallel rays.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> with atra.VisibleFirstTracer(mesh, camera, split=(16, 1)) as tracer:
    ...     hits = tracer.trace()
    >>> print(atra.compare(hits, atra.trace(mesh, camera)))
    3072 of 3072 pixels equal, 0 tied, 0 edge, 0 wrong
    """
    options = CellOptions(
        packet_width=packet_width, packet_rows=packet_rows, build_quality=build_quality, robust=robust,
        memory_budget_bytes=memory_budget_bytes,
    )  # fmt: skip
    return Tracer(mesh, camera, VisibleFirst(split, probe, options), threads=threads, ties=ties)
