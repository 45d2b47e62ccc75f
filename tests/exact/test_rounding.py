"""Sheared copies are as exact as a ray of the mesh itself: what they could not show so is traced pixel by pixel."""

import numpy as np
import pytest

import atra
from atra.alignment.rounding import roundings_of_copies
from atra.alignment.second_pass import SECOND_PASS_TILE, nearest_in_tiles
from atra.compiled.threads import WorkerPool
from atra.exact.intersection import Pairs, intersect_pixels
from atra.exact.rounding import Rounding
from atra.exact.rounding_kernels import COPY_MULTIPLE, MOST_ROUNDINGS
from atra.geometry.projection import project_mesh
from scenes.special import NEEDLES_CAMERA, needles
from tests.images import SHEARED, assert_no_pixel_wrong, trace, trace_pixels
from tests.meshes import (
    EYE_AT_ORIGIN,
    beams,
    boards,
    cornell_box,
    cornell_camera,
    needle_camera,
    quads,
    random_triangles,
    specks,
)

each_sheared = pytest.mark.parametrize("method", SHEARED)


def left_out(mesh, camera, split, is_instanced=False):
    pool = WorkerPool(1)
    points = project_mesh(mesh, camera, pool)
    alignment = atra.Alignment.of_cells(camera, atra.Split.of_image(split, camera))
    return roundings_of_copies(mesh, camera, alignment, points, pool, is_instanced=is_instanced).left_out


def depth_error_over_bound(mesh, camera, hits):
    """The largest error of a depth, in units of what rounding may cause for its ray and its triangle."""
    y, x = np.nonzero(hits.hit)
    pairs = Pairs(mesh, camera, x, y, hits.prim_id[y, x], hits.offset)
    bound, volumes, depth = Rounding.of(pairs), pairs.volumes, hits.depth[y, x].astype(np.float64)
    off = np.abs(depth * volumes.facing - volumes.ahead)
    return float((off / (bound.ahead + depth * bound.facing)).max())


@pytest.mark.core
@each_sheared
@pytest.mark.parametrize("seed", range(6))
def test_needles_around_the_eye_have_no_wrong_pixel_and_depths_as_exact_as_those_of_single_rays(seed, method):
    for fov in (60.0, 90.0, 120.0, 150.0):
        mesh, camera = beams(seed), needle_camera(seed, fov)
        hits = trace(method, mesh, camera, ((8, 1), (16, 16), (1, 8), (64, 1))[seed % 4])
        single = trace_pixels(mesh, camera)
        assert_no_pixel_wrong(mesh, camera, hits, single)
        # Not relative to the depth: which pixel meets a needle edge-on depends on the instruction set.
        assert depth_error_over_bound(mesh, camera, hits) <= min(0.25, 3 * depth_error_over_bound(mesh, camera, single))


@pytest.mark.core
@each_sheared
@pytest.mark.parametrize("tilted", [False, True])
def test_boards_along_the_view_have_the_depths_of_single_rays(tilted, method):
    mesh, camera = boards(tilted=tilted), atra.Camera((0, 0, 0), (0, -0.2, -1), fov_y_degrees=60, width=64, height=64)
    reference = trace_pixels(mesh, camera)
    assert reference.hit.mean() > 0.3
    for split in ((16, 16), (64, 1)):
        found = assert_no_pixel_wrong(mesh, camera, trace(method, mesh, camera, split), reference)
        assert found.depth_errors.largest <= 4 * found.reference_depth_errors.largest


@pytest.mark.core
@pytest.mark.parametrize(("seed", "split"), [(0, (128, 1)), (6, (1024, 1)), (7, (32, 4))])
def test_small_triangles_of_walls_along_the_view_have_no_wrong_depth_at_any_column(seed, split):
    camera = atra.Camera((-1150, 250, -40), (0, 230, -40), fov_y_degrees=4, width=1024, height=64)
    mesh = specks(camera, seed)
    reference = trace_pixels(mesh, camera, ties="any")
    assert reference.hit.any(axis=0).mean() > 0.8
    for method in ("aligned", "visible_first"):
        assert_no_pixel_wrong(mesh, camera, trace(method, mesh, camera, split, ties="any"), reference)


def test_small_triangles_of_walls_along_the_view_are_left_out_by_the_roundings_of_both_products_with_the_normal():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=1024, height=64, fov_y_degrees=4)
    right, down, forward = camera.axes
    split = atra.Split.of_image((1024, 1), camera)
    shifts = atra.Alignment.of_cells(camera, split).shifts[0]
    column = np.arange(3.5, 1020, 4)  # a triangle about the middle of each
    slope = camera.plane.columns(column, 0.0) * camera.plane.pitch_x
    places = slope[:, None] * right + 1e-4 * down + forward
    corners = places[:, None] * 100 + np.stack([0 * down, 1e-4 * down, 1e-3 * np.sign(slope[0]) * forward])
    found = left_out(atra.Mesh(corners.reshape(-1, 3), np.arange(3 * len(column)).reshape(-1, 3)), camera, (1024, 1))
    shift = shifts[column.astype(int)]
    corner = (np.abs(slope - shift) + np.abs(shift)) / np.abs(slope)  # |n| |v| / |n . v| of the copy, 1 of the wall
    roundings = corner + (2 * corner + 3)
    certain = np.abs(roundings / (COPY_MULTIPLE * 6) - 1) > 0.01
    np.testing.assert_array_equal(found[certain], (roundings > COPY_MULTIPLE * 6)[certain])
    assert 0.05 < found.mean() < 0.5


def test_what_is_left_out_is_needles_and_planes_through_the_eye_and_nothing_of_an_ordinary_view():
    wall = [(-2.0, -2.0, 5.0), (2.0, -2.0, 5.0), (2.0, 2.0, 5.0), (-2.0, 2.0, 5.0)]
    through_the_eye = [(-2.0, 0.0, 5.0), (2.0, 0.0, 5.0), (2.0, 0.0, 9.0), (-2.0, 0.0, 9.0)]
    mesh = quads([wall, through_the_eye])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64)
    assert left_out(mesh, camera, (16, 4)).tolist() == [False, False, True, True]
    assert left_out(cornell_box(), cornell_camera(64, 64), (64, 1)).mean() < 0.03
    view = atra.Camera(**NEEDLES_CAMERA, width=64, height=64)
    assert left_out(needles(), view, (16, 16)).mean() > 0.2


def test_without_a_shear_only_planes_next_to_the_eye_are_left_out():
    mesh, camera = random_triangles(200, 1), atra.Camera(**EYE_AT_ORIGIN, width=64, height=64)
    pool = WorkerPool(1)
    points = project_mesh(mesh, camera, pool)
    unsheared = atra.Alignment.of_cells(camera, atra.Split.of_image((1, 1), camera))
    found = roundings_of_copies(mesh, camera, unsheared, points, pool)
    most = 4 * 2**-24 * MOST_ROUNDINGS
    np.testing.assert_array_equal(found.left_out, found.depth_error > most)


def test_the_wider_the_view_and_the_fewer_roundings_are_admitted_the_more_is_left_out():
    mesh = random_triangles(2000, 2)
    shares = []
    for fov in (30, 60, 120, 170):
        camera = atra.Camera(**EYE_AT_ORIGIN, width=64, height=64, fov_y_degrees=fov)
        copies, instances = (left_out(mesh, camera, (16, 16), kind) for kind in (False, True))
        assert not (copies & ~instances).any()
        shares.append(copies.mean())
    assert shares == sorted(shares)
    assert 0 < shares[0] < shares[-1] < 0.9


@pytest.mark.parametrize("fov", [40, 120])
def test_no_ray_meets_a_triangle_left_out_before_the_depth_of_its_tile(fov):
    mesh, camera = beams(3, 60), atra.Camera(**EYE_AT_ORIGIN, width=40, height=24, fov_y_degrees=fov)
    with atra.AlignedTracer(mesh, camera, (8, 2), threads=1) as tracer:
        (without,) = tracer.prepared.geometry.left_out
        assert tracer.counters["triangles_left_out"] == len(without.prim_ids) > 5
    nearest = nearest_in_tiles(mesh, camera, without)
    y, x = (grid.ravel() for grid in np.mgrid[:24, :40])
    seen = 0
    for prim_id in without.prim_ids:
        for offset in ((0.0, 0.0), (0.999, 0.999)):
            found = intersect_pixels(mesh, camera, x, y, np.full(x.size, prim_id), offset)
            hit = (found.edge_distance >= 0) & np.isfinite(found.depth)
            tile = y[hit] // SECOND_PASS_TILE[1], x[hit] // SECOND_PASS_TILE[0]
            assert (found.depth[hit] >= nearest[tile]).all()
            seen += int(hit.sum())
    assert seen > 100


def test_every_frame_has_a_second_pass_of_its_own_and_embree_counts_it():
    mesh = boards()
    cameras = [atra.Camera((x, 0, 0), (x, -0.2, -1), fov_y_degrees=70, width=48, height=32) for x in (0.0, 0.3)]
    alignment = atra.Alignment.of_frames(cameras, atra.Split(8, 4, 48, 32))
    for options in ({}, {"culling": False, "geometry": "instanced"}):
        with atra.FramesTracer(mesh, alignment, threads=1, **options) as tracer:
            frames = tracer.trace()
            assert tracer.counters["triangles_left_out"] > 0
            assert tracer.embree_bytes > tracer.prepared.scene.embree_bytes
            second_scenes = [one.scene for one in tracer.prepared.second_passes]
        assert all(scene.closed for scene in second_scenes)
        for hits, camera in zip(frames, cameras, strict=True):
            assert_no_pixel_wrong(mesh, camera, hits, trace_pixels(mesh, camera))


def test_the_corners_of_needles_are_turned_and_of_no_other_triangle():
    needle = [(0.0, 0.0, 0.0), (100.0, 0.0, 0.0), (100.0, 0.05, 0.0)]
    mesh = atra.Mesh(np.array([*needle, (0, 1, 0), (2, 0, 0), (0, 0, 0)]), np.array([[0, 1, 2], [1, 2, 0], [3, 4, 5]]))
    assert mesh.traced_faces.tolist() == [[1, 2, 0], [1, 2, 0], [3, 4, 5]]  # the longest edge opposite, same way round
    square = quads([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]])
    np.testing.assert_array_equal(square.traced_faces, square.faces)
    flat = atra.Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert flat.traced_faces.tolist() == [[0, 1, 2]]


@pytest.mark.core
def test_an_eye_in_the_plane_of_a_floor_sees_what_single_rays_see():
    x, z = np.meshgrid(np.linspace(-3, 3, 9), np.linspace(-6, 0.5, 9))
    i = np.arange(81).reshape(9, 9)
    a, b, c, d = i[:-1, :-1].ravel(), i[:-1, 1:].ravel(), i[1:, 1:].ravel(), i[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    floor = np.stack([x, 0 * x, z], -1).reshape(-1, 3)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    for axes in (np.eye(3), turn):
        mesh = atra.Mesh(floor @ axes.T, faces)
        forward, up = axes @ (0.0, -0.1, -1.0), axes @ (0.0, 1.0, 0.0)
        camera = atra.Camera((0, 0, 0), tuple(forward), tuple(up), 90.0, 64, 65)
        for offset in ((0.5, 0.5), (0.0, 0.0), (0.5, 0.0)):
            reference = trace_pixels(mesh, camera, offset)
            for method in SHEARED:
                assert_no_pixel_wrong(mesh, camera, trace(method, mesh, camera, (16, 1), offset), reference)
