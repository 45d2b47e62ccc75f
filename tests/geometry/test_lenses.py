"""Lenses: as OpenCV projects through them, back again, and up to where they fold over."""

import pickle
from itertools import product

import numpy as np
import pytest

import atra
from atra.geometry.lenses.folds_kernels import find_folds
from atra.geometry.lenses.lens_kernels import distort
from tests.lenses import SIZES, lens_camera, random_lens

cv2 = pytest.importorskip("cv2", reason="OpenCV, a test dependency, is what lenses are held against")

K = np.array([[125.0, 0.0, 79.0], [0.0, 120.0, 61.5], [0.0, 0.0, 1.0]])
PLACED = atra.Camera((0.3, 0.2, -2.0), (0.1, 0.0, 1.0), (0.1, -1.0, 0.0))


def camera_with(distortion, model="pinhole", size=(160, 120)):
    turn, _ = cv2.Rodrigues(np.array([0.2, -0.4, 0.1]))
    return atra.Camera.from_opencv(K, turn, [0.1, 0.2, 0.3], *size, distortion, model)


def pixels_of(camera):
    """Pixel positions of the centres, (H, W, 2)."""
    return np.stack(np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5), axis=-1)


def seen_points(camera):
    """Points that the pixels see, world space, and those pixels' positions."""
    origins, directions = camera.rays_world()
    sees = camera.has_ray()
    return (origins + 2.0 * directions)[sees], pixels_of(camera)[sees]


FISHEYE_SIZES = (0.1, 0.05, 0.01, 0.005)


@pytest.mark.parametrize(("model", "seed"), [*product(["pinhole"], range(5)), *product(["fisheye"], range(4))])
def test_opencv_projects_what_a_pixel_sees_to_its_centre(model, seed):
    count, sizes = ((4, 5, 8, 12, 14)[seed % 5], SIZES) if model == "pinhole" else (4, FISHEYE_SIZES)
    coefficients = (np.random.default_rng(seed).normal(size=len(sizes)) * sizes)[:count]
    camera = camera_with(coefficients, model)
    points, pixels = seen_points(camera)
    ahead = camera.to_camera_space(points)[:, 2] > 1e-3  # OpenCV's fisheye mirrors what is behind
    assert ahead.sum() > 1000
    turn, _ = cv2.Rodrigues(camera.axes)
    project = cv2.projectPoints if model == "pinhole" else cv2.fisheye.projectPoints
    projected, _ = project(points[ahead][:, None], turn, -camera.axes @ np.array(camera.eye), K, coefficients)
    np.testing.assert_allclose(projected[:, 0] + 0.5, pixels[ahead], rtol=0, atol=1e-9)


def assert_projects_back(camera):
    points, pixels = seen_points(camera)
    np.testing.assert_allclose(camera.project(points), pixels, rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [12, pytest.param(1000, marks=pytest.mark.slow)])
def test_what_a_pixel_sees_is_projected_back_to_it(count):
    random = np.random.default_rng(0)
    for _ in range(count):
        assert_projects_back(lens_camera(random_lens(random), PLACED, focal=random.uniform(0.3, 3.0)))


def test_a_panorama_sees_all_around_once_and_every_point_where_its_angles_say():
    camera = atra.LensCamera.panorama((0, 0, 0), (0, 0, 1), (0, -1, 0), 64)
    assert (camera.width, camera.height, camera.has_ray().all()) == (64, 32, True)
    assert_projects_back(camera)
    ahead, right, down, back = camera.project([(0, 0, 3), (2, 0, 0), (0, 5, 0), (1e-9, 0, -1)])
    np.testing.assert_allclose([ahead, right, back], [(32, 16), (48, 16), (64, 16)], atol=1e-6)
    assert down[1] == pytest.approx(32)
    with pytest.raises(atra.InputError, match="panorama sees all around"):
        camera.undistorted()


def test_the_fov_model_is_its_closed_form():
    camera = lens_camera(atra.FovLens(0.9), PLACED)
    x, y = np.array([5, 60]), np.array([9, 70])
    direction = camera.rays(x, y)[1]
    a, b = camera.sensor_coordinates(x, y, (0.5, 0.5))
    np.testing.assert_allclose(
        np.hypot(a, b), np.arctan(2 * np.hypot(*direction.T[:2]) * np.tan(0.45)) / 0.9, rtol=1e-12
    )


def test_no_pixel_beyond_the_fold_of_a_barrel_has_a_ray_and_every_one_before_it_has():
    k1 = -0.2  # r + k1 r^3 rises up to r = sqrt(-1 / 3 k1), where it is 2/3 of r
    camera = lens_camera(atra.OpenCVLens(k1=k1), PLACED, focal=0.6)
    y, x = np.mgrid[0:72, 0:96]
    distance = np.hypot(*camera.sensor_coordinates(x, y, (0.5, 0.5)))
    border = 2 / 3 * np.sqrt(-1 / (3 * k1))
    assert 0.02 < (distance > border).mean() < 0.5
    np.testing.assert_array_equal(camera.has_ray(), distance <= border)
    assert camera.lens.numbers.surely == pytest.approx(np.sqrt(-1 / (3 * k1)), rel=1e-12)
    assert pickle.loads(pickle.dumps(camera)) == camera
    seen = camera.project(camera.eye + np.array([(1.29, 0, 1), (1.30, 0, 1), (0, 0, -1)]) @ camera.axes)
    assert np.isfinite(seen).all(axis=1).tolist() == [True, False, False]  # sqrt(5 / 3) is 1.291


@pytest.mark.parametrize("seed", range(4))
def test_along_every_radius_the_determinant_of_the_jacobian_is_first_zero_at_the_fold(seed):
    random = np.random.default_rng(seed)
    lens = atra.OpenCVLens.of(random.normal(size=12) * SIZES[:12] * [1, 1, 8, 8, 1, 1, 1, 1, 8, 8, 8, 8])
    angles, step = random.uniform(0, 2 * np.pi, 20), 1e-6
    ways, folds = np.stack([np.cos(angles), np.sin(angles)], axis=1), np.empty(20)
    find_folds(lens.numbers, ways[:, 0].copy(), ways[:, 1].copy(), folds)

    def determinant(places):
        columns = []
        for moved in ((step, 0.0), (0.0, step)):
            ends = [np.empty_like(places) for _ in range(2)]
            distort(lens.numbers, places + moved, ends[0])
            distort(lens.numbers, places - np.array(moved), ends[1])
            columns.append((ends[0] - ends[1]) / (2 * step))
        return columns[0][:, 0] * columns[1][:, 1] - columns[0][:, 1] * columns[1][:, 0]

    for way, fold in zip(ways, folds, strict=True):
        inside = np.linspace(0.0, 0.999, 400)[:, None] * min(fold, 5.0) * way
        assert (determinant(inside) > 0.0).all()
        if fold < 5.0:
            assert abs(determinant(fold * way[None])[0]) < 1e-3 or determinant(1.0001 * fold * way[None])[0] < 0.0


def test_a_crop_has_the_rays_of_its_pixels_to_the_bit():
    camera = camera_with([-0.3, 0.1, 0.001, 0.002])
    part = camera.crop(50, 20, 64, 32)
    np.testing.assert_array_equal(part.rays_world()[1], camera.rays_world()[1][20:52, 50:114])
    np.testing.assert_allclose(part.project([(0, 0, 3)]), camera.project([(0, 0, 3)]) - (50, 20), atol=1e-12)


def test_without_coefficients_or_with_zeros_there_is_no_lens_and_undistorted_is_that_camera():
    for none in (None, np.zeros(5), np.zeros((1, 8))):
        camera = camera_with(none)
        assert isinstance(camera, atra.CalibratedCamera)
        assert camera_with([-0.3, 0.1, 0, 0]).undistorted() == camera
    points = camera.eye + np.array([[0.1, 0.2, 1.0], [0.0, 0.0, -1.0]]) @ camera.axes
    (there, behind) = camera.project(points)
    assert there == pytest.approx([K[0, 2] + 0.5 + 12.5, K[1, 2] + 0.5 + 24.0])
    assert np.isnan(behind).all()


@pytest.mark.parametrize(("given", "said"), [
    (([0.1, 0.2, 0.3],), r"shape \(3,\), expected 4, 5, 8, 12 or 14 coefficients"),
    (([0.1] * 5, "fisheye"), r"shape \(5,\), expected 4 coefficients"),
    (([[0.1, 0.2], [0.3, 0.4]],), r"shape \(2, 2\), expected 4"),
    (([0.1, np.nan, 0, 0],), "k2 of the lens is nan, expected a finite number"),
    ((["a", 0, 0, 0],), "distortion cannot be read as numbers"),
    (([0.1] * 4, "omni"), "model is 'omni', expected one of pinhole, fisheye"),
])  # fmt: skip
def test_coefficients_that_no_model_has_are_refused_with_what_is_expected(given, said):
    with pytest.raises(atra.InputError, match=said):
        camera_with(*given)


def test_other_bad_values_are_refused():
    with pytest.raises(atra.InputError, match="omega of the lens is 4, expected radians"):
        atra.FovLens(4.0)
    with pytest.raises(atra.InputError, match=r"lens is 'wide', expected atra\.Lens"):
        atra.LensCamera((0, 0, 0), (0, 0, 1), lens="wide", sensor=None, up=(0, 1, 0), width=4, height=4)
