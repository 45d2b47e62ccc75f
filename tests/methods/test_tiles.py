"""Culled tiles show the image of single rays, and hold what the cells of aligned rays hold."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.geometry.projection import count_kept
from experiments.methods.tiles import Tiles
from tests.images import assert_equal_images, assert_same_bits
from tests.judge.reference import brute_force
from tests.machine import WIDTHS
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads
from tests.tracing import watertight_scenes as scenes
from tests.tracing.test_look import CAMERA, FLAT, MESH, MOVED, TURNED
from tests.tracing.test_verbs import POSED
from tests.tracing.test_watertight import FEW, one_view


def tiled(mesh, camera, split=(16, 1), threads=1, ties="lowest", **options):
    return atra.Tracer(mesh, camera, Tiles(split, **options), threads=threads, ties=ties)


@pytest.mark.parametrize("split", [(1, 1), (8, 1), (1, 12), (8, 6)])
@pytest.mark.parametrize("width", sorted({WIDTHS[0], WIDTHS[-1]}))
def test_every_split_shows_the_float64_image(split, width):
    for offset in ((0.5, 0.5), (0.0, 0.7)):
        with tiled(MESH, CAMERA, split, packet_width=width) as tracer:
            assert_equal_images(MESH, CAMERA, tracer.trace(offset), brute_force(MESH, CAMERA, offset))


def test_cells_without_triangles_are_misses():
    triangle = atra.Mesh([[0.5, 0.5, 5], [1.5, 0.5, 5], [0.5, 1.5, 5]], [[0, 1, 2]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=32, height=32)
    with tiled(triangle, camera, (8, 8)) as tracer:
        hits = tracer.trace()
        assert (tracer.prepared.scenes.handles == 0).sum() > 32
    assert_equal_images(triangle, camera, hits, brute_force(triangle, camera))
    assert hits.hit.any()
    assert not hits.hit[16:].any()


def test_tiles_keep_what_aligned_cells_keep_and_embree_counts_all_their_scenes():
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    with atra.AlignedTracer(mesh, camera, (8, 4), threads=1) as aligned, tiled(mesh, camera, (8, 4)) as tiles:
        (without,) = aligned.prepared.geometry.left_out  # copies that culling would keep and rounding does not
        kept = count_kept(WorkerPool(1), without.points_pixels, mesh, True, (8, 4, 8, 16))[without.prim_ids]
        assert tiles.triangle_count == aligned.triangle_count + int(kept.sum())
        with tiled(mesh, camera, (1, 1)) as whole:
            assert tiles.embree_bytes > whole.embree_bytes > 0


def test_of_tied_triangles_the_lowest_is_shown():
    square = [(-1, -1, 3), (1, -1, 3), (1, 1, 3), (-1, 1, 3)]
    with tiled(quads([square, square]), atra.Camera(**EYE_AT_ORIGIN, width=32, height=32), (4, 4)) as tracer:
        assert set(np.unique(tracer.trace().prim_id)) == {0, 1, atra.MISS}


def test_no_ray_leaves_a_closed_mesh_but_in_the_fast_setting():
    assert sum(lost(mesh) for mesh in FEW) == 0
    assert sum(lost(mesh, robust=False) for mesh in FEW) > 0


def lost(mesh, **options):
    with tiled(mesh, *one_view(mesh), (5, 1), **options) as tracer:
        assert tracer.camera.width == scenes.SIZE
        return int((~tracer.trace().hit).sum())


def test_other_cameras_and_vertices_are_seen_as_by_a_new_tracer():
    with tiled(MESH, CAMERA) as one:
        one.trace()
        for camera in (MOVED, TURNED, replace(MOVED, width=32, height=80)):
            one.look(camera)
            with tiled(MESH, camera) as new:
                assert_same_bits(one.trace(), new.trace())
        one.update(POSED)
        with tiled(POSED, one.camera) as new:
            assert_same_bits(one.trace(), new.trace())


def test_parallel_rays_splits_that_do_not_divide_and_small_budgets_are_refused():
    with pytest.raises(atra.InputError, match=r"Tiles needs rays through one point.*use AlignedTracer"):
        tiled(MESH, FLAT)
    with tiled(MESH, CAMERA) as one, pytest.raises(atra.InputError, match="does not divide image 65 x 48"):
        one.look(replace(CAMERA, width=65))
    with pytest.raises(atra.MemoryBudgetError, match="GiB"):
        tiled(MESH, cornell_camera(64, 64), (64, 64), memory_budget_bytes=1 << 12).build()
    with pytest.raises(TypeError, match="packet_rows"):
        tiled(MESH, CAMERA, packet_rows=1)
