"""Scenes with more triangles: subdivided, and copied side by side."""

import numpy as np
import pytest

import atra
from atra.errors import InputError, MemoryBudgetError
from experiments.harness.points import plan_points
from experiments.workloads.rounds import load_mesh
from scenes.built_in import make_scene
from scenes.loading import enlarged
from scenes.scene import Scene
from tests.points import configured

pytestmark = pytest.mark.uncovered


def area(mesh):
    a, b, c = np.moveaxis(mesh.triangles(np.arange(mesh.triangle_count)), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def test_a_subdivided_triangle_becomes_four_of_a_quarter_of_its_area_in_its_place():
    scene = make_scene("cornell_box")
    cut = enlarged(scene, 2, 1)
    assert cut.mesh.triangle_count == 16 * scene.mesh.triangle_count
    quarters = area(cut.mesh).reshape(-1, 16)
    np.testing.assert_allclose(quarters.sum(axis=1), area(scene.mesh), rtol=1e-4)
    np.testing.assert_allclose(quarters, np.repeat(area(scene.mesh)[:, None] / 16, 16, axis=1), rtol=1e-2)
    assert (cut.camera, cut.name) == (scene.camera, scene.name)


def test_neighbours_share_the_vertices_in_the_middle_of_their_edges():
    faces = np.array([(0, 1, 2), (2, 1, 3)], np.uint32)
    mesh = atra.Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.3)], np.float32), faces)
    assert len(enlarged(Scene("square", mesh, {}), 1, 1).mesh.vertices) == 4 + 5


@pytest.mark.parametrize("copies", [2, 4, 7])
def test_copies_lie_side_by_side_and_the_first_where_the_scene_is(copies):
    scene = make_scene("cornell_box")
    many = enlarged(scene, 0, copies).mesh
    corners = many.triangles(np.arange(many.triangle_count)).reshape(copies, -1, 3, 3)
    np.testing.assert_array_equal(corners[0], scene.mesh.triangles(np.arange(scene.mesh.triangle_count)))
    boxes = [(one.min(axis=(0, 1)), one.max(axis=(0, 1))) for one in corners]
    for place, (low, high) in enumerate(boxes):
        np.testing.assert_allclose(high - low, np.ptp(scene.mesh.bounds, axis=0), rtol=1e-5)
        assert all((low > other_high).any() or (high < other_low).any() for other_low, other_high in boxes[:place])


@pytest.mark.parametrize(("subdivided", "copies"), [(9, 1), (10**9, 1), (0, 10**9)])
def test_more_triangles_than_can_be_meant_are_refused(subdivided, copies):
    with pytest.raises(InputError, match=f"scene.subdivided={subdivided} and scene.copies={copies} make"):
        enlarged(make_scene("cornell_box"), subdivided, copies)


def configuration(memory_budget_gib=None, **scene):
    return configured("raster", "frame", (16, 16), scene, {"memory_budget_gib": memory_budget_gib})


def test_points_know_their_enlarged_mesh_and_the_worker_loads_it():
    given = [configuration(), configuration(subdivided=1, copies=2), configuration()]
    points = [one.point for one in plan_points(given)]
    assert [one.triangles for one in points] == [1112, 8896, 1112]
    assert points[0] == points[2]
    assert points[0].mesh_sha256 != points[1].mesh_sha256
    assert load_mesh(points[1]).triangle_count == 8896


def test_a_point_whose_baselines_do_not_fit_has_the_reason_as_its_problem():
    few, many = plan_points([configuration(1e-3), configuration(1e-3, subdivided=3)])
    assert few.problem is None
    assert isinstance(many.problem, MemoryBudgetError)
    assert "baselines of 71,168 triangles and 256 pixels each need about" in str(many.problem)
