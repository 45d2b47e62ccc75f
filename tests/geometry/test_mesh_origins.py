"""Origins of meshes: who gets one, what it loses, and what mesh and cameras say in world space."""

from __future__ import annotations

import copy
import pickle
import warnings
from fractions import Fraction

import numpy as np
import pytest

import atra
from atra.geometry.mesh import unit_normals
from atra.geometry.ray_space import own_space

UTM = np.array([512345.67, 4598765.43, 120.25])
FACE = np.array([[0, 1, 2]])


def triangle(at=(0.0, 0.0, 0.0), size=1.0):
    return size * np.array([[-0.5, -0.5, 0.1], [0.5, -0.4, 0.0], [0.0, 0.5, 0.3]]) + at


def grid(size, step, at=(0.0, 0.0, 0.0)):
    """A row of small triangles, `step` wide, spread over `size`."""
    corners = np.linspace(0.0, size - step, 500)[:, None, None] * [1.0, 1.0, 0.0] + step * np.eye(3)
    return corners.reshape(-1, 3) + at, np.arange(1500).reshape(-1, 3)


@pytest.mark.parametrize("height", [0.1, 0.6, 2.0, -2.1, 120.25])
def test_an_origin_is_subtracted_without_rounding_and_vertices_stay_as_precise_as_near_the_worlds(height):
    low = np.array([512345.67, 4598765.43, height])
    given = low + np.concatenate([np.eye(3), np.zeros((1, 3))])
    mesh = atra.Mesh(given, FACE)
    assert mesh.has_origin
    assert (mesh.local_vertices.dtype, mesh.vertices.dtype) == (np.float32, np.float64)
    assert np.abs(mesh.vertices - given).max() <= 2.0**-23
    points = low + np.random.default_rng(1).random((200, 3))
    exact = [[Fraction(a) - Fraction(b) for a, b in zip(row, mesh.origin, strict=True)] for row in points.tolist()]
    moved = [[Fraction(x) for x in row] for row in (points - mesh.origin).tolist()]
    assert moved == exact


@pytest.mark.parametrize("vertices", [
    triangle(UTM).astype(np.float32), np.round(triangle(size=100.0)).astype(np.int32), triangle(), triangle((0.4,) * 3),
], ids=["float32 far away", "whole numbers", "float64 around the origin", "float64 beside the origin"])  # fmt: skip
def test_a_mesh_that_float32_holds_keeps_its_vertices_in_the_world(vertices):
    mesh = atra.Mesh(vertices, FACE)
    assert not mesh.has_origin
    assert mesh.vertices is mesh.local_vertices
    assert mesh.vertices.dtype == np.float32
    assert mesh.local is mesh
    np.testing.assert_array_equal(mesh.origin, np.zeros(3))
    np.testing.assert_array_equal(mesh.vertices, vertices.astype(np.float32))


@pytest.mark.parametrize(("away", "has_origin"), [(1.0, False), (10.0, True)])
def test_the_movement_of_vertices_decides_about_an_origin(away, has_origin):
    given = triangle((away,) * 3)
    moved = np.abs(given.astype(np.float32) - given).max() / np.ptp(given, axis=0).max()
    assert (moved > 1e-7) == has_origin
    assert atra.Mesh(given, FACE).has_origin == has_origin


def test_vertices_that_no_face_uses_decide_nothing():
    given = np.vstack([triangle(), triangle(UTM)])
    assert not atra.Mesh(given, FACE).has_origin
    assert atra.Mesh(given, FACE + 3).has_origin


def test_a_mesh_with_an_origin_says_everything_in_world_space():
    near, far = (
        atra.Mesh(triangle().astype(np.float32), FACE),
        atra.Mesh(triangle().astype(np.float32) + np.full(3, 2.0**22), FACE),
    )
    assert far.has_origin
    np.testing.assert_array_equal(far.bounds, near.bounds + 2.0**22)
    np.testing.assert_array_equal(far.triangles(np.array([0])), near.triangles(np.array([0])) + 2.0**22)
    np.testing.assert_array_equal(unit_normals(far, np.array([0])), unit_normals(near, np.array([0])))
    np.testing.assert_array_equal(far.traced_faces, near.traced_faces)
    np.testing.assert_array_equal(far.local.vertices, near.vertices)
    assert not far.local.has_origin
    assert not far.vertices.flags.writeable


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda mesh: pickle.loads(pickle.dumps(mesh))], ids=["copy", "deep", "pickle"]
)
def test_copies_keep_the_origin(copied):
    mesh = atra.Mesh(triangle(UTM), FACE, "far")
    _ = mesh.vertices, mesh.local, mesh.bounds
    other = copied(mesh)
    for name in ("origin", "local_vertices", "vertices", "faces", "bounds"):
        np.testing.assert_array_equal(getattr(other, name), getattr(mesh, name))
        assert name == "bounds" or not getattr(other, name).flags.writeable
    assert other.has_origin
    assert other.name == "far"


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), UTM], ids=["near", "far"])
def test_a_kilometre_in_steps_of_a_tenth_of_a_millimetre_is_warned_of(at):
    vertices, faces = grid(1000.0, 1e-4, at)
    with pytest.warns(UserWarning, match=r"mesh 'mesh' spans 1000 .*in steps of 6.1e-05.* by more than 5%; cut it"):
        mesh = atra.Mesh(vertices, faces)
    assert np.abs(mesh.vertices - vertices).max() < 6.2e-5


def test_terrains_scans_and_halls_are_not_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for size, step in ((10_000.0, 1.0), (0.2, 1e-4), (100.0, 0.005)):
            for at in ((0.0, 0.0, 0.0), UTM):
                atra.Mesh(*grid(size, step, at))


PLACE = tuple(UTM + (1.0, 2.0, 3.0)), tuple(UTM)


@pytest.mark.parametrize("camera", [
    atra.Camera(*PLACE, width=8, height=8), atra.OrthographicCamera(*PLACE, width=8, height=8),
    atra.LensCamera.panorama(*PLACE, width=8), atra.Camera(*PLACE, width=8, height=8).crop(2, 2, 4, 4),
], ids=["pinhole", "orthographic", "panorama", "calibrated"])  # fmt: skip
def test_a_camera_in_the_mesh_s_own_space_has_the_same_rays(camera):
    mesh = atra.Mesh(triangle(UTM), FACE)
    own_mesh, own = own_space(mesh, camera)
    assert own_mesh is mesh.local
    assert type(own) is type(camera)
    np.testing.assert_array_equal(own.axes, camera.axes)
    exact = [float(Fraction(a) - Fraction(b)) for a, b in zip(camera.eye, mesh.origin.tolist(), strict=True)]
    assert own.eye == tuple(exact)
    x, y = np.arange(4), np.arange(4)
    for part, other in zip(own.rays(x, y), camera.rays(x, y), strict=True):
        np.testing.assert_array_equal(part, other)


def test_an_eye_too_far_to_resolve_the_mesh_is_refused():
    mesh = atra.Mesh(triangle(UTM, 0.01).astype(np.float64), FACE)
    camera = atra.Camera((1e11, 0.0, 0.0), tuple(UTM), fov_y_degrees=1e-9, width=8, height=8)
    with pytest.raises(atra.InputError, match="float64 cannot resolve it from there; move the eye closer"):
        atra.RasterTracer(mesh, camera)
