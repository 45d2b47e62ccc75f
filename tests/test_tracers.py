"""The promise of the paper: aligned tracing returns the image that per-pixel tracing returns."""

import threading
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

import atra
from atra.embree.library import load_library
from atra.judge.reference import brute_force
from atra.tracers import choose_packet_shape
from tests.images import assert_equal_images, trace_pixels
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

WIDTHS = load_library().native_packet_widths
OFFSETS = [(0.5, 0.5), (0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)]


def divisors(number):
    return [n for n in range(1, number + 1) if number % n == 0]


def trace_aligned(mesh, camera, split, offset=(0.5, 0.5), **options):
    with atra.AlignedTracer(mesh, camera, split, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


def tilted_plane():
    """World plane z = 4 + 0.5 x - 0.25 y, far larger than any view used here."""
    xy = [(-50, -50), (50, -50), (50, 50), (-50, 50)]
    return quads([[(x, y, 4 + 0.5 * x - 0.25 * y) for x, y in xy]], "tilted plane")


def tilted_plane_depth(camera, offset):
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    direction = camera.directions(x, y, offset)
    world_x, world_y = -direction[..., 0], -direction[..., 1]
    return 4 / (1 - 0.5 * world_x + 0.25 * world_y)


@pytest.mark.core
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("offset", OFFSETS)
def test_a_tilted_plane_has_the_depth_of_its_equation(width, offset):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=48, height=30, fov_y_degrees=50)
    expected = tilted_plane_depth(camera, offset)
    for hits in (
        trace_pixels(tilted_plane(), camera, offset, packet_width=width),
        trace_aligned(tilted_plane(), camera, (6, 1), offset, packet_width=width),
        trace_aligned(tilted_plane(), camera, (3, 5), offset, packet_width=width, culling=False),
    ):
        np.testing.assert_allclose(hits.depth, expected, rtol=2e-6)


def test_each_column_of_a_staircase_has_the_depth_of_its_step():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=32, fov_y_degrees=40)
    # Step s covers pixel columns 8 s to 8 s + 8 at depth 2 + s; camera X is world -x.
    edges = (np.arange(0, 65, 8) - 32) * camera.pixel_pitch
    steps = [
        [(-left * z, -9, z), (-right * z, -9, z), (-right * z, 9, z), (-left * z, 9, z)]
        for z, left, right in zip(range(2, 10), edges[:-1], edges[1:], strict=True)
    ]
    hits = trace_aligned(quads(steps), camera, (16, 2))
    np.testing.assert_allclose(hits.depth, np.broadcast_to(np.repeat(np.arange(2.0, 10.0), 8), (32, 64)), rtol=1e-6)
    np.testing.assert_array_equal(hits.prim_id // 2, np.broadcast_to(np.repeat(np.arange(8), 8), (32, 64)))


def test_the_row_at_the_top_of_the_image_sees_what_is_above():
    above = quads([[(-9, 1, 5), (9, 1, 5), (9, 9, 5), (-9, 9, 5)]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=16, height=16, fov_y_degrees=60)
    hits = trace_aligned(above, camera, (4, 4))
    assert hits.hit[0].all()
    assert not hits.hit[-1].any()


@pytest.mark.core
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("culling", [True, False])
def test_every_split_of_a_small_image_gives_the_float64_image(width, culling):
    camera = cornell_camera(24, 12)
    mesh = cornell_box()
    reference = brute_force(mesh, camera)
    for nx in divisors(24):
        for ny in divisors(12):
            hits = trace_aligned(mesh, camera, (nx, ny), culling=culling, packet_width=width)
            assert_equal_images(mesh, camera, hits, reference)


@pytest.mark.core
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(("size", "split"), [
    ((96, 60), (3, 5)), ((35, 21), (5, 7)), ((35, 21), (7, 1)), ((33, 7), (1, 7)), ((13, 11), (13, 11)),
    ((1, 1), (1, 1)), ((7, 1), (7, 1)),
])  # fmt: skip
def test_odd_sizes_and_splits_give_the_per_pixel_image(size, split, width):
    camera = cornell_camera(*size)
    mesh = cornell_box()
    reference = trace_pixels(mesh, camera)
    assert_equal_images(mesh, camera, trace_pixels(mesh, camera, packet_width=width), reference)
    assert_equal_images(mesh, camera, trace_aligned(mesh, camera, split, packet_width=width), reference)


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("culling", [True, False])
def test_any_offset_gives_the_float64_image(offset, culling):
    camera = cornell_camera(48, 36)
    mesh = cornell_box()
    assert_equal_images(
        mesh, camera, trace_aligned(mesh, camera, (12, 3), offset, culling=culling), brute_force(mesh, camera, offset)
    )


@pytest.mark.core
@pytest.mark.parametrize("seed", range(6))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(seed):
    mesh = random_triangles(60, seed)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=[20, 90, 150, 170, 60, 120][seed])
    reference = brute_force(mesh, camera)
    for split in ((1, 1), (8, 1), (40, 1), (1, 24), (5, 4), (40, 24)):
        culled = trace_aligned(mesh, camera, split)
        whole = trace_aligned(mesh, camera, split, culling=False)
        assert_equal_images(mesh, camera, culled, reference)
        np.testing.assert_array_equal(culled.prim_id, whole.prim_id)
        np.testing.assert_array_equal(culled.depth, whole.depth)


def test_a_triangle_with_a_corner_in_the_eye_is_never_lost_by_culling():
    mesh = atra.Mesh([[0, 0, 0], [0.5, -3, 5], [-0.5, 3, 5.5]], [[0, 1, 2]])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=32, height=32, fov_y_degrees=80)
    culled, whole = (trace_aligned(mesh, camera, (16, 4), culling=culling) for culling in (True, False))
    np.testing.assert_array_equal(culled.prim_id, whole.prim_id)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_number_of_threads_does_not_change_the_image(threads):
    camera = cornell_camera(96, 60)
    mesh = cornell_box()
    one = trace_aligned(mesh, camera, (12, 2))
    many = trace_aligned(mesh, camera, (12, 2), threads=threads)
    np.testing.assert_array_equal(one.prim_id, many.prim_id)
    np.testing.assert_array_equal(one.depth, many.depth)
    pixels_one, pixels_many = trace_pixels(mesh, camera), trace_pixels(mesh, camera, threads=threads)
    np.testing.assert_array_equal(pixels_one.prim_id, pixels_many.prim_id)


@pytest.mark.parametrize("build_quality", ["low", "medium", "high"])
def test_every_build_quality_gives_the_per_pixel_image(build_quality):
    camera = cornell_camera(64, 48)
    mesh = cornell_box()
    hits = trace_aligned(mesh, camera, (16, 1), build_quality=build_quality)
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera))


def test_an_empty_view_is_all_misses():
    camera = atra.Camera((0, 0, 0), (0, 0, -1), width=16, height=8)
    mesh = tilted_plane()
    hits = trace_aligned(mesh, camera, (4, 1))
    assert not hits.hit.any()
    assert np.isinf(hits.depth).all()
    assert np.isnan(hits.u).all()


def test_triangles_without_area_keep_their_number_and_are_never_hit_or_copied():
    plane = tilted_plane()
    point, line = [[0, 0, 1]] * 3, [[-1, 0, 1], [0, 0, 1], [1, 0, 1]]
    vertices = np.concatenate([point, line, plane.vertices])
    mesh = atra.Mesh(vertices, np.concatenate([[[0, 1, 2], [3, 4, 5]], plane.faces.astype(int) + 6]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=31, height=31)
    with atra.AlignedTracer(mesh, camera, (31, 1), culling=False) as tracer:
        assert tracer.triangle_count == 31 * 2
        assert set(np.unique(tracer.trace().prim_id)) == {2, 3}


def test_a_second_frame_forgets_the_first_and_may_reuse_its_memory():
    camera = cornell_camera(33, 20)
    mesh = cornell_box()
    with atra.AlignedTracer(mesh, camera, (11, 4), threads=1) as tracer:
        first = tracer.trace((0.5, 0.5))
        expected = first.prim_id.copy()
        other = tracer.trace((0.1, 0.9), out=first)
        assert np.shares_memory(other.prim_id, first.prim_id)
        again = tracer.trace((0.5, 0.5), out=other)
        np.testing.assert_array_equal(again.prim_id, expected)


def test_u_and_v_point_at_the_place_that_was_hit():
    camera = cornell_camera(32, 24)
    mesh = cornell_box()
    hits = trace_aligned(mesh, camera, (8, 2))
    y, x = np.nonzero(hits.hit)
    corners = mesh.triangles(hits.prim_id[y, x])
    u, v = hits.u[y, x][:, None], hits.v[y, x][:, None]
    points = camera.to_camera_space((1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2])
    np.testing.assert_allclose(points[:, 2], hits.depth[y, x], rtol=1e-5)
    np.testing.assert_allclose(points / points[:, 2:], camera.directions(x, y), atol=1e-6)


def test_culling_keeps_fewer_triangles_and_reports_them_all():
    camera = cornell_camera(64, 64)
    mesh = cornell_box()
    with atra.AlignedTracer(mesh, camera, (16, 1), culling=False) as whole:
        assert whole.triangle_count == 16 * (mesh.triangle_count - whole.counters["triangles_left_out"])
        assert whole.counters["triangles_left_out"] < 0.03 * mesh.triangle_count
    with atra.AlignedTracer(mesh, camera, (16, 1)) as culled:
        assert 0 < culled.triangle_count < 4 * mesh.triangle_count
        assert culled.embree_bytes > 0
        assert culled.plan_time_s > 0
        assert culled.build_time_s > 0


def test_two_tracers_work_side_by_side_in_two_python_threads():
    camera = cornell_camera(64, 64)
    mesh = cornell_box()
    expected = trace_aligned(mesh, camera, (8, 1)).prim_id
    seen = []

    def work():
        with atra.AlignedTracer(mesh, camera, (8, 1), threads=2) as tracer:
            seen.extend(tracer.trace().prim_id for _ in range(5))

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(seen) == 10
    for prim_id in seen:
        np.testing.assert_array_equal(prim_id, expected)


def test_tracing_before_build_or_after_close_is_an_error_and_closing_twice_is_not():
    tracer = atra.AlignedTracer(cornell_box(), cornell_camera(16, 16), (4, 1))
    with pytest.raises(atra.EmbreeError, match="not built"):
        tracer.trace()
    with tracer:
        tracer.trace()
    tracer.close()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.trace()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.plan()


def test_an_out_of_another_size_is_refused():
    with atra.PixelTracer(cornell_box(), cornell_camera(16, 16)) as tracer:
        other = trace_pixels(cornell_box(), cornell_camera(8, 16))
        with pytest.raises(atra.InputError, match="expected"):
            tracer.trace(out=other)


@pytest.mark.parametrize("make", [atra.PixelTracer, partial(atra.AlignedTracer, split=(4, 1))])
def test_an_out_of_another_kind_is_refused_before_it_is_written(make):
    with make(cornell_box(), cornell_camera(16, 16)) as tracer:
        hits = tracer.trace()
        swapped = hits.depth.dtype.newbyteorder()
        frozen = np.lib.stride_tricks.as_strided(hits.depth, hits.depth.shape, hits.depth.strides, writeable=False)
        for fields, message in (
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


@pytest.mark.parametrize("out", ["x", (1, 2), SimpleNamespace(depth=None, prim_id=None), atra.PixelTracer])
@pytest.mark.parametrize("make", [
    atra.PixelTracer,
    partial(atra.AlignedTracer, split=(4, 1)),
    lambda mesh, camera: atra.FramesTracer(mesh, atra.Alignment.of_frames([camera] * 2, atra.Split(4, 1, 16, 16))),
])  # fmt: skip
def test_an_out_that_is_no_result_is_refused_by_name(make, out):
    with make(cornell_box(), cornell_camera(16, 16)) as tracer:
        with pytest.raises(atra.InputError, match=r"out is .*, expected a result of this tracer, or None"):
            tracer.trace(out=out)
        tracer.trace(out=tracer.trace())


@pytest.mark.parametrize("make", [
    atra.PixelTracer,
    partial(atra.AlignedTracer, split=(4, 1)),
    partial(atra.VisibleFirstTracer, split=(4, 1)),
    partial(atra.TiledTracer, split=(4, 1)),
    lambda mesh, camera: atra.FramesTracer(
        mesh, atra.Alignment.of_frames([camera] * 2, atra.Split(4, 1, camera.width, camera.height))
    ),
])  # fmt: skip
def test_an_image_that_no_memory_holds_is_refused_before_anything_is_allocated(make):
    message = r"depth and prim_id of [12],000,000 rows of 1,000,000 pixels need about .* GiB, .*use fewer pixels"
    with pytest.raises(atra.MemoryBudgetError, match=message):
        make(cornell_box(), cornell_camera(10**6, 10**6))


@pytest.mark.parametrize(("options", "message"), [
    ({"packet_width": 3}, "packet_width is 3, this machine supports"),
    ({"threads": 0}, "threads is 0"),
    ({"threads": 10**6}, "threads is 1000000, expected at most 1024; None takes every core"),
    ({"build_quality": "best"}, "build_quality is 'best', expected one of low, medium, high"),
    ({"split": (5, 1)}, r"split \(5, 1\) does not divide image 16 x 16"),
])  # fmt: skip
def test_a_bad_option_is_refused_with_its_value(options, message):
    with pytest.raises(atra.InputError, match=message):
        atra.AlignedTracer(cornell_box(), cornell_camera(16, 16), **{"split": (4, 1), **options})


@pytest.mark.core
@pytest.mark.parametrize("width", sorted({1, 2, 4, 8, 16, 32} - set(WIDTHS)))
def test_packets_of_a_width_that_is_not_native_are_refused_naming_those_that_are(width):
    native = ", ".join(map(str, WIDTHS))
    for make in (atra.PixelTracer, partial(atra.AlignedTracer, split=(4, 1))):
        with pytest.raises(atra.InputError, match=f"packet_width is {width}, this machine supports {native}"):
            make(cornell_box(), cornell_camera(16, 16), packet_width=width)


@pytest.mark.parametrize("offset", [(1.0, 0.5), (-0.1, 0.5), (float("nan"), 0.5)])
def test_an_offset_outside_the_pixel_is_refused(offset):
    with atra.AlignedTracer(cornell_box(), cornell_camera(16, 16), (4, 1)) as tracer, pytest.raises(atra.InputError):
        tracer.trace(offset)


def test_a_plan_over_its_memory_budget_is_refused_before_allocating():
    camera = cornell_camera(64, 64)
    with pytest.raises(atra.MemoryBudgetError, match="GiB"):
        atra.AlignedTracer(cornell_box(), camera, (64, 64), culling=False, memory_budget_bytes=1 << 20)
    with pytest.raises(atra.MemoryBudgetError, match="free"):
        atra.AlignedTracer(random_triangles(300_000, 0), cornell_camera(1024, 1024), (4096 // 4, 4), culling=False)
    tracer = atra.AlignedTracer(cornell_box(), camera, (64, 64), memory_budget_bytes=1 << 16)
    with pytest.raises(atra.MemoryBudgetError, match="GiB"):
        tracer.plan()


@pytest.mark.parametrize(("width", "counts", "shape"), [
    (8, (1, 1), (8, 1)), (8, (128, 1), (8, 1)), (8, (256, 1), (4, 2)), (8, (1024, 1), (1, 8)),
    (8, (256, 1024), (8, 1)), (4, (512, 1), (2, 2)), (16, (128, 1), (8, 2)), (1, (1024, 1), (1, 1)),
])  # fmt: skip
def test_the_packet_shape_wastes_as_few_lanes_as_the_cell_allows(width, counts, shape):
    assert choose_packet_shape(width, atra.Split(*counts, 1024, 1024)) == shape


@pytest.mark.core
@pytest.mark.skipif(8 not in WIDTHS, reason="packets of 8 are not native here")
@pytest.mark.parametrize("rows", [1, 2, 4, 8])
@pytest.mark.parametrize("kind", [atra.AlignedTracer, atra.VisibleFirstTracer])
def test_a_forced_packet_shape_gives_the_same_image(kind, rows):
    mesh, camera = cornell_box(), cornell_camera(64, 32)
    with kind(mesh, camera, (4, 2), packet_width=8, packet_rows=rows, threads=1) as tracer:
        assert tracer.packet_shape == (8 // rows, rows)
        assert_equal_images(mesh, camera, tracer.trace(), trace_pixels(mesh, camera))


@pytest.mark.parametrize("rows", [3, 16, 0])
def test_a_packet_shape_that_cannot_be_is_refused(rows):
    with pytest.raises(atra.InputError, match=f"packet_rows is {rows}, expected one of 1, 2, 4, 8"):
        choose_packet_shape(8, atra.Split(4, 1, 64, 64), rows)


# Parallel rays: the same tests with an orthographic camera, whose cells are translated instead of sheared.

PARALLEL = atra.OrthographicCamera((0, 0, 0), (0, 0, 1), view_height=4.0, width=48, height=30)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("offset", OFFSETS)
def test_parallel_rays_give_a_tilted_plane_the_depth_of_its_equation(width, offset):
    origins, _ = PARALLEL.rays(*np.meshgrid(np.arange(48), np.arange(30)), offset)
    expected = 4 - 0.5 * origins[..., 0] + 0.25 * origins[..., 1]  # camera X and Y are the world's -x and -y
    for hits in (
        trace_pixels(tilted_plane(), PARALLEL, offset, packet_width=width),
        trace_aligned(tilted_plane(), PARALLEL, (6, 1), offset, packet_width=width),
        trace_aligned(tilted_plane(), PARALLEL, (3, 5), offset, packet_width=width, culling=False),
        trace_aligned(
            tilted_plane(), PARALLEL, (3, 5), offset, packet_width=width, culling=False, geometry="instanced"
        ),
    ):
        np.testing.assert_allclose(hits.depth, expected, rtol=2e-6)


@pytest.mark.core
@pytest.mark.parametrize("options", [{}, {"culling": False}, {"culling": False, "geometry": "instanced"}])
@pytest.mark.parametrize("seed", range(4))
def test_parallel_rays_give_the_float64_image_of_triangles_all_around(seed, options):
    mesh = random_triangles(60, seed)
    pose = [{"eye": (0, 0, 0), "target": (0, 0, 1)}, {"eye": (0.3, 0.2, -0.4), "target": (1, 2, 3)}][seed % 2]
    camera = atra.OrthographicCamera(**pose, view_height=[1.0, 5.0, 12.0, 0.1][seed], width=40, height=24)
    reference = brute_force(mesh, camera)
    assert_equal_images(mesh, camera, trace_pixels(mesh, camera), reference)
    for split in ((1, 1), (8, 1), (40, 1), (1, 24), (5, 4), (40, 24)):
        assert_equal_images(mesh, camera, trace_aligned(mesh, camera, split, **options), reference)


def test_culling_keeps_no_copy_that_parallel_rays_of_its_cell_cannot_meet():
    mesh = random_triangles(400, 1, size=0.1)
    with atra.AlignedTracer(mesh, PARALLEL, (12, 1), threads=1) as tracer:
        # The view is a 4 units high and 6.4 wide part of 6 x 6 and more; a triangle meets about one cell of 0.5 units.
        assert tracer.triangle_count < 2 * mesh.triangle_count


def test_a_directional_lights_shadow_map_is_that_of_single_rays():
    mesh = cornell_box()
    light = atra.OrthographicCamera.of_light((0.3, -1.0, 0.2), mesh.bounds, 96, 64)
    reference = trace_pixels(mesh, light)
    assert reference.hit.mean() > 0.2
    for split in ((1, 1), (24, 1), (4, 8)):
        assert_equal_images(mesh, light, trace_aligned(mesh, light, split), reference)


def test_methods_that_need_rays_through_one_point_refuse_parallel_ones():
    for tracer in (atra.VisibleFirstTracer, atra.TiledTracer):
        with pytest.raises(atra.InputError, match=f"{tracer.__name__} needs rays through one point.*use AlignedTracer"):
            tracer(cornell_box(), PARALLEL, (4, 1))


@pytest.mark.parametrize("make", [atra.AlignedTracer, atra.VisibleFirstTracer, atra.TiledTracer])
def test_a_triangle_with_two_equal_corners_on_a_line_through_the_eye_is_shown_nowhere(make):
    # Fused multiplications give its sheared copy a width, and it was seen six pixels beside where it is.
    mesh = atra.Mesh([(0, 0, 0.5), (0, 1.5, 0.5)], [(0, 1, 1)])
    camera = atra.Camera((0, 0.25, 0.5), (0, 0, 0.5), (0, 0, 1), 1.0, width=13, height=7)
    with make(mesh, camera, (13, 7), packet_width=1, threads=1) as tracer:
        hits = tracer.trace()
    assert not hits.hit.any()


def test_no_method_shows_a_triangle_without_area():
    random = np.random.default_rng(0)
    ends = random.uniform(-2, 2, (300, 2, 3)).astype(np.float32)
    vertices = np.concatenate([ends[:, :1], ends, ends[:, 1:]], axis=1).reshape(-1, 3)  # a, a, b, b
    faces = np.concatenate([np.arange(1200).reshape(-1, 4)[:, corners] for corners in ([0, 1, 2], [0, 2, 3])])
    mesh = atra.Mesh(vertices, faces)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=48, fov_y_degrees=120)
    options = {"culling": False, "geometry": "instanced"}
    for tracer in (
        atra.PixelTracer(mesh, camera), atra.PixelTracer(mesh, camera, packet_width=1),
        atra.TiledTracer(mesh, camera, (8, 4)),
        atra.AlignedTracer(mesh, camera, (16, 1)), atra.AlignedTracer(mesh, camera, (16, 1), **options),
        atra.VisibleFirstTracer(mesh, camera, (16, 1)),
    ):  # fmt: skip
        with tracer:
            assert not tracer.trace().hit.any()
