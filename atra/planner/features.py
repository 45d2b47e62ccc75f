"""What an estimate knows of a view: counts of triangles and what a few thousand rays meet; nothing is built."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import log

import numpy as np

from atra.culling import project_vertices
from atra.kernels.planning import count_copies
from atra.kernels.statistics import mark_visible, probe_triangles
from atra.mesh import Mesh
from atra.parallel import WorkerPool
from atra.planner.choice import PACKETS, Choice
from atra.view import View

PROBE_STEP = 8
"""A ray every so many pixels, across and down."""


@dataclass(frozen=True)
class SceneStatistics:
    """A view in numbers.

    triangles: of the mesh. in_view: of them, those that meet the frustum. visible: of these, those that coarse rays do
    not show to be hidden. hit_share: rays that hit anything, 0 ... 1. hits_per_ray: triangles a ray meets, hidden ones
    counted, on average over all rays. axis_cosine: of the view direction and the world axis nearest to it.
    copies, visible_copies: by columns of cells: copies of triangles that culling keeps, and those of visible ones.
    """

    triangles: int
    width: int
    height: int
    in_view: int
    visible: int
    hit_share: float
    hits_per_ray: float
    axis_cosine: float
    copies: dict[int, int]
    visible_copies: dict[int, int]


def scene_statistics(mesh: Mesh, camera: View, columns: Iterable[int], threads: int = 1) -> SceneStatistics:
    """Statistics of a view; `columns` are the numbers of columns of cells that copies are counted for.

    A pass over the vertices, two over the triangles with a ray every `PROBE_STEP` pixels, and one over the triangles
    for each number of columns, which must divide the width of the image.
    """
    pool = WorkerPool(threads)
    try:
        points_pixels, points_eye = project_vertices(mesh, camera, pool)
        depths = points_eye @ camera.axes[2]
        shape = -(-camera.height // PROBE_STEP), -(-camera.width // PROBE_STEP)
        hit_count, nearest = np.zeros(shape, np.int64), np.full(shape, np.inf)
        probe_triangles(points_pixels, depths, mesh.faces, PROBE_STEP, hit_count, nearest)
        visible = np.zeros(mesh.triangle_count, np.uint8)
        mark_visible(points_pixels, depths, mesh.faces, PROBE_STEP, nearest, visible)
        counts = np.empty(mesh.triangle_count, np.int64)
        copies, visible_copies = {}, {}
        for nx in sorted({1, *columns}):
            cell = (nx, 1, camera.width // nx, camera.height)
            pool.run(
                lambda _, counter, cell=cell: count_copies(counter, points_pixels, mesh.faces, *cell, counts)  # type: ignore[misc]
            )
            copies[nx], visible_copies[nx] = int(counts.sum()), int(counts[visible != 0].sum())
    finally:
        pool.close()
    return SceneStatistics(
        triangles=mesh.triangle_count,
        width=camera.width,
        height=camera.height,
        in_view=copies[1],
        visible=visible_copies[1],
        hit_share=float((hit_count > 0).mean()),
        hits_per_ray=float(hit_count.mean()),
        axis_cosine=float(np.abs(camera.axes[2]).max()),
        copies=copies,
        visible_copies=visible_copies,
    )


def features(statistics: SceneStatistics, choice: Choice) -> dict[str, float]:
    """The numbers that the model's laws are linear in, by name; times are laws in the logarithm.

    One is added to counts that may be zero.
    """
    pixels = statistics.width * statistics.height
    nx = choice.split[0]
    named = {
        "one": 1.0,
        "log pixels": log(pixels),
        "log triangles": log(statistics.triangles),
        "log triangles in view": log(1 + statistics.in_view),
        "log triangles visible": log(1 + statistics.visible),
        "log hits per ray": log(0.1 + statistics.hits_per_ray),
        "hit share": statistics.hit_share,
        "axis cosine": statistics.axis_cosine,
    }
    if choice.method != PACKETS:
        cell_width = log(statistics.width / nx)
        named |= {
            "log cell width": cell_width,
            "log cell width squared": cell_width**2,
            "log copies": log(1 + statistics.copies[nx]),
            "log visible copies": log(1 + statistics.visible_copies[nx]),
        }
    return named
