"""All hits of every method are those that float64 finds by volumes, triangle by triangle."""

import numpy as np
import pytest

import atra
from atra.exact.intersection import divided, triangles_in_camera_space, volumes_of
from tests.all_hits.test_gathering import METHODS, gathered
from tests.closed_meshes import cornell_boxes, sphere, view_of
from tests.meshes import EYE_AT_ORIGIN, random_triangles

CAMERA = atra.Camera(**EYE_AT_ORIGIN, width=48, height=32, fov_y_degrees=90)
PARALLEL = atra.OrthographicCamera((0.3, 0.2, -0.4), (1, 2, 3), view_height=5.0, width=48, height=32)


def by_volumes(mesh, camera):
    """(F, H W) depths of the crossings of each triangle, NaN = none; whether the ray leaves there; and whether float64
    can decide every triangle along a ray."""
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(x, y)
    depths, leaving, is_sure = [], [], np.ones(len(x), bool)
    for corner, *edges in zip(*triangles_in_camera_space(mesh, camera, np.arange(mesh.triangle_count)), strict=True):
        found = divided(volumes_of(origins, directions, corner, *edges, camera.eye))
        is_sure &= (np.abs(found.edge_distance) > 1e-9) & ~(np.abs(found.depth) < 1e-9)
        depths.append(np.where((found.edge_distance > 0.0) & (found.depth > 0.0), found.depth, np.nan))
        leaving.append(directions @ np.cross(*edges) > 0.0)
    return np.array(depths), np.array(leaving), is_sure


each_method = pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)


@each_method
@pytest.mark.parametrize("camera", [CAMERA, PARALLEL], ids=["pinhole", "parallel"])
def test_counts_and_layers_are_what_float64_finds_by_volumes(camera, method):
    mesh = random_triangles(120, 3)
    depths, _, is_sure = by_volumes(mesh, camera)
    assert is_sure.mean() > 0.9
    counts = (~np.isnan(depths)).sum(axis=0)
    nearest = np.sort(np.where(np.isnan(depths), np.inf, depths), axis=0)[:4]
    layers = gathered(method, mesh, camera, atra.Layers(4))
    for found in (gathered(method, mesh, camera, atra.Count()), layers):
        np.testing.assert_array_equal(found.count.ravel()[is_sure], counts[is_sure])
    np.testing.assert_allclose(layers.depth.reshape(4, -1)[:, is_sure], nearest[:, is_sure], rtol=1e-4)


@each_method
@pytest.mark.parametrize("mesh", [sphere(), cornell_boxes()], ids=["sphere", "boxes"])
def test_thickness_is_what_float64_finds_by_volumes(mesh, method):
    camera = view_of(mesh, 0)
    depths, leaving, is_sure = by_volumes(mesh, camera)
    expected = np.nansum(np.where(leaving, depths, -depths), axis=0)
    found = gathered(method, mesh, camera, atra.Thickness()).thickness.ravel()
    assert expected.max() > 0.1
    np.testing.assert_allclose(found[is_sure], expected[is_sure], atol=1e-4)
