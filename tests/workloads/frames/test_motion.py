"""The frames of a point: eyes side by side, a walk, a turning mesh."""

import numpy as np
import pytest

from atra.alignment.alignment import Alignment
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.split import Split
from experiments.workloads.multiframe.motion import (
    EYE_DISTANCE,
    MESH_TURN_DEGREES,
    STEP,
    STEP_TURN_DEGREES,
    STEP_ZOOM,
    frames_of,
)
from tests.meshes import cornell_box, cornell_camera

CAMERA = cornell_camera(width=48, height=32)
MESH = cornell_box()
DIAGONAL = float(np.linalg.norm(MESH.bounds[1] - MESH.bounds[0]))
SPLIT = Split(4, 1, 48, 32)


def test_the_eyes_stand_side_by_side_around_the_view_and_look_the_same_way():
    (left, right), meshes = frames_of(CAMERA, MESH, 2, "eyes")
    assert meshes == (MESH, MESH)
    apart = np.subtract(right.eye, left.eye)
    np.testing.assert_allclose(apart, CAMERA.axes[0] * DIAGONAL * EYE_DISTANCE, atol=1e-12)
    np.testing.assert_allclose(np.add(right.eye, left.eye) / 2, CAMERA.eye, atol=1e-12)
    Alignment.of_eyes(left, right, SPLIT)  # refuses eyes that are not parallel


def test_a_walk_starts_at_the_view_and_steps_turns_and_zooms_with_every_frame():
    cameras, meshes = frames_of(CAMERA, MESH, 3, "walk")
    assert cameras[0] == CAMERA
    assert meshes == (MESH,) * 3
    for frame, camera in enumerate(cameras):
        moved = np.subtract(camera.eye, CAMERA.eye)
        np.testing.assert_allclose(moved, frame * STEP * DIAGONAL * CAMERA.axes[2], atol=1e-12)
        turned = np.degrees(np.arccos(np.clip(camera.axes[2] @ CAMERA.axes[2], -1, 1)))
        assert turned == pytest.approx(frame * STEP_TURN_DEGREES, abs=1e-5)
        assert camera.fov_y_degrees == pytest.approx(CAMERA.fov_y_degrees * STEP_ZOOM**frame)
    assert cameras[1].axes[2] @ CAMERA.axes[0] < 0  # to its left


def test_a_turning_mesh_has_vertices_of_its_own_every_frame_and_keeps_its_shape_and_triangles():
    cameras, meshes = frames_of(CAMERA, MESH, 3, "turn")
    assert cameras == (CAMERA,) * 3
    assert meshes[0] is MESH
    axis = np.array(CAMERA.target)
    for frame, mesh in enumerate(meshes):
        np.testing.assert_array_equal(mesh.faces, MESH.faces)
        before, after = MESH.vertices - axis, mesh.vertices - axis
        np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-6)  # the camera's up is y
        angle = np.radians(frame * MESH_TURN_DEGREES)
        # Counter-clockwise from above turns z towards x.
        expected = before[:, 2] * np.sin(angle) + before[:, 0] * np.cos(angle)
        np.testing.assert_allclose(after[:, 0], expected, atol=1e-6)
    assert np.abs(meshes[2].vertices - MESH.vertices).max() > 0.01


def test_a_view_that_widens_to_half_a_circle_is_refused():
    wide = Camera(CAMERA.eye, CAMERA.target, fov_y_degrees=179.5)
    with pytest.raises(InputError, match="fov_y_degrees is 18"):
        frames_of(wide, MESH, 3, "walk")
