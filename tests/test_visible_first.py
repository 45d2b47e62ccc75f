"""Visible-first returns the image that per-pixel tracing returns, whatever the probe said."""

import threading

import numpy as np
import pytest

import atra
from atra.alignment.visibility import Tiles, plan_visible_geometry
from atra.embree.library import load_library
from atra.geometry.intersection import intersect_pixels
from atra.judge.reference import brute_force
from atra.parallel import WorkerPool
from tests.images import assert_equal_images, trace_pixels
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles

pytestmark = pytest.mark.core

WIDTHS = load_library().native_packet_widths
OFFSETS = [(0.5, 0.5), (0.0, 0.0), (0.999999, 0.999999), (0.0, 0.7)]
PROBES = ["default", "empty", "full", "random", "hidden", "earlier frame", "wrong frame"]


def trace_visible_first(mesh, camera, split, offset=(0.5, 0.5), **options):
    with atra.VisibleFirstTracer(mesh, camera, split, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


def make_probe(kind, mesh, camera):
    triangles = np.arange(mesh.triangle_count)
    visible = np.unique(trace_pixels(mesh, camera).prim_id)
    if kind == "earlier frame":
        return trace_pixels(mesh, camera, (0.2, 0.1))
    if kind == "wrong frame":  # claims to see nothing but depths that are not there
        hits = trace_pixels(mesh, camera)
        random = np.random.default_rng(2)
        depth = random.choice([0.0, 0.1, 1.0, 10.0, np.inf], hits.depth.shape).astype(np.float32)
        return atra.Hits(depth, hits.prim_id, hits.offset, mesh, camera)
    return {
        "default": None,
        "empty": np.empty(0, np.int64),
        "full": triangles,
        "random": np.random.default_rng(1).choice(triangles, mesh.triangle_count // 2),
        "hidden": np.setdiff1d(triangles, visible),
    }[kind]


@pytest.mark.parametrize("probe", PROBES)
@pytest.mark.parametrize("offset", OFFSETS)
def test_any_probe_gives_the_float64_image(probe, offset):
    camera = cornell_camera(48, 36)
    mesh = cornell_box()
    reference = brute_force(mesh, camera, offset)
    given = make_probe(probe, mesh, camera)
    for split in ((12, 1), (24, 3), (1, 4)):
        assert_equal_images(mesh, camera, trace_visible_first(mesh, camera, split, offset, probe=given), reference)


@pytest.mark.parametrize("probe", PROBES)
@pytest.mark.parametrize("seed", range(6))
def test_triangles_behind_around_and_through_the_eye_give_the_float64_image(seed, probe):
    mesh = random_triangles(60, seed)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=[20, 90, 150, 170, 60, 120][seed])
    given = make_probe(probe, mesh, camera)
    for offset in ((0.5, 0.5), (0.0, 0.99)):
        reference = brute_force(mesh, camera, offset)
        for split in ((1, 1), (40, 1), (1, 24), (5, 4)):
            assert_equal_images(mesh, camera, trace_visible_first(mesh, camera, split, offset, probe=given), reference)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize(("size", "split"), [
    ((96, 60), (3, 5)), ((35, 21), (5, 7)), ((35, 21), (7, 1)), ((33, 7), (1, 7)), ((13, 11), (13, 11)),
    ((1, 1), (1, 1)), ((7, 1), (7, 1)),
])  # fmt: skip
def test_odd_sizes_and_splits_give_the_per_pixel_image_at_every_packet_width(size, split, width):
    camera = cornell_camera(*size)
    mesh = cornell_box()
    reference = trace_pixels(mesh, camera)
    for probe in (None, []):
        hits = trace_visible_first(mesh, camera, split, packet_width=width, probe=probe)
        assert_equal_images(mesh, camera, hits, reference)


@pytest.mark.parametrize("seed", range(3))
def test_a_cloud_of_small_triangles_in_front_of_a_wall_is_complete(seed):
    cloud = random_triangles(3000, seed, size=0.03)
    wall = quads([[(-50, -50, 4), (50, -50, 4), (50, 50, 4), (-50, 50, 4)]])
    vertices = np.concatenate([wall.vertices, cloud.vertices])
    mesh = atra.Mesh(vertices, np.concatenate([wall.faces, cloud.faces + len(wall.vertices)]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=48, fov_y_degrees=70)
    reference = brute_force(mesh, camera, (0.3, 0.8))
    with atra.VisibleFirstTracer(mesh, camera, (16, 1), threads=1, probe=[0, 1]) as tracer:
        assert_equal_images(mesh, camera, tracer.trace((0.3, 0.8)), reference)
        assert tracer.counters["packets_verified"] > 0
    assert_equal_images(mesh, camera, trace_visible_first(mesh, camera, (16, 1), (0.3, 0.8)), reference)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("counts", [(12, 1), (24, 1), (4, 3)])
@pytest.mark.parametrize("fov", [30, 100, 175])
def test_no_ray_meets_a_copy_left_out_before_the_depth_of_its_tile(seed, counts, fov):
    mesh = random_triangles(40, seed, size=1.5)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=24, height=18, fov_y_degrees=fov)
    split = atra.Split(*counts, camera.width, camera.height)
    tiles, pool = Tiles(4, 4, camera.width, camera.height), WorkerPool(1)
    seen_depth = np.random.default_rng(seed).choice([0.0, 0.0, 0.0, 1.0], tiles.shape)
    plan = plan_visible_geometry(
        mesh, atra.Alignment.of_cells(camera, split), tiles, (np.zeros(40, np.uint8), seen_depth), atra.CellOptions(),
        row_stride=24, pool=pool,
    )  # fmt: skip
    assert np.isfinite(plan.nearest_hidden).any()
    records = plan.geometry.records
    prim_id, pixels = records & 0xFFFFFFFF, records >> 32
    kept = set(zip(prim_id.tolist(), (pixels % 24).tolist(), (pixels // 24).tolist(), strict=True))
    y, x = (grid.ravel() for grid in np.mgrid[:18, :24])
    for triangle in range(mesh.triangle_count):
        left_out = np.array([
            (triangle, i // split.cell_width * split.cell_width, j // split.cell_height * split.cell_height) not in kept
            for i, j in zip(x, y, strict=True)
        ])  # fmt: skip
        for offset in ((0.0, 0.0), (0.5, 0.5), (0.999, 0.999)):
            found = intersect_pixels(mesh, camera, x, y, np.full(x.size, triangle), offset)
            hit = left_out & (found.edge_distance >= 0) & np.isfinite(found.depth)
            assert (found.depth[hit] >= plan.nearest_hidden[y[hit] // 4, x[hit] // 4]).all()


def test_a_wall_hides_what_is_behind_and_nothing_need_be_verified():
    wall = [(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]
    behind = [[(x, -0.5, 8), (x + 0.4, -0.5, 8), (x + 0.4, 0.5, 8), (x, 0.5, 8)] for x in np.arange(-3, 3, 0.5)]
    mesh = quads([wall, *behind])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64, fov_y_degrees=60)
    with atra.VisibleFirstTracer(mesh, camera, (16, 1), threads=1) as tracer:
        assert set(np.unique(tracer.trace().prim_id)) == {0, 1}
        assert tracer.counters["packets_verified"] == 0
        assert tracer.triangle_count - mesh.triangle_count <= 2 * 16
        assert not np.isinf(tracer._second_pass._nearest).all()


def test_degenerate_triangles_and_coplanar_duplicates_give_the_float64_depth():
    plane = [(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]
    doubled = quads([plane, plane])
    edge_on, point, line = [[0, -3, 1], [0, 3, 1], [0, 0, 9]], [[0, 0, 1]] * 3, [[-1, 0, 1], [0, 0, 1], [1, 0, 1]]
    vertices = np.concatenate([edge_on, point, line, doubled.vertices])
    mesh = atra.Mesh(vertices, np.concatenate([np.arange(9).reshape(3, 3), doubled.faces.astype(int) + 9]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=30, height=31)
    for probe in (None, [], [3, 4], [5, 6]):
        hits = trace_visible_first(mesh, camera, (15, 1), probe=probe)
        np.testing.assert_allclose(hits.depth, 5.0, rtol=1e-6)


@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("probe", ["default", "hidden"])
def test_the_number_of_threads_does_not_change_the_image(threads, probe):
    camera = cornell_camera(96, 60)
    mesh = cornell_box()
    given = make_probe(probe, mesh, camera)
    one = trace_visible_first(mesh, camera, (12, 2), probe=given)
    many = trace_visible_first(mesh, camera, (12, 2), probe=given, threads=threads)
    np.testing.assert_array_equal(one.prim_id, many.prim_id)
    np.testing.assert_array_equal(one.depth, many.depth)


def test_one_plan_serves_every_offset_and_may_reuse_an_image():
    camera = cornell_camera(64, 48)
    mesh = cornell_box()
    with atra.VisibleFirstTracer(mesh, camera, (16, 1), threads=1) as tracer:
        hits = None
        for offset in [*OFFSETS, (0.5, 0.5)]:
            hits = tracer.trace(offset, out=hits)
            assert_equal_images(mesh, camera, hits, brute_force(mesh, camera, offset))


@pytest.mark.parametrize("build_quality", ["low", "medium", "high"])
def test_every_build_quality_gives_the_per_pixel_image(build_quality):
    camera = cornell_camera(64, 48)
    mesh = cornell_box()
    hits = trace_visible_first(mesh, camera, (16, 1), build_quality=build_quality)
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera))


def test_an_empty_view_is_all_misses():
    mesh = quads([[(-9, -9, 5), (9, -9, 5), (9, 9, 5), (-9, 9, 5)]])
    hits = trace_visible_first(mesh, atra.Camera((0, 0, 0), (0, 0, -1), width=16, height=8), (4, 1))
    assert not hits.hit.any()
    assert np.isinf(hits.depth).all()


def test_plan_probe_and_build_are_timed_and_both_scenes_are_counted():
    camera = cornell_camera(64, 64)
    mesh = cornell_box()
    with atra.PixelTracer(mesh, camera) as pixel, atra.VisibleFirstTracer(mesh, camera, (16, 1)) as tracer:
        assert 0 < tracer.counters["probe_time_s"] < tracer.plan_time_s
        assert tracer.build_time_s > 0
        assert tracer.embree_bytes > pixel.embree_bytes
        assert tracer.triangle_count > mesh.triangle_count
        first = tracer.triangle_count
        tracer.plan()
        tracer.build()
        assert tracer.triangle_count == first
        assert_equal_images(mesh, camera, tracer.trace(), pixel.trace())


def test_two_python_threads_may_share_a_tracer():
    camera = cornell_camera(64, 64)
    mesh = cornell_box()
    seen = []
    with atra.VisibleFirstTracer(mesh, camera, (8, 1), threads=2, probe=[]) as tracer:
        expected = tracer.trace().prim_id
        workers = [threading.Thread(target=lambda: seen.append(tracer.trace().prim_id)) for _ in range(4)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
    assert len(seen) == 4
    for prim_id in seen:
        np.testing.assert_array_equal(prim_id, expected)


def test_tracing_before_build_or_after_close_is_an_error_and_closing_twice_is_not():
    tracer = atra.VisibleFirstTracer(cornell_box(), cornell_camera(16, 16), (4, 1))
    with pytest.raises(atra.EmbreeError, match="not built"):
        tracer.trace()
    with tracer:
        tracer.trace()
    tracer.close()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.trace()
    with pytest.raises(atra.EmbreeError, match="closed"):
        tracer.plan()


@pytest.mark.parametrize(("options", "message"), [
    ({"probe": [1112]}, "the probe names prim_id 1112, but"),
    ({"probe": [-1]}, "the probe names prim_id -1, but"),
    ({"probe": [0.5]}, "the probe has dtype float64, expected whole numbers"),
    ({"split": (5, 1)}, r"split \(5, 1\) does not divide image 16 x 16"),
])  # fmt: skip
def test_a_bad_option_is_refused_with_its_value(options, message):
    with pytest.raises(atra.InputError, match=message):
        atra.VisibleFirstTracer(cornell_box(), cornell_camera(16, 16), **{"split": (4, 1), **options})


def test_a_probe_of_another_size_is_refused():
    probe = trace_pixels(cornell_box(), cornell_camera(8, 16))
    with pytest.raises(atra.InputError, match=r"the probe is an image of \(16, 8\), expected \(16, 16\)"):
        atra.VisibleFirstTracer(cornell_box(), cornell_camera(16, 16), (4, 1), probe=probe)


def test_a_plan_over_its_memory_budget_is_refused():
    tracer = atra.VisibleFirstTracer(cornell_box(), cornell_camera(64, 64), (64, 1), memory_budget_bytes=1 << 12)
    with pytest.raises(atra.MemoryBudgetError, match="GiB"):
        tracer.plan()
    tracer.close()
