"""Cameras that frame a mesh, and those around it."""

import numpy as np
import pytest

import atra
from tests.images import draw
from tests.meshes import cornell_box, quads, random_triangles


@pytest.mark.parametrize("seed", range(4))
def test_a_framing_camera_sees_every_vertex_and_no_camera_much_nearer_does(seed):
    random = np.random.default_rng(seed)
    mesh = random_triangles(30, seed, size=float(10.0 ** random.integers(-3, 4)))
    fov, width, height = random.uniform(10, 120), int(random.integers(20, 400)), int(random.integers(20, 400))
    camera = atra.Camera.framing(
        mesh, random.normal(size=3), up=(0.1, 1, 0.2), fov_y_degrees=fov, width=width, height=height
    )
    seen = camera.project(mesh.vertices)
    assert ((seen > 0) & (seen < (width, height))).all()
    corners = np.array([[mesh.bounds[i][0], mesh.bounds[j][1], mesh.bounds[k][2]] for i, j, k in np.ndindex(2, 2, 2)])
    share = np.abs(camera.project(corners) / (width, height) - 0.5).max()
    assert 0.2 < share <= 0.45 + 1e-6


def test_a_flat_mesh_and_a_direction_along_up_are_framed_or_refused():
    flat = quads([[(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]])
    assert draw(flat, atra.Camera.framing(flat, (0, 0, -1), width=32, height=32)).hit.mean() > 0.6
    with pytest.raises(atra.InputError, match=r"up .* is parallel to the view direction"):
        atra.Camera.framing(flat, (0, -1, 0))
    with pytest.raises(atra.InputError, match="fov_y_degrees is 180"):
        atra.Camera.framing(flat, fov_y_degrees=180)


def test_whatever_makes_a_camera_it_has_the_same_field_of_view():
    mesh = cornell_box()
    made = [atra.Camera((0, 0, 3), (0, 0, 0)), atra.Camera.framing(mesh), *atra.orbit(mesh, views=2)]
    assert {camera.fov_y_degrees for camera in made} == {60.0}


def test_cameras_of_an_orbit_are_evenly_around_the_mesh_and_see_all_of_it():
    mesh = cornell_box()
    cameras = atra.orbit(mesh, views=7, elevation_degrees=30, width=64, height=48)
    assert len(cameras) == 7
    centre = mesh.bounds.mean(axis=0)
    ways = np.array([one.eye for one in cameras]) - centre
    distances = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(distances, distances[0])
    np.testing.assert_allclose(ways[:, 1] / distances, np.sin(np.radians(30)), rtol=1e-6)
    angles = np.unwrap(np.arctan2(ways[:, 0], ways[:, 2]))
    np.testing.assert_allclose(np.abs(np.diff(angles)), 2 * np.pi / 7, rtol=1e-6)
    for camera in cameras:
        seen = camera.project(mesh.vertices)
        assert ((seen > 0) & (seen < (64, 48))).all()
    for options, said in (({"views": 0}, "views is 0"), ({"elevation_degrees": 90}, "elevation_degrees is 90")):
        with pytest.raises(atra.InputError, match=said):
            atra.orbit(mesh, **options)
