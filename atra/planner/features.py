"""What an estimate knows of a view: counts of triangles and what a few thousand rays meet; nothing is built."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log2, sqrt

import numpy as np
from numpy.typing import NDArray

from atra.alignment.culling import count_kept, project_vertices
from atra.alignment.visibility import SEEN_SLACK
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import ray_axes
from atra.geometry.view import View
from atra.kernels.statistics import probe_triangles
from atra.kernels.visible import count_visible
from atra.parallel import WorkerPool
from atra.planner.choice import PACKETS, Choice

PROBE_STEP = 8
"""A ray every so many pixels, across and down."""


@dataclass(frozen=True)
class SceneStatistics:
    """A view in numbers.

    triangles: of the mesh. in_view: of them, those that meet the frustum. visible: of these, those that coarse rays do
    not show to be hidden; all where rays are parallel. hit_share: rays that hit anything, 0 ... 1. hits_per_ray:
    triangles a ray meets, hidden ones counted, on average over all rays. copies, visible_copies: by columns of cells:
    copies that culling keeps, and those that coarse rays do not show to be hidden in their cell. boxes, visible_boxes:
    what the bounding rectangles of triangles in view, and of visible ones, cover, each counted in full, in images.
    """

    triangles: int
    width: int
    height: int
    in_view: int
    visible: int
    hit_share: float
    hits_per_ray: float
    copies: dict[int, int]
    visible_copies: dict[int, int]
    boxes: float
    visible_boxes: float


def scene_statistics(mesh: Mesh, camera: View, columns: Iterable[int], threads: int = 1) -> SceneStatistics:
    """Statistics of a view; `columns` are the numbers of columns of cells that copies are counted for.

    A pass over the vertices, one over the triangles with a ray every `PROBE_STEP` pixels, and two over the triangles
    for each number of columns, which must divide the width of the image.
    """
    pool = WorkerPool(threads)
    try:
        points_pixels, points_ray = project_vertices(mesh, camera, pool)
        shape = -(-camera.height // PROBE_STEP), -(-camera.width // PROBE_STEP)
        hit_count, nearest = np.zeros(shape, np.int64), np.full(shape, np.inf)
        box_pixels = np.empty(mesh.triangle_count)
        depths = points_ray @ ray_axes(camera)[2]
        probe_triangles(points_pixels, depths, mesh.faces, PROBE_STEP, hit_count, nearest, box_pixels)
        box_pixels /= camera.width * camera.height
        copies, visible_copies, visible = {}, {}, 0  # of which the finest cells tell most
        for nx in sorted({1, *columns}):
            cell = nx, 1, camera.width // nx, camera.height
            kept = count_kept(pool, points_pixels, mesh, True, cell)
            copies[nx] = int(kept.sum())
            if nx > 1 and not camera.is_parallel:
                kept = _count_visible_copies(mesh, camera, pool, points_pixels, nearest, nx)
            visible_copies[nx] = int(kept.sum())
            visible = int(np.count_nonzero(kept))
    finally:
        pool.close()
    return SceneStatistics(
        triangles=mesh.triangle_count,
        width=camera.width,
        height=camera.height,
        in_view=copies[1],
        visible=visible,
        hit_share=float((hit_count > 0).mean()),
        hits_per_ray=float(hit_count.mean()),
        copies=copies,
        visible_copies=visible_copies,
        boxes=float(box_pixels.sum()),
        visible_boxes=float(box_pixels[kept != 0].sum()),
    )


def _count_visible_copies(
    mesh: Mesh,
    camera: View,
    pool: WorkerPool,
    points_pixels: NDArray[np.float64],
    nearest: NDArray[np.float64],
    nx: int,
) -> NDArray[np.int64]:
    """As visible-first tracing counts what its probe shows, with one ray for every tile."""
    counts = np.empty(mesh.triangle_count, np.int64)
    cell_width = camera.width // nx
    tiles_per_ray = 1 if cell_width > PROBE_STEP // 2 else 2  # tiles no wider than narrow cells
    tile_width = PROBE_STEP // tiles_per_ray
    wanted = np.repeat(1.0 / nearest, tiles_per_ray, axis=1)[:, : -(-camera.width // tile_width)]
    wanted *= 1.0 - SEEN_SLACK
    first_pixel = np.arange(wanted.shape[1]) * tile_width
    last_pixel = np.minimum(first_pixel + tile_width, camera.width) - 1
    tiles = wanted, tile_width, PROBE_STEP, camera.width, camera.height, camera.height
    seen = np.zeros(mesh.triangle_count, np.uint8)
    nowhere, no_slack = np.zeros(mesh.triangle_count, np.bool_), np.zeros(mesh.triangle_count)
    hidden = np.zeros((pool.threads, *wanted.shape))

    def count(worker: int, counter: int) -> None:
        count_visible(
            counter, points_pixels, mesh.faces, seen, nowhere, no_slack, *tiles,
            first_pixel // cell_width, last_pixel // cell_width, hidden[worker], counts,
        )  # fmt: skip

    pool.run(count)
    return counts


def features(statistics: SceneStatistics, choice: Choice) -> dict[str, float]:
    """The counts that a choice's time is made of, by name; the model has a price for each.

    Levels stand for the depth of a BVH over so many triangles. Outlines stand for the packets that straddle an edge:
    n triangles over an area of a pixels have outlines of about sqrt(n a) pixels in all.
    """
    pixels = float(statistics.width * statistics.height)
    hits, first_hits = pixels * statistics.hits_per_ray, pixels * statistics.hit_share
    hidden_hits = hits - first_hits
    counts = {
        "view": 1.0,
        "pixels": pixels,
        "triangles": float(statistics.triangles),
        "triangles in view": float(statistics.in_view),
        "first hits": first_hits,
        "hits": hits,
        "hidden hits": hidden_hits,
        "first hits x levels": first_hits * log2(1 + statistics.visible),
        "outlines": sqrt(statistics.visible * first_hits),
        "hidden outlines": sqrt(statistics.visible * hidden_hits),
        "boxes": pixels * statistics.boxes,
        "visible boxes": pixels * statistics.visible_boxes,
    }
    if choice.method != PACKETS:
        nx = choice.split[0]
        cell_width, copies, visible_copies = statistics.width / nx, statistics.copies[nx], statistics.visible_copies[nx]
        counts |= {
            "copies": float(copies),
            "copies x cell width": copies * cell_width,
            "copies' outlines": sqrt(copies * hits),
            "reference rays x levels": pixels / nx * log2(1 + copies),
            "visible copies": float(visible_copies),
            "visible copies x cell width": visible_copies * cell_width,
            "visible copies' outlines": sqrt(visible_copies * first_hits),
        }
    return counts
