"""The oracle finds what brute force finds, and tells whose fault a disagreement is."""

from dataclasses import replace

import numpy as np
import pytest

import atra
import experiments.workloads.agreement.oracle as oracle
import experiments.workloads.brute_force as brute_force_in_blocks
from atra.judge.compare import Verdict
from atra.prim_ids import MISS
from experiments.workloads.agreement.oracle import examine, nearest_hits, sample_pixels
from scenes.cornell_box import cornell_box
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_camera, quads, random_triangles

CAMERA = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=90.0, width=8, height=6)
PIXEL = (5, 3)  # x, y
NEAR, NEAR_TWIN, FAR, BESIDE = 1, 3, 5, 7  # of the two triangles of each square, the one that PIXEL's ray meets


def square(depth, half=4.0):
    return [(-half, -half, depth), (half, -half, depth), (half, half, depth), (-half, half, depth)]


@pytest.fixture(scope="module")
def mesh():
    """Squares face-on at depths 2, 2 and 3 that fill the view, and one beside it."""
    beside = [(x + 20.0, y, z) for x, y, z in square(2.0)]
    return quads([square(2.0), square(2.0), square(3.0), beside])


@pytest.fixture(scope="module")
def truth(mesh):
    return brute_force(mesh, CAMERA)


def changed(image, prim_id=None, depth=None):
    """The image with another answer at PIXEL."""
    x, y = PIXEL
    prim_ids, depths = image.prim_id.copy(), image.depth.copy()
    prim_ids[y, x] = prim_ids[y, x] if prim_id is None else prim_id
    depths[y, x] = depths[y, x] if depth is None else depth
    return replace(image, prim_id=prim_ids, depth=depths)


@pytest.mark.parametrize("offset", [(0.5, 0.5), (0.0, 0.0), (0.25, 0.75)])
def test_the_oracle_finds_exactly_the_hits_of_brute_force(offset, monkeypatch):
    monkeypatch.setattr(brute_force_in_blocks, "_TRIANGLES", 100)  # more blocks than one
    around = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=130.0, width=37, height=23)
    parallel = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=4.0, width=37, height=23)
    triangles = random_triangles(150, 3)
    for mesh, camera in ((cornell_box(), cornell_camera(37, 23)), (triangles, around), (triangles, parallel)):
        expected = brute_force(mesh, camera, offset)
        y, x = np.divmod(np.arange(37 * 23), 37)
        found = nearest_hits(mesh, camera, x, y, offset)
        assert expected.hit.any()
        assert np.array_equal(found.prim_id, expected.prim_id.reshape(-1))
        assert np.array_equal(found.depth.astype(np.float32), expected.depth.reshape(-1))


def test_the_oracle_finds_no_hit_on_triangles_without_area_edge_on_or_behind_the_eye():
    vertices = [(-9, 0, 3), (9, 0, 3), (0, 0, 3), (0, 0, 1), (5, 0, 9), (-9, -9, -1), (9, -9, -1), (0, 9, -1)]
    mesh = atra.Mesh(vertices, [(0, 1, 2), (0, 0, 1), (0, 3, 4), (5, 6, 7)])
    found = nearest_hits(mesh, CAMERA, np.array([4]), np.array([3]), (0.0, 0.0))
    assert (found.prim_id[0], found.depth[0]) == (MISS, np.inf)


def test_a_lone_ray_through_an_edge_or_a_corner_is_not_lost():
    rim = [(np.cos(t), np.sin(t), 1.0) for t in np.arange(8) * np.pi / 4]
    fan = atra.Mesh([(0, 0, 1.0), *rim], [(0, 1 + i, 1 + (i + 1) % 8) for i in range(8)])
    camera = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=60.0, width=17, height=17)
    expected = brute_force(fan, camera)
    assert expected.hit.all()
    for pixel in range(17 * 17):  # the middle row, column and diagonals meet edges
        y, x = np.divmod(np.array([pixel]), 17)
        assert nearest_hits(fan, camera, x, y).prim_id[0] == expected.prim_id[y[0], x[0]]


def test_the_oracle_finds_no_hit_on_a_triangle_flattened_by_rounding_only():
    mesh = atra.Mesh([(0.1, 0.1, 0.1), (0.2, 0.2, 0.2), (0.4, 0.4, 0.4)], [(0, 1, 2)])
    y, x = np.divmod(np.arange(81), 9)
    for eye_x in np.linspace(0.5, 2.5, 9):
        camera = atra.Camera(eye=(eye_x, 0.7, 2.9), target=(0.2, 0.2, 0.2), width=9, height=9)
        assert (nearest_hits(mesh, camera, x, y).prim_id == MISS).all()


TRUE, HOLE, HIDDEN, OFF = (), (MISS, np.inf), (FAR, 3.0), (None, 2.1)


@pytest.mark.parametrize(("hits", "reference", "expected"), [
    (HIDDEN, TRUE, (True, False)), (TRUE, HOLE, (False, True)), (HOLE, HIDDEN, (True, True)),
    ((BESIDE, 2.0), TRUE, (True, False)), (OFF, TRUE, (True, False)), (TRUE, OFF, (False, True)),
])  # fmt: skip
def test_a_wrong_pixel_is_blamed_on_the_image_that_is_wrong(truth, hits, reference, expected):
    got = examine(changed(truth, *hits), changed(truth, *reference))
    x, y = PIXEL
    assert (list(got.pixels), list(got.disputed)) == ([y * CAMERA.width + x], [True])
    assert got.agreement.verdict[y, x] == Verdict.WRONG
    assert (got.truth.prim_id[0], got.truth.depth[0]) == (NEAR, 2.0)
    assert (got.hits_wrong[0], got.reference_wrong[0]) == expected


def test_nobody_is_wrong_about_equally_deep_triangles(truth):
    found = examine(changed(truth, NEAR_TWIN), truth)
    assert found.agreement.pixels_tied == 1
    assert (list(found.hits_wrong), list(found.reference_wrong)) == ([False], [False])


def test_the_sample_finds_where_both_images_are_wrong_alike(truth):
    alike = changed(truth, FAR, 3.0)
    assert len(examine(alike, alike).pixels) == 0
    x, y = PIXEL
    pixel, another = y * CAMERA.width + x, 7
    twice = examine(alike, truth, np.array([pixel]))  # disputed and sampled: examined once
    assert (list(twice.sampled), list(twice.disputed)) == ([True], [True])
    found = examine(alike, alike, np.array([pixel, another]))
    assert not found.disputed.any()
    assert found.sampled.all()
    assert list(found.pixels) == sorted([pixel, another])
    assert list(found.hits_wrong) == list(found.reference_wrong) == [False, True]


def test_a_sample_is_distinct_pixels_of_the_image_the_same_for_the_same_seed():
    sample = sample_pixels(CAMERA, 20, [1, 2])
    assert len(np.unique(sample)) == 20
    assert sample.min() >= 0
    assert sample.max() < 8 * 6
    assert np.array_equal(sample, sample_pixels(CAMERA, 20, [1, 2]))
    assert not np.array_equal(sample, sample_pixels(CAMERA, 20, [1, 3]))
    assert sorted(sample_pixels(CAMERA, 1000, [1])) == list(range(8 * 6))


def test_where_too_many_pixels_disagree_the_nearer_confirmed_answer_is_the_truth(truth, monkeypatch):
    monkeypatch.setattr(oracle, "EXHAUSTIVE_TESTS", 0)
    found = examine(changed(truth, FAR, 3.0), changed(truth, BESIDE, 2.0), np.array([0]))
    assert list(found.disputed) == [False, True]
    assert (found.truth.prim_id[1], found.truth.depth[1]) == (FAR, 3.0)
    assert (found.hits_wrong[1], found.reference_wrong[1]) == (False, True)
    twins = examine(changed(truth, NEAR_TWIN), truth)
    assert list(twins.truth.prim_id) == [NEAR]
