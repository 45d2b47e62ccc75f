"""The promise of the paper: every method returns the image that per-pixel tracing returns."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

import atra
from atra.alignment.cells import choose_packet_shape
from tests.images import (
    CELLS,
    METHODS,
    PARALLEL,
    assert_equal_images,
    assert_same_bits,
    make_tracer,
    trace,
    trace_pixels,
)
from tests.judge.reference import brute_force
from tests.machine import WIDTHS
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

OFFSETS = [(0.5, 0.5), (0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)]
FLAT = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=4.0, width=48, height=30)
WALL = [(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]


@cache
def cornell_reference(width, height, offset=(0.5, 0.5)):
    return brute_force(cornell_box(), cornell_camera(width, height), offset)


each_method = pytest.mark.parametrize("method", METHODS)
each_method_of_cells = pytest.mark.parametrize("method", CELLS)
each_width = pytest.mark.parametrize(  # compiled for each
    "width", [pytest.param(one, marks=() if one in (WIDTHS[0], WIDTHS[-1]) else pytest.mark.slow) for one in WIDTHS]
)
each_kind = pytest.mark.parametrize("method", ["pixels", "aligned", "visible_first", "frames"])


def make_any(method, mesh, camera, **options):
    """A tracer of any kind, that of frames included."""
    if method == "frames":
        split = atra.Split(4, 1, camera.width, camera.height)
        return atra.FramesTracer(mesh, atra.Alignment.of_frames([camera] * 2, split), **options)
    return make_tracer(method, mesh, camera, (4, 1), **options)


@pytest.mark.core
@each_width
@each_method
def test_a_tilted_plane_has_the_depth_of_its_equation(method, width):
    # z = 4 + 0.5 x - 0.25 y, far larger than the view; camera X and Y are the world's -x and -y.
    xy = [(-50, -50), (50, -50), (50, 50), (-50, 50)]
    plane = quads([[(x, y, 4 + 0.5 * x - 0.25 * y) for x, y in xy]])
    pinhole = atra.Camera(**EYE_AT_ORIGIN, width=48, height=30, fov_y_degrees=50)
    for camera, split in [(pinhole, (6, 1)), (pinhole, (3, 5)), (FLAT, (1, 10))][: 3 if method in PARALLEL else 2]:
        with make_tracer(method, plane, camera, split, packet_width=width) as tracer:
            for offset in OFFSETS:
                origins, directions = camera.rays(*np.meshgrid(np.arange(48), np.arange(30)), offset)
                slope = np.array([-0.5, 0.25, 0.0])
                expected = (4 + origins @ slope) / (directions[..., 2] - directions @ slope)
                np.testing.assert_allclose(tracer.trace(offset).depth, expected, rtol=2e-6)


@each_method_of_cells
def test_every_cell_shows_its_own_part_of_the_scene(method):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=12, height=6, fov_y_degrees=40)
    # Quadrilateral 4 j + i covers cell (i, j) of a 4 x 3 split alone, at its own depth.
    corners, depths = [], np.arange(2.0, 14.0)
    for cell, z in enumerate(depths):
        i, j = cell % 4, cell // 4
        left, right = (((3 * c) - 6) * camera.pixel_pitch * -z for c in (i, i + 1))
        top, bottom = (((2 * c) - 3) * camera.pixel_pitch * -z for c in (j, j + 1))
        corners.append([(left, top, z), (right, top, z), (right, bottom, z), (left, bottom, z)])
    hits = trace(method, quads(corners), camera, (4, 3))
    cells = np.repeat(np.repeat(np.arange(12).reshape(3, 4), 2, axis=0), 3, axis=1)
    np.testing.assert_array_equal(hits.prim_id // 2, cells)
    np.testing.assert_allclose(hits.depth, depths[cells], rtol=1e-6)


@pytest.mark.core
@each_width
@each_method
def test_odd_sizes_and_splits_give_the_float64_image(method, width):
    for size, split in (
        ((96, 60), (3, 5)), ((35, 21), (5, 7)), ((35, 21), (7, 1)), ((33, 7), (1, 7)), ((13, 11), (13, 11)),
        ((1, 1), (1, 1)), ((7, 1), (7, 1)),
    ):  # fmt: skip
        mesh, camera = cornell_box(), cornell_camera(*size)
        hits = trace(method, mesh, camera, split, packet_width=width)
        assert_equal_images(mesh, camera, hits, cornell_reference(*size))


@each_method
def test_one_plan_gives_the_float64_image_of_every_offset_into_the_same_memory(method):
    mesh, camera = cornell_box(), cornell_camera(48, 36)
    with make_tracer(method, mesh, camera, (12, 3)) as tracer:
        first = hits = tracer.trace()
        expected = first.prim_id.copy()
        for offset in [*OFFSETS, (0.5, 0.5)]:
            hits = tracer.trace(offset, out=hits)
            assert np.shares_memory(hits.prim_id, first.prim_id)
            assert np.shares_memory(hits.depth, first.depth)
            assert_equal_images(mesh, camera, hits, cornell_reference(48, 36, offset))
        np.testing.assert_array_equal(hits.prim_id, expected)


@each_method
def test_neither_threads_nor_build_quality_change_the_image(method):
    mesh, camera = cornell_box(), cornell_camera(96, 60)
    one = trace(method, mesh, camera, (12, 2))
    for threads in (2, 3):
        assert_same_bits(trace(method, mesh, camera, (12, 2), threads=threads), one)
    for build_quality in ("low", "medium", "high"):
        assert_equal_images(mesh, camera, trace(method, mesh, camera, (12, 2), build_quality=build_quality), one)


@each_method
def test_an_empty_view_is_all_misses(method):
    hits = trace(method, quads([WALL]), atra.Camera((0, 0, 0), (0, 0, -1), width=16, height=8), (4, 1))
    assert not hits.hit.any()
    assert np.isinf(hits.depth).all()
    assert np.isnan(hits.u).all()


@each_method
def test_plan_and_build_are_timed_and_what_embree_holds_is_counted(method):
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    with make_tracer(method, mesh, camera, (16, 1)) as tracer:
        assert tracer.plan_time_s > 0
        assert tracer.build_time_s > 0
        assert tracer.embree_bytes > 0
        triangles, left_out = mesh.triangle_count, tracer.counters.get("triangles_left_out", 0)
        assert left_out < 0.05 * triangles
        if method in ("pixels", "instanced"):  # the mesh is stored once, whatever the number of cells
            assert tracer.triangle_count == triangles
        elif method == "unculled":
            assert tracer.triangle_count == 16 * (triangles - left_out)
        else:
            assert 0 < tracer.triangle_count < 4 * triangles


@each_kind
def test_an_out_that_is_no_result_or_of_another_kind_is_refused_before_it_is_written(method):
    with make_any(method, cornell_box(), cornell_camera(16, 16)) as tracer:
        for out in ("x", (1, 2), SimpleNamespace(depth=None, prim_id=None), atra.PixelTracer):
            with pytest.raises(atra.InputError, match=r"out is .*, expected a result of this tracer, or None"):
                tracer.trace(out=out)
        hits = tracer.trace(out=tracer.trace())
        if method == "frames":
            return
        swapped = hits.depth.dtype.newbyteorder()
        frozen = np.lib.stride_tricks.as_strided(hits.depth, hits.depth.shape, hits.depth.strides, writeable=False)
        small = trace_pixels(cornell_box(), cornell_camera(8, 16))
        for fields, message in (
            ({"prim_id": small.prim_id, "depth": small.depth}, r"of \(16, 8\).*expected"),
            ({"prim_id": hits.prim_id.view(np.int32)}, r"int32 of \(16, 16\).*expected uint32 of"),
            ({"depth": hits.depth.view(np.uint32)}, "uint32 of .*expected float32"),
            ({"depth": hits.depth.view(swapped)}, "expected float32"),
            ({"depth": hits.depth[..., None]}, r"\(16, 16, 1\), strides"),
            ({"depth": np.array(1.0, np.float32)}, r"of \(\), strides"),
            ({"depth": frozen}, "read-only"),
            ({"prim_id": hits.depth.view(np.uint32)}, "one memory for depth and prim_id"),
        ):
            before = hits.prim_id.copy(), hits.depth.copy()
            with pytest.raises(atra.InputError, match=message):
                tracer.trace((0.1, 0.9), out=replace(hits, **fields))
            np.testing.assert_array_equal((hits.prim_id, hits.depth), before)


@each_kind
def test_what_no_tracer_can_trace_is_refused_with_its_value(method):
    mesh, camera, native = cornell_box(), cornell_camera(16, 16), ", ".join(map(str, WIDTHS))
    for width in sorted(set(range(2, 33)) - set(WIDTHS)):
        with pytest.raises(atra.InputError, match=f"packet_width is {width}, this machine supports {native}"):
            make_any(method, mesh, camera, packet_width=width)
    with pytest.raises(atra.InputError, match="threads is 1000000, expected at most 1024; None takes every core"):
        make_any(method, mesh, camera, threads=10**6)
    message = r"depth and prim_id of [12],000,000 rows of 1,000,000 pixels need about .* GiB, .*use fewer pixels"
    with pytest.raises(atra.MemoryBudgetError, match=message):  # before anything is allocated
        make_any(method, mesh, cornell_camera(10**6, 10**6))
    if method not in ("pixels", "frames"):
        for split in (4, None, (4,), (4, 1, 1)):
            with pytest.raises(atra.InputError, match=r"split is .*, expected two whole numbers"):
                make_tracer(method, mesh, camera, split)
        with pytest.raises(atra.InputError, match=r"split \(5, 1\) does not divide image 16 x 16"):
            make_tracer(method, mesh, camera, (5, 1))
    with make_any(method, mesh, camera) as tracer:
        for offset in ((1.0, 0.5), (-0.1, 0.5), (float("nan"), 0.5)):
            with pytest.raises(atra.InputError, match="offset is"):
                tracer.trace(offset)


@pytest.mark.parametrize("make", [atra.AlignedTracer, atra.VisibleFirstTracer])
def test_images_that_no_record_can_count_are_refused_before_anything_is_planned(make):
    with pytest.raises(atra.InputError, match="an output of 65536 rows of 32768 pixels is too large"):
        make(cornell_box(), atra.Camera(**EYE_AT_ORIGIN, width=2**15, height=2**16), (1, 1))


def test_a_plan_over_its_memory_budget_is_refused():
    mesh, camera = cornell_box(), cornell_camera(64, 64)
    with make_tracer("instanced", mesh, cornell_camera(32, 16), (4, 2), memory_budget_bytes=1 << 18) as tracer:
        assert tracer.embree_bytes < 1 << 18
    for method, split, budget, message in (
        ("unculled", (64, 64), 1 << 20, "GiB"),
        ("aligned", (64, 64), 1 << 16, "GiB"),
        ("visible_first", (64, 1), 1 << 12, "GiB"),
        ("unculled", (4, 2), 1 << 18, "triangle copies"),
        ("instanced", (4, 2), 1 << 16, "1,112 triangles and 8 instances of them need about"),
        ("instanced", (32, 16), 1 << 18, "512 instances of them need about"),
    ):
        with pytest.raises(atra.MemoryBudgetError, match=message):
            make_tracer(method, mesh, camera, split, memory_budget_bytes=budget).build()
    with pytest.raises(atra.MemoryBudgetError, match="free"):
        make_tracer("unculled", random_triangles(300_000, 0), cornell_camera(1024, 1024), (1024, 4))


@pytest.mark.parametrize(("width", "counts", "shape"), [
    (8, (1, 1), (8, 1)), (8, (128, 1), (8, 1)), (8, (256, 1), (4, 2)), (8, (1024, 1), (1, 8)),
    (8, (256, 1024), (8, 1)), (4, (512, 1), (2, 2)), (16, (128, 1), (8, 2)), (1, (1024, 1), (1, 1)),
])  # fmt: skip
def test_the_packet_shape_wastes_as_few_lanes_as_the_cell_allows(width, counts, shape):
    assert choose_packet_shape(width, atra.Split(*counts, 1024, 1024)) == shape


def test_culling_keeps_no_copy_that_parallel_rays_of_its_cell_cannot_meet():
    mesh = random_triangles(400, 1, size=0.1)
    with make_tracer("aligned", mesh, FLAT, (12, 1)) as tracer:
        # The view is a 4 units high and 6.4 wide part of 6 x 6 and more; a triangle meets about one cell of 0.5 units.
        assert tracer.triangle_count < 2 * mesh.triangle_count


@each_method_of_cells
def test_a_triangle_with_two_equal_corners_on_a_line_through_the_eye_is_shown_nowhere(method):
    # Fused multiplications give its sheared copy a width, and it was seen six pixels beside where it is.
    mesh = atra.Mesh([(0, 0, 0.5), (0, 1.5, 0.5)], [(0, 1, 1)])
    camera = atra.Camera((0, 0.25, 0.5), (0, 0, 0.5), (0, 0, 1), 1.0, width=13, height=7)
    assert not trace(method, mesh, camera, (13, 7), packet_width=1).hit.any()


@each_method
def test_triangles_without_area_keep_their_number_and_are_never_hit(method):
    edge_on, point, line = [[0, -3, 1], [0, 3, 1], [0, 0, 9]], [[0, 0, 1]] * 3, [[-1, 0, 1], [0, 0, 1], [1, 0, 1]]
    walls = quads([WALL, WALL])
    vertices = np.concatenate([edge_on, point, line, walls.vertices])
    mesh = atra.Mesh(vertices, np.concatenate([np.arange(9).reshape(3, 3), walls.faces.astype(int) + 9]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=30, height=31)
    with make_tracer(method, mesh, camera, (15, 1)) as tracer:
        hits = tracer.trace()
        assert method != "unculled" or tracer.triangle_count == 15 * 4  # without area, without a copy
    np.testing.assert_allclose(hits.depth, 5.0, rtol=1e-6)
    assert set(np.unique(hits.prim_id)) == {3, 4}
