"""The camera's axes, its pixel rays, and what it refuses."""

from math import radians, tan

import numpy as np
import pytest

from atra.camera import Camera, check_offset
from atra.errors import InputError

TILTED = {"eye": (1.0, 2.0, 5.0), "target": (-0.5, 0.25, -3.0), "up": (0.2, 1.0, 0.1)}


def test_axes_are_orthonormal_and_right_handed():
    axes = Camera(**TILTED).axes
    assert np.allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.allclose(np.cross(axes[0], axes[1]), axes[2], atol=1e-15)


def test_x_is_right_y_is_down_and_z_is_forward():
    axes = Camera(eye=(0, 0, 0), target=(0, 0, -7), up=(0, 3, 0)).axes
    assert np.allclose(axes, [[1, 0, 0], [0, -1, 0], [0, 0, -1]])


def test_down_points_away_from_up():
    camera = Camera(**TILTED)
    assert camera.axes[1] @ np.array(TILTED["up"]) < 0
    assert abs(camera.axes[0] @ np.array(TILTED["up"])) < 1e-15


def test_the_ray_of_the_centre_pixel_runs_through_the_target():
    camera = Camera(**TILTED, width=9, height=5)
    direction = camera.directions(np.array(4), np.array(2))
    target = camera.to_camera_space(np.array([TILTED["target"]]))[0]
    assert np.allclose(direction, target / target[2], atol=1e-15)
    assert target[2] == pytest.approx(np.linalg.norm(np.subtract(TILTED["target"], TILTED["eye"])))


def test_directions_have_unit_z_and_span_the_field_of_view():
    camera = Camera(**TILTED, fov_y_degrees=50.0, width=6, height=4)
    y, x = np.mgrid[0:4, 0:6]
    directions = camera.directions(x, y)
    assert directions.shape == (4, 6, 3)
    assert directions.dtype == np.float64
    assert (directions[..., 2] == 1.0).all()
    top = camera.directions(np.array(0), np.array(0), (0.0, 0.0))
    half = tan(radians(25.0))
    assert np.allclose(top, [-half * 6 / 4, -half, 1.0])
    assert np.allclose(np.diff(directions[..., 0], axis=1), 2 * half / 4)
    assert np.allclose(np.diff(directions[..., 1], axis=0), 2 * half / 4)


def test_offset_moves_the_ray_inside_its_pixel():
    camera = Camera(**TILTED, width=8, height=8)
    moved = camera.directions(np.array(3), np.array(3), (0.75, 0.25)) - camera.directions(np.array(3), np.array(3))
    assert np.allclose(moved, [0.25 * camera.pixel_pitch, -0.25 * camera.pixel_pitch, 0.0])


def test_camera_space_keeps_small_detail_far_from_the_origin():
    camera = Camera(eye=(1e6, 0, 0), target=(1e6, 0, -1))
    assert camera.to_camera_space(np.array([[1e6 + 2**-10, 0, -2.0]])).tolist() == [[2**-10, 0.0, 2.0]]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "width is 0"),
        ({"height": -3}, "height is -3"),
        ({"width": 2.5}, "width is 2.5"),
        ({"width": True}, "width is True"),
        ({"fov_y_degrees": 0.0}, "fov_y_degrees is 0.0"),
        ({"fov_y_degrees": 180.0}, "fov_y_degrees is 180.0"),
        ({"fov_y_degrees": float("nan")}, "fov_y_degrees is nan"),
        ({"eye": (1, 2)}, r"eye is \(1, 2\)"),
        ({"target": "abc"}, "target is 'abc'"),
        ({"up": None}, "up is None"),
        ({"eye": (0, float("inf"), 0)}, r"eye is \(0.0, inf, 0.0\)"),
        ({"target": TILTED["eye"]}, r"eye and target are both \(1.0, 2.0, 5.0\)"),
        ({"up": (0, 0, 0)}, r"up is \(0.0, 0.0, 0.0\)"),
        ({"up": (1.5, 1.75, 8.0)}, r"up \(1.5, 1.75, 8.0\) is parallel"),
    ],
)
def test_a_bad_camera_is_refused_with_the_value(change, message):
    with pytest.raises(InputError, match=message):
        Camera(**{**TILTED, **change})


@pytest.mark.parametrize("offset", [(1.0, 0.5), (-0.1, 0.5), (0.5, float("nan")), (0.5,)])
def test_an_offset_outside_the_pixel_is_refused_with_the_value(offset):
    with pytest.raises(InputError, match="offset is"):
        check_offset(offset)
    with pytest.raises(InputError, match="offset is"):
        Camera(**TILTED).directions(np.array(0), np.array(0), offset)
