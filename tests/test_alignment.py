"""The shear of each cell, and where its reference rays lie."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import atra
from tests.meshes import EYE_AT_ORIGIN


@pytest.mark.parametrize("place", [atra.Alignment.at_quarter, atra.Alignment.at_first_cell])
@pytest.mark.parametrize("counts", [(1, 1), (5, 1), (1, 3), (3, 9), (15, 9)])
def test_the_shear_maps_each_ray_of_a_cell_onto_a_reference_ray_and_keeps_its_depth(place, counts):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=15, height=9, fov_y_degrees=70)
    split = atra.Split(*counts, width=15, height=9)
    alignment = place(camera, split)
    columns, rows = np.meshgrid(np.arange(split.cell_width), np.arange(split.cell_height))
    reference_x = (alignment.first_x_pixels + columns.ravel() + 0.5) * camera.pixel_pitch
    reference_y = (alignment.first_y_pixels + rows.ravel() + 0.5) * camera.pixel_pitch
    for i in range(split.nx):
        for j in range(split.ny):
            x, y = columns.ravel() + i * split.cell_width, rows.ravel() + j * split.cell_height
            depth = np.linspace(0.1, 100, len(x))
            points = camera.directions(x, y) * depth[:, None]
            sheared = alignment.shear_points(points, i, j)
            np.testing.assert_array_equal(sheared[:, 2], depth)
            np.testing.assert_allclose(sheared[:, 0] / depth, reference_x, atol=1e-14)
            np.testing.assert_allclose(sheared[:, 1] / depth, reference_y, atol=1e-14)


def test_the_papers_reference_leaves_the_first_cell_unsheared():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=15, height=9)
    alignment = atra.Alignment.at_first_cell(camera, atra.Split(5, 3, 15, 9))
    assert (alignment.first_x_pixels, alignment.first_y_pixels) == (-7.5, -4.5)
    assert alignment.shift_x[0] == 0.0
    assert alignment.shift_y[0] == 0.0


@pytest.mark.parametrize("view", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0)])
@pytest.mark.parametrize("turn", [(0.2, 0.1), (-0.2, 0.1), (0.1, -0.2), (-0.1, -0.1)])
@pytest.mark.parametrize("counts", [(1, 1), (3, 1), (1, 3), (25, 17)])
def test_reference_rays_lie_a_quarter_from_the_centre_away_from_the_world_axis_on_axes_that_are_split(
    view, turn, counts
):
    side = np.cross(view, (0, 1, 0))
    target = np.array(view) + turn[0] * side + np.array((0, turn[1], 0))
    camera = atra.Camera((0, 0, 0), target, fov_y_degrees=60, width=75, height=51)
    alignment = atra.Alignment.at_quarter(camera, atra.Split(*counts, 75, 51))
    x, y, z = camera.to_camera_space(np.array([view], float))[0]  # where the axis is in the image
    assert alignment.first_x_pixels == (-37.5 if counts[0] == 1 else -18.75 * np.sign(x / z))
    assert alignment.first_y_pixels == (-25.5 if counts[1] == 1 else -12.75 * np.sign(y / z))


@pytest.mark.parametrize(("counts", "width", "height"), [((25, 17), 75, 51), ((2, 2), 74, 50)])
def test_reference_rays_lie_left_and_above_where_the_world_axis_is_the_view(counts, width, height):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=width, height=height)
    alignment = atra.Alignment.at_quarter(camera, atra.Split(*counts, width, height))
    assert (alignment.first_x_pixels, alignment.first_y_pixels) == (-width / 4, -height / 4)


def test_splits_and_alignments_cannot_be_changed_under_a_plan():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=15, height=9)
    alignment = atra.Alignment.at_first_cell(camera, atra.Split(5, 3, 15, 9))
    for value, name in ((alignment, "shift_x"), (alignment.split, "nx")):
        with pytest.raises(FrozenInstanceError):
            setattr(value, name, 1)


@pytest.mark.parametrize(("counts", "message"), [
    ((7, 4), r"split \(7, 4\) does not divide image 1920 x 1080"),
    ((0, 1), "number of columns"),
    ((1, -2), "number of rows"),
    ((2.0, 1), "number of columns"),
])  # fmt: skip
def test_a_split_that_does_not_divide_the_image_is_refused_with_both_values(counts, message):
    with pytest.raises(atra.InputError, match=message):
        atra.Split(*counts, width=1920, height=1080)
