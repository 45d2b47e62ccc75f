import numpy as np
import pytest

import atra
from tests.meshes import EYE_AT_ORIGIN


@pytest.mark.parametrize("place", [atra.Alignment.at_quarter, atra.Alignment.at_first_cell])
@pytest.mark.parametrize("counts", [(1, 1), (4, 1), (1, 5), (3, 2), (12, 10)])
def test_the_shear_maps_each_ray_of_a_cell_onto_a_reference_ray_and_keeps_its_depth(place, counts):
    camera = atra.Camera(**EYE_AT_ORIGIN, width=12, height=10, fov_y_degrees=70)
    split = atra.Split(*counts, width=12, height=10)
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
    camera = atra.Camera(**EYE_AT_ORIGIN, width=12, height=10)
    alignment = atra.Alignment.at_first_cell(camera, atra.Split(4, 2, 12, 10))
    assert alignment.shift_x[0] == 0.0
    assert alignment.shift_y[0] == 0.0


@pytest.mark.parametrize(("turn", "sign"), [(10, 1), (-10, -1)])
def test_reference_rays_lie_a_quarter_from_the_centre_away_from_the_world_axis(turn, sign):
    # Turned to the right (towards +x) from -z: the axis -z is then left of the centre.
    camera = atra.Camera((0, 0, 0), (np.tan(np.radians(turn)), 0, -1), fov_y_degrees=60, width=120, height=100)
    alignment = atra.Alignment.at_quarter(camera, atra.Split(10, 1, 120, 100))
    assert alignment.first_x_pixels == sign * 30
    assert alignment.first_y_pixels == -50


@pytest.mark.parametrize(("counts", "message"), [
    ((7, 4), r"split \(7, 4\) does not divide image 1920 x 1080"),
    ((0, 1), "number of columns"),
    ((1, -2), "number of rows"),
    ((2.0, 1), "number of columns"),
])  # fmt: skip
def test_a_split_that_does_not_divide_the_image_is_refused_with_both_values(counts, message):
    with pytest.raises(atra.InputError, match=message):
        atra.Split(*counts, width=1920, height=1080)
