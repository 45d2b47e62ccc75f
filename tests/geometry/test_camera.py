"""The cameras' axes, their pixel rays, and what they refuse."""

from math import radians, tan

import numpy as np
import pytest

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.view import check_offset

TILTED = {"eye": (1.0, 2.0, 5.0), "target": (-0.5, 0.25, -3.0), "up": (0.2, 1.0, 0.1)}


CAMERAS = [
    Camera(**TILTED, fov_y_degrees=50.0, width=12, height=8),
    OrthographicCamera(**TILTED, view_height=3.0, width=12, height=8),
    Camera.from_opencv([[40, 0, 3], [0, 25, 9], [0, 0, 1]], np.eye(3), (1, 2, -3), 12, 8),
]


def test_axes_are_orthonormal_and_right_handed_and_down_points_away_from_up():
    axes, up = Camera(**TILTED).axes, np.array(TILTED["up"])
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-15)
    assert axes[1] @ up < 0
    assert abs(axes[0] @ up) < 1e-15
    axes = Camera(eye=(0, 0, 0), target=(0, 0, -7), up=(0, 3, 0)).axes
    assert np.allclose(axes, [[1, 0, 0], [0, -1, 0], [0, 0, -1]])


def test_the_ray_of_the_centre_pixel_runs_through_the_target_and_camera_space_keeps_detail_far_away():
    camera = Camera(**TILTED, width=9, height=5)
    direction = camera.rays(np.array(4), np.array(2))[1]
    target = camera.to_camera_space(np.array([TILTED["target"]]))[0]
    assert np.allclose(direction, target / target[2], atol=1e-15)
    assert target[2] == pytest.approx(np.linalg.norm(np.subtract(TILTED["target"], TILTED["eye"])))
    far = Camera(eye=(1e6, 0, 0), target=(1e6, 0, -1))
    assert far.to_camera_space(np.array([[1e6 + 2**-10, 0, -2.0]])).tolist() == [[2**-10, 0.0, 2.0]]


def test_directions_have_unit_z_and_span_the_field_of_view():
    camera = Camera(**TILTED, fov_y_degrees=50.0, width=6, height=4)
    y, x = np.mgrid[0:4, 0:6]
    directions = camera.rays(x, y)[1]
    assert directions.shape == (4, 6, 3)
    assert directions.dtype == np.float64
    assert (directions[..., 2] == 1.0).all()
    top = camera.rays(np.array(0), np.array(0), (0.0, 0.0))[1]
    half = tan(radians(25.0))
    assert np.allclose(top, [-half * 6 / 4, -half, 1.0])
    assert np.allclose(np.diff(directions[..., 0], axis=1), 2 * half / 4)
    assert np.allclose(np.diff(directions[..., 1], axis=0), 2 * half / 4)


def test_the_positional_order_equality_and_repr_of_a_camera():
    camera = Camera((1, 2, 5), (0, 0, 0), (0, 1, 0), 50, 12, 8)
    assert camera == Camera(eye=(1, 2, 5), target=(0, 0, 0), up=(0, 1, 0), fov_y_degrees=50, width=12, height=8)
    assert hash(camera) == hash(Camera((1, 2, 5), (0, 0, 0), (0, 1, 0), 50, 12, 8))
    assert camera != Camera((1, 2, 5), (0, 0, 0), (0, 1, 0), 51, 12, 8)
    assert repr(camera) == (
        "Camera(eye=(1.0, 2.0, 5.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), "
        "fov_y_degrees=50.0, width=12, height=8)"
    )


def test_pinhole_rays_share_their_origin_and_parallel_rays_their_direction():
    y, x = np.mgrid[0:8, 0:12]
    pinhole, parallel, _ = CAMERAS
    origins, directions = pinhole.rays(x, y, (0.25, 0.5))
    assert (origins == 0.0).all()
    assert np.array_equal(directions, pinhole.rays(x, y, (0.25, 0.5))[1])
    assert not pinhole.is_parallel
    origins, directions = parallel.rays(x, y, (0.25, 0.5))
    assert origins.shape == directions.shape == (8, 12, 3)
    assert (directions == (0.0, 0.0, 1.0)).all()
    assert np.allclose(origins[0, 0], ((0.25 - 6) * 3 / 8, (0.5 - 4) * 3 / 8, 0.0), atol=1e-15)
    assert np.allclose(origins[-1, -1], ((11.25 - 6) * 3 / 8, (7.5 - 4) * 3 / 8, 0.0), atol=1e-15)
    assert parallel.is_parallel


@pytest.mark.parametrize("camera", CAMERAS)
def test_to_pixels_maps_every_point_of_a_ray_to_its_pixel(camera):
    y, x = np.mgrid[0:8, 0:12]
    origins, directions = camera.rays(x, y, (0.75, 0.25))
    for depth in (0.5, 7.0):
        point_eye = (origins + depth * directions) @ camera.axes
        a, b, c = np.moveaxis(point_eye @ camera.to_pixels[:, :3].T + camera.to_pixels[:, 3], -1, 0)
        assert np.allclose(a / c, x + 0.75, atol=1e-12)
        assert np.allclose(b / c, y + 0.25, atol=1e-12)
        assert np.allclose(c, 1.0 if camera.is_parallel else depth, atol=1e-14)


@pytest.mark.parametrize(("direction", "size", "centre"), [
    ((0, -1, 0), (64, 64), (0, 0, 0)), ((0, 0, 5), (100, 30), (1e6, -3e6, 2e5)), ((-1e-3, 0, 0), (30, 100), (0, 0, 0)),
    ((1, -2, 0.5), (100, 30), (0, 0, 0)), ((1, 1, 1), (64, 64), (1e6, -3e6, 2e5)),
])  # fmt: skip
def test_the_view_of_a_light_covers_the_box_and_no_more(direction, size, centre):
    bounds = np.add([(-1, -2, -0.5), (3, 2, 0.25)], centre)
    camera = OrthographicCamera.of_light(direction, bounds, *size)
    forward = np.divide(direction, np.linalg.norm(direction))
    assert np.allclose(camera.axes[2], forward, atol=1e-9)
    corners = np.array([[bounds[i][0], bounds[j][1], bounds[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    in_camera = camera.to_camera_space(corners)
    assert (in_camera[:, 2] > 0.0).all()
    half = np.array(size) * camera.pixel_pitch / 2
    reach = np.abs(in_camera[:, :2]).max(axis=0) / half
    assert (reach <= 1.0).all()
    assert reach.max() == pytest.approx(1.0, abs=1e-8)
    position = camera.to_eye_space(corners) @ camera.to_pixels[:, :3].T + camera.to_pixels[:, 3]
    assert ((position[:, :2] >= 0.0) & (position[:, :2] <= size)).all()


def test_the_view_of_a_light_takes_the_up_it_is_given_and_boxes_of_any_size():
    camera = OrthographicCamera.of_light((0, -1, 0), [(0, 0, 0), (4, 1, 2)], 40, 20, up=(0, 0, 2))
    assert camera.axes[1] @ (0, 0, 1) == pytest.approx(-1.0)
    assert camera.view_height == pytest.approx(2.0)
    for size in (1e-200, 1e200):
        camera = OrthographicCamera.of_light((0, 0, 1), [(0, 0, 0), (size, size, 0)], 8, 8)
        assert camera.view_height == pytest.approx(size)


@pytest.mark.parametrize(("direction", "bounds", "message"), [
    ((0, 0, 0), [(0, 0, 0), (1, 1, 1)], r"direction is \(0.0, 0.0, 0.0\)"),
    ((0, 1), [(0, 0, 0), (1, 1, 1)], r"direction is \(0, 1\)"),
    ((0, 1, 0), [0, 0, 0, 1, 1, 1], r"bounds has shape \(6,\)"),
    ((0, 1, 0), [(0, 0, 0), (1, -1, 1)], r"bounds is .*-1.0.*lowest corner first"),
    ((0, 1, 0), [(0, 0, 0), (1, np.inf, 1)], "bounds is .*inf.*expected finite numbers"),
    ((0, 1, 0), [(2, 0, 3), (2, 1, 3)], "no extent across the light"),
    ((0, 1, 0), [(2, 0, 3), (2, 0, 3)], "no extent across the light"),
])  # fmt: skip
def test_a_light_or_a_box_without_a_view_is_refused_with_the_value(direction, bounds, message):
    with pytest.raises(InputError, match=message):
        OrthographicCamera.of_light(direction, bounds, 8, 8)


@pytest.mark.parametrize("length", [5e-324, 1e-200, 1e200, 1.7e308])
def test_directions_of_any_length_are_directions(length):
    for view in (Camera, OrthographicCamera):
        assert view((0, 0, 0), (length, 0, 0)).axes[2].tolist() == [1, 0, 0]
        assert view((length, 0, 0), (0, 0, 0)).axes[2].tolist() == [-1, 0, 0]
        assert view((0, 0, 0), (0, 0, 1), (0, length, 0)).axes[1].tolist() == [0, -1, 0]
    light = OrthographicCamera.of_light((0, 0, length), [(0, 0, 0), (1, 1, 1)], 8, 8)
    assert light.axes[2].tolist() == [0, 0, 1]
    with pytest.raises(InputError, match=r"eye \(-1e\+308, .* and target \(1e\+308, .* too far apart for float64"):
        Camera((-1e308, 0, 0), (1e308, 0, 0))


@pytest.mark.parametrize(("change", "message"), [
    ({"width": 0}, "width is 0"), ({"height": -3}, "height is -3"), ({"width": 2.5}, "width is 2.5"),
    ({"width": True}, "width is True"), ({"fov_y_degrees": 0.0}, "fov_y_degrees is 0.0"),
    ({"fov_y_degrees": 180.0}, "fov_y_degrees is 180.0"), ({"fov_y_degrees": float("nan")}, "fov_y_degrees is nan"),
    ({"fov_y_degrees": "abc"}, "fov_y_degrees is 'abc'"), ({"fov_y_degrees": None}, "fov_y_degrees is None"),
    ({"eye": (0, 10**400, 0)}, r"eye is \(0, 10"), ({"eye": (1, 2)}, r"eye is \(1, 2\)"),
    ({"target": "abc"}, "target is 'abc'"), ({"up": None}, "up is None"),
    ({"eye": (0, float("inf"), 0)}, r"eye is \(0.0, inf, 0.0\)"),
    ({"target": TILTED["eye"]}, r"eye and target are both \(1.0, 2.0, 5.0\)"),
    ({"up": (0, 0, 0)}, r"up is \(0.0, 0.0, 0.0\)"), ({"up": (1.5e200, 1.75e200, 8e200)}, r"up .* is parallel"),
    ({"up": (1.5, 1.75, 8.0)}, r"up \(1.5, 1.75, 8.0\) is parallel"),
])  # fmt: skip
def test_a_bad_camera_is_refused_with_the_value(change, message):
    with pytest.raises(InputError, match=message):
        Camera(**{**TILTED, **change})
    if "fov_y_degrees" not in change:
        with pytest.raises(InputError, match=message):
            OrthographicCamera(**{**TILTED, **change})
    for height in (0.0, float("inf"), None, 10**400):
        with pytest.raises(InputError, match=f"view_height is {height!r}"):
            OrthographicCamera(**TILTED, view_height=height)


@pytest.mark.parametrize(
    "offset", [(1.0, 0.5), (-0.1, 0.5), (0.5, float("nan")), (0.5,), 0.5, None, "ab", ("0.5", 0.5)]
)
def test_an_offset_outside_the_pixel_is_refused_with_the_value(offset):
    with pytest.raises(InputError, match="offset is"):
        check_offset(offset)
    for camera in CAMERAS:
        with pytest.raises(InputError, match="offset is"):
            camera.rays(np.array(0), np.array(0), offset)
