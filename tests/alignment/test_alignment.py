"""The shear of each cell, and where its reference rays lie."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.alignment.alignment import REFERENCES
from atra.alignment.copies import instance_transforms
from tests.images import assert_equal_images, trace, trace_pixels
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera


@pytest.mark.parametrize("options", [{}, {"culling": False}, {"culling": False, "geometry": "instanced"}], ids=str)
def test_the_papers_reference_gives_the_same_image(options):
    mesh, camera = cornell_box(), cornell_camera(64, 48)
    single = trace_pixels(mesh, camera)
    for split in ((8, 1), (4, 3)):
        assert_equal_images(
            mesh, camera, trace("aligned", mesh, camera, split, reference="first_cell", **options), single
        )


def test_the_papers_reference_leaves_the_first_cell_unsheared():
    camera = atra.Camera(**EYE_AT_ORIGIN, width=15, height=9)
    alignment = atra.Alignment.of_cells(camera, atra.Split(5, 3, 15, 9), "first_cell")
    assert alignment.corner_pixels == (-7.5, -4.5)
    assert [shifts[0] for shifts in alignment.shifts] == [0.0, 0.0]


@pytest.mark.parametrize("view", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0)])
@pytest.mark.parametrize("turn", [(0.2, 0.1), (-0.2, 0.1), (0.1, -0.2), (-0.1, -0.1)])
@pytest.mark.parametrize("counts", [(1, 1), (3, 1), (1, 3), (25, 17)])
def test_reference_rays_lie_a_quarter_from_the_centre_away_from_the_world_axis_on_axes_that_are_split(
    view, turn, counts
):
    side = np.cross(view, (0, 1, 0))
    target = np.array(view) + turn[0] * side + np.array((0, turn[1], 0))
    camera = atra.Camera((0, 0, 0), target, fov_y_degrees=60, width=75, height=51)
    alignment = atra.Alignment.of_cells(camera, atra.Split(*counts, 75, 51))
    x, y, z = camera.to_camera_space(np.array([view], float))[0]  # where the axis is in the image
    left, top = alignment.corner_pixels
    assert left == (-37.5 if counts[0] == 1 else -18.75 * np.sign(x / z))
    assert top == (-25.5 if counts[1] == 1 else -12.75 * np.sign(y / z))


@pytest.mark.parametrize(("counts", "message"), [
    ((7, 4), r"split \(7, 4\) does not divide image 1920 x 1080"),
    ((4, 7), r"split \(4, 7\) does not divide image 1920 x 1080"),
    ((0, 1), "number of columns"),
    ((1, -2), "number of rows"),
    ((2.0, 1), "number of columns is 2.0, expected a whole number"),
    (("8", 1), "number of columns is '8', expected a whole number"),
    ((8, None), "number of rows is None, expected a whole number"),
    ((True, 1), "number of columns is True, expected a whole number"),
])  # fmt: skip
def test_a_split_that_does_not_divide_the_image_is_refused_with_both_values(counts, message):
    with pytest.raises(atra.InputError, match=message):
        atra.Split(*counts, width=1920, height=1080)
    for size in (0, -8, 8.0, None):
        with pytest.raises(atra.InputError, match=f"number of pixels in a row is {size}, expected a whole number"):
            atra.Split(1, 1, width=size, height=8)
        with pytest.raises(atra.InputError, match=f"number of pixels in a column is {size}, expected a whole number"):
            atra.Split(1, 1, width=8, height=size)


SIZE = {"width": 12, "height": 10}
TURNED = atra.Camera((0.3, 0.2, -0.4), (1.0, 2.0, 3.0), (0.2, 1.0, 0.1), fov_y_degrees=50, **SIZE)
MOVED = atra.Camera((3.3, -0.2, 1.4), (1.0, 2.5, -3.0), (0.1, 1.0, 0.4), fov_y_degrees=95, **SIZE)
LEFT, RIGHT = (atra.Camera((x, 0, 0), (x, 0.5, 1), fov_y_degrees=70, **SIZE) for x in (0.0, 0.06))
FLAT = atra.OrthographicCamera((0.3, 0.2, -0.4), (1.0, 2.0, 3.0), (0.2, 1.0, 0.1), 7.0, **SIZE)
FLAT_MOVED = atra.OrthographicCamera((5.3, 1.2, 0.4), (1.0, -2.0, 3.0), (0.2, 1.0, 0.1), 2.0, **SIZE)
ALIGNMENTS = {
    "cells": lambda split: atra.Alignment.of_cells(TURNED, split),
    "eyes": lambda split: atra.Alignment.of_eyes(LEFT, RIGHT, split),
    "frames": lambda split: atra.Alignment.of_frames([TURNED, MOVED, LEFT], split),
    "parallel rays": lambda split: atra.Alignment.of_cells(FLAT, split),
    "frames of parallel rays": lambda split: atra.Alignment.of_frames([FLAT, FLAT_MOVED], split),
}


@pytest.mark.parametrize("counts", [(1, 1), (4, 1), (3, 2), (12, 10)])
@pytest.mark.parametrize("place", REFERENCES)
@pytest.mark.parametrize("kind", ALIGNMENTS)
def test_every_cell_s_transform_carries_its_rays_onto_the_reference_rays_and_keeps_their_parameter(kind, place, counts):
    split = atra.Split(*counts, **SIZE)
    alignment = replace(ALIGNMENTS[kind](split), reference=place)
    first, transforms = alignment.camera, alignment.transforms
    assert transforms.shape == (len(alignment.cameras), split.ny, split.nx, 3, 4)
    columns, rows = (grid.ravel() for grid in np.meshgrid(np.arange(split.cell_width), np.arange(split.cell_height)))
    t = np.linspace(0.1, 100, columns.size)[:, None]
    at = [(corner + pixels + offset) * pitch for corner, pixels, offset, pitch in zip(
        alignment.corner_pixels, (columns, rows), (0.3, 0.8), (first.plane.pitch_x, first.plane.pitch_y), strict=True
    )]  # fmt: skip
    reference = np.stack([*(at if first.is_parallel else np.stack(at) * t[:, 0]), t[:, 0]], axis=1)
    for image, j, i in np.ndindex(transforms.shape[:3]):
        camera, transform = alignment.cameras[image], transforms[image, j, i]
        x, y = columns + i * split.cell_width, rows + j * split.cell_height
        origins, directions = camera.rays(x, y, (0.3, 0.8))
        points = (origins + t * directions) @ camera.axes + camera.eye - first.eye
        carried = points @ transform[:, :3].T + transform[:, 3]
        np.testing.assert_allclose(carried @ first.axes.T, reference, rtol=0, atol=1e-10)


def test_the_transform_of_an_instance_is_the_shear_of_its_cell():
    split = atra.Split(4, 2, **SIZE)
    alignment = atra.Alignment.of_cells(TURNED, split)
    points = np.random.default_rng(0).normal(size=(5, 3))
    transforms = instance_transforms(alignment)
    assert (transforms[:, :, 3] == 0.0).all()
    for j, i in np.ndindex(2, 4):
        sheared = (points @ TURNED.axes) @ transforms[4 * j + i, :, :3].T
        shift = np.array([alignment.shifts[0][i], alignment.shifts[1][j], 0.0])
        np.testing.assert_allclose(sheared @ TURNED.axes.T, points - shift * points[:, 2:], atol=1e-5)
