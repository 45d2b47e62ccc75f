"""Cells with scenes of their own return the image that one scene returns."""

import numpy as np
import pytest

import atra
from atra.alignment.culling import count_kept
from atra.embree.library import load_library
from atra.judge.reference import brute_force
from atra.parallel import WorkerPool
from tests.images import assert_equal_images
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, random_triangles

WIDTHS = load_library().native_packet_widths


def trace_tiles(mesh, camera, split, offset=(0.5, 0.5), **options):
    with atra.TiledTracer(mesh, camera, split, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(("size", "split"), [
    ((96, 60), (3, 5)), ((35, 21), (5, 7)), ((33, 7), (1, 7)), ((13, 11), (13, 11)), ((1, 1), (1, 1)),
])  # fmt: skip
@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.0, 0.999)])
def test_any_split_size_and_offset_gives_the_float64_image(size, split, width, offset):
    camera, mesh = cornell_camera(*size), cornell_box()
    hits = trace_tiles(mesh, camera, split, offset, packet_width=width)
    assert_equal_images(mesh, camera, hits, brute_force(mesh, camera, offset))


@pytest.mark.parametrize("seed", range(6))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(seed):
    mesh = random_triangles(60, seed)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=[20, 90, 150, 170, 60, 120][seed])
    reference = brute_force(mesh, camera)
    for split in ((1, 1), (8, 1), (1, 24), (5, 4), (40, 24)):
        assert_equal_images(mesh, camera, trace_tiles(mesh, camera, split), reference)


@pytest.mark.parametrize("threads", [2, 3])
def test_the_number_of_threads_does_not_change_the_image(threads):
    camera, mesh = cornell_camera(96, 60), cornell_box()
    one, many = trace_tiles(mesh, camera, (12, 6)), trace_tiles(mesh, camera, (12, 6), threads=threads)
    np.testing.assert_array_equal(one.prim_id, many.prim_id)
    np.testing.assert_array_equal(one.depth, many.depth)


def copies_left_out(aligned):
    """Copies that culling would keep and rounding does not."""
    (left_out,) = aligned._geometry.left_out
    split = aligned.split
    cell = split.nx, split.ny, split.cell_width, split.cell_height
    kept = count_kept(WorkerPool(1), left_out.points_pixels, aligned.mesh, True, cell)
    return int(kept[left_out.prim_ids].sum())


def test_cells_keep_what_the_aligned_cells_keep_and_embree_counts_all_scenes():
    camera, mesh = cornell_camera(64, 64), cornell_box()
    with (
        atra.AlignedTracer(mesh, camera, (8, 4)) as aligned,
        atra.TiledTracer(mesh, camera, (8, 4)) as tiled,
        atra.TiledTracer(mesh, camera, (1, 1)) as whole,
    ):
        assert tiled.triangle_count == aligned.triangle_count + copies_left_out(aligned)
        assert tiled.embree_bytes > whole.embree_bytes > 0
        assert tiled.plan_time_s > 0
        assert tiled.build_time_s > 0


def test_cells_without_triangles_are_misses_and_images_are_reused():
    triangle = atra.Mesh([[0.5, 0.5, 5], [1.5, 0.5, 5], [0.5, 1.5, 5]], [[0, 1, 2]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=32, height=32)
    with atra.TiledTracer(triangle, camera, (8, 8), threads=1) as tracer:
        first = tracer.trace()
        again = tracer.trace(out=first)
        assert np.shares_memory(first.depth, again.depth)
        assert_equal_images(triangle, camera, again, brute_force(triangle, camera))
        assert again.hit.any()
        assert not again.hit[16:].any()
        assert (tracer._scene.handles == 0).sum() > 32


def test_tracing_before_build_or_after_close_is_an_error_and_closing_twice_is_not():
    tracer = atra.TiledTracer(cornell_box(), cornell_camera(16, 16), (4, 4))
    with pytest.raises(atra.EmbreeError, match="not built"):
        tracer.trace()
    with tracer:
        tracer.trace()
        tracer.build()
        tracer.trace()
    tracer.close()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.trace()


def test_a_plan_over_its_memory_budget_is_refused():
    with pytest.raises(atra.MemoryBudgetError, match="GiB"):
        atra.TiledTracer(cornell_box(), cornell_camera(64, 64), (64, 64), memory_budget_bytes=1 << 12).plan()
