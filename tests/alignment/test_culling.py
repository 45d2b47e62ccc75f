"""Culling may only leave out what no ray of the cell can hit (paper §3.4)."""

import numpy as np
import pytest

import atra
from atra.alignment.cells import CellOptions
from atra.alignment.copies import copied_geometry
from atra.compiled.threads import WorkerPool
from atra.exact.intersection import intersect_pixels
from atra.geometry.projection import project_mesh
from atra.tracing import budgets
from atra.tracing.budgets import (
    EMBREE_BYTES_PER_COPY,
    PLAN_BYTES_PER_COPY,
    check_memory_budget,
    check_needed_bytes,
)
from tests.meshes import EYE_AT_ORIGIN, quads, random_triangles

HIGH = np.int64(32)


def copies_of(mesh, camera, counts, culling=True, threads=1, **options):
    alignment = atra.Alignment.of_cells(camera, atra.Split(*counts, camera.width, camera.height))
    pool = WorkerPool(threads)
    geometry = copied_geometry([mesh], alignment, CellOptions(culling=culling, **options), camera.width, pool)
    pool.close()
    return alignment, geometry


def kept_pairs(geometry, alignment, row_stride):
    """{(prim_id, i, j)} of copies."""
    split = alignment.split
    prim_id, pixels = geometry.records & 0xFFFFFFFF, geometry.records >> HIGH
    i, j = pixels % row_stride // split.cell_width, pixels // row_stride // split.cell_height
    return set(zip(prim_id.tolist(), i.tolist(), j.tolist(), strict=True))


def left_out(geometry):
    """{prim_id} of what is traced pixel by pixel instead (tests/exact/test_rounding.py)."""
    return {int(prim_id) for one in geometry.left_out if one is not None for prim_id in one.prim_ids}


@pytest.mark.parametrize(("seed", "counts", "fov"), [(0, (12, 1), 30), (1, (4, 3), 100), (2, (1, 9), 175)])
def test_culling_keeps_every_triangle_that_a_ray_of_the_cell_hits(seed, counts, fov):
    mesh = random_triangles(40, seed, size=1.5)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=24, height=18, fov_y_degrees=fov)
    alignment, geometry = copies_of(mesh, camera, counts)
    kept = kept_pairs(geometry, alignment, camera.width)
    y, x = (grid.ravel() for grid in np.mgrid[:18, :24])
    for prim_id in sorted(set(range(mesh.triangle_count)) - left_out(geometry)):
        for offset in ((0.0, 0.0), (0.5, 0.5), (0.999, 0.999)):
            found = intersect_pixels(mesh, camera, x, y, np.full(x.size, prim_id), offset)
            hit = (found.edge_distance >= 0) & np.isfinite(found.depth)
            split = alignment.split
            needed = {
                (prim_id, i, j) for i, j in zip(x[hit] // split.cell_width, y[hit] // split.cell_height, strict=True)
            }
            assert needed <= kept


def test_culling_drops_what_lies_beside_behind_or_in_other_cells():
    wall = quads([[(-0.9, -0.1, 5), (-0.7, -0.1, 5), (-0.7, 0.1, 5), (-0.9, 0.1, 5)],  # right of the axis: world -x
                  [(-1, -1, -5), (1, -1, -5), (1, 1, -5), (-1, 1, -5)],  # behind
                  [(-1, 90, 5), (1, 90, 5), (1, 91, 5), (-1, 91, 5)]])  # fmt: skip  # far above the view
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64, fov_y_degrees=60)
    alignment, geometry = copies_of(wall, camera, (8, 8))
    assert kept_pairs(geometry, alignment, 64) <= {(p, i, j) for p in (0, 1) for i in (4, 5) for j in (3, 4)}
    assert geometry.copy_count > 0


def test_a_slanted_triangle_is_kept_only_in_cells_along_it():
    # A thin sliver across the diagonal of the view: its bounding box covers all cells, the triangle few.
    sliver = atra.Mesh([[2, 2, 5], [-2, -2, 5], [-2.02, -2, 5]], [[0, 1, 2]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64, fov_y_degrees=45)
    _, geometry = copies_of(sliver, camera, (16, 16))
    assert geometry.copy_count < 64


def test_copies_are_the_sheared_triangles():
    mesh = random_triangles(30, seed=3)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=24, height=18)
    for culling in (True, False):
        alignment, geometry = copies_of(mesh, camera, (6, 3), culling)
        split, transforms = alignment.split, alignment.transforms[0]
        for copy in range(0, geometry.copy_count, 7):
            prim_id, pixels = geometry.records[copy] & 0xFFFFFFFF, geometry.records[copy] >> HIGH
            i, j = pixels % 24 // split.cell_width, pixels // 24 // split.cell_height
            corners = mesh.vertices[mesh.traced_faces[prim_id]] - camera.eye
            expected = corners @ transforms[j, i, :, :3].T + transforms[j, i, :, 3]
            np.testing.assert_allclose(geometry.vertices[geometry.faces[copy]], expected, rtol=1e-6, atol=1e-6)


def test_the_budget_counts_copies_and_bvh():
    mesh = random_triangles(100, seed=2)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=32, height=32)
    copies = 16 * (100 - len(left_out(copies_of(mesh, camera, (16, 1), culling=False)[1])))
    assert copies > 1500
    needed = copies * (PLAN_BYTES_PER_COPY + EMBREE_BYTES_PER_COPY["medium"])
    copies_of(mesh, camera, (16, 1), culling=False, memory_budget_bytes=needed)
    with pytest.raises(atra.MemoryBudgetError, match=f"{copies:,} triangle copies over 16 cells"):
        copies_of(mesh, camera, (16, 1), culling=False, memory_budget_bytes=needed - 1)


def test_copies_that_embree_cannot_number_are_refused_and_one_less_is_not(monkeypatch):
    monkeypatch.setattr(budgets, "check_needed_bytes", lambda *_: None)
    most = (2**32 - 1) // 3
    check_memory_budget(most, 1, "medium", None)
    with pytest.raises(
        atra.MemoryBudgetError, match=r"1,431,655,766 triangle copies over 7 cells are more than Embree"
    ):
        check_memory_budget(most + 1, 7, "medium", None)


def test_what_exceeds_the_budget_or_the_free_memory_is_refused_with_both_sizes(monkeypatch):
    monkeypatch.setattr(budgets.psutil, "virtual_memory", lambda: type("", (), {"available": 3 * 2**30})())
    check_needed_bytes(2 * 2**30, 2 * 2**30, "copies", "use less")
    check_needed_bytes(3 * 2**30, None, "copies", "use less")
    with pytest.raises(
        atra.MemoryBudgetError, match=r"copies need about 2\.0 GiB, the memory budget is 1\.5 GiB; use less"
    ):
        check_needed_bytes(2 * 2**30, 3 * 2**29, "copies", "use less")
    with pytest.raises(atra.MemoryBudgetError, match=r"about 4\.0 GiB, the machine has free only 3\.0 GiB"):
        check_needed_bytes(4 * 2**30, 5 * 2**30, "copies", "use less")


def test_vertices_are_projected_to_their_pixels_and_to_the_eye():
    camera = atra.Camera((1, 2, 3), (2, 1, -4), fov_y_degrees=50, width=31, height=17)
    x, y, depth = np.array([0, 30, 7]), np.array([16, 0, 5]), np.array([0.5, 3.0, 40.0])
    points_eye = camera.rays(x, y)[1] * depth[:, None] @ camera.axes
    mesh = atra.Mesh(points_eye + camera.eye, [[0, 1, 2]])
    pool = WorkerPool(1)
    pixels, eye = project_mesh(mesh, camera, pool)
    pool.close()
    np.testing.assert_allclose(eye, points_eye, atol=1e-5)
    np.testing.assert_allclose(pixels[:, 2], depth, rtol=1e-5)
    np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], np.stack([x, y], 1) + 0.5, atol=1e-3)
