"""The stand-in for trimesh's ray queries answers as trimesh does, and loses nothing."""

import copy
import pickle

import numpy as np
import pytest
import trimesh
from trimesh.ray.ray_pyembree import RayMeshIntersector as Theirs

from atra.compat.trimesh import RayMeshIntersector

MESHES = {
    "box": trimesh.creation.box(),
    "ball": trimesh.creation.icosphere(subdivisions=3),
    "torus": trimesh.creation.torus(2.0, 0.7),
    "large": trimesh.creation.icosphere(subdivisions=2, radius=1e6),
    "small and far": trimesh.creation.box((1e-3, 2e-3, 1e-3), trimesh.transformations.translation_matrix((3, 0, 1))),
    "two": trimesh.util.concatenate(
        [trimesh.creation.box(), trimesh.creation.icosphere(2).apply_translation((3, 0, 0))]
    ),
}
each_mesh = pytest.mark.parametrize("name", MESHES)


def random_rays(mesh, count=2000):
    random = np.random.default_rng(0)
    middle, size = mesh.bounds.mean(axis=0), mesh.extents.max()
    origins = middle + random.uniform(-2, 2, (count, 3)) * size
    directions = random.normal(size=(count, 3)) * 3.0
    directions[::2] = (middle + random.normal(size=(count, 3)) * 0.2 * size - origins)[::2]
    return origins, directions


def same(mine, theirs, size):
    assert len(mine) == len(theirs)
    for one, other in zip(mine, theirs, strict=True):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert np.abs(one.astype(float) - other.astype(float)).max(initial=0.0) <= (
            1e-9 * size if one.dtype == np.float64 else 0
        )


@each_mesh
@pytest.mark.parametrize("scale_to_box", [True, False])
def test_answers_have_trimeshs_values_shapes_dtypes_and_order(name, scale_to_box):
    mesh = MESHES[name].copy()
    rays, size = random_rays(mesh), np.abs(mesh.bounds).max()
    mine, theirs = RayMeshIntersector(mesh, scale_to_box=scale_to_box), Theirs(mesh)
    for multiple_hits in (True, False):
        same(mine.intersects_location(*rays, multiple_hits), theirs.intersects_location(*rays, multiple_hits), size)
        given = {"multiple_hits": multiple_hits}
        same(mine.intersects_id(*rays, **given), theirs.intersects_id(*rays, **given), size)
        given["return_locations"] = True
        same(mine.intersects_id(*rays, **given), theirs.intersects_id(*rays, **given), size)
    same([mine.intersects_first(*rays)], [theirs.intersects_first(*rays)], size)
    same([mine.intersects_any(*rays)], [theirs.intersects_any(*rays)], size)
    assert 0.1 < mine.intersects_any(*rays).mean() < 0.9
    same(mine.intersects_id(*rays, max_hits=1), mine.intersects_id(*rays, multiple_hits=False), size)
    assert len(mine.intersects_id(*rays, max_hits=0)[0]) == 0


def test_a_mesh_that_has_changed_is_traced_as_it_is():
    mesh = trimesh.creation.icosphere(subdivisions=2)
    mesh.ray = RayMeshIntersector(mesh)
    points = np.random.default_rng(0).uniform(-2, 2, (2000, 3))
    for change in (
        lambda: None, lambda: mesh.apply_scale(1.7), lambda: mesh.apply_translation((0.5, 0, 0)),
        lambda: mesh.vertices.__setitem__(0, (3, 3, 3)), lambda: mesh.update_faces(np.arange(len(mesh.faces)) % 7 != 0),
    ):  # fmt: skip
        change()
        rays = random_rays(mesh, 500)
        same(mesh.ray.intersects_location(*rays), Theirs(mesh).intersects_location(*rays), 3.0)
        assert (mesh.contains(points) == Theirs(mesh).contains_points(points)).mean() > 0.99


def closed_meshes():
    """20 closed meshes whose inside is known: name, mesh, and (N,) float64 distances that are positive outside."""
    random = np.random.default_rng(1)
    for subdivisions, radius in ((1, 1.0), (2, 3.0), (3, 0.01), (2, 1e3), (3, 1.0)):
        yield trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    for extents in ((1, 1, 1), (1, 20, 3), (0.001, 1, 1), (1e4, 1, 1), (5, 5, 1e-3)):
        yield trimesh.creation.box(extents)
    for _ in range(5):
        turn = trimesh.transformations.random_rotation_matrix(random.random(3))
        yield trimesh.convex.convex_hull(random.normal(size=(40, 3))).apply_transform(turn)
    for sections in (3, 8, 100, 7, 32):
        yield trimesh.creation.cylinder(1.0, 3.0, sections=sections)


def test_points_in_twenty_closed_meshes_and_samples_of_their_volume_are_never_wrong():
    count = 0
    for mesh in closed_meshes():
        mesh.ray = RayMeshIntersector(mesh)
        count += 1
        points = np.random.default_rng(0).uniform(*(mesh.bounds + np.outer([-0.1, 0.1], mesh.extents)), (3000, 3))
        heights = (points @ mesh.face_normals.T - (mesh.face_normals * mesh.triangles[:, 0]).sum(axis=1)).max(axis=1)
        sure = np.abs(heights) > 1e-6 * mesh.extents.max()  # all of them are convex
        assert (mesh.contains(points) == (heights < 0))[sure].all()
        samples = trimesh.sample.volume_mesh(mesh, 500)
        heights = (samples @ mesh.face_normals.T - (mesh.face_normals * mesh.triangles[:, 0]).sum(axis=1)).max(axis=1)
        assert len(samples) > 30
        assert (heights < 1e-6 * mesh.extents.max()).all()
    assert count == 20


def test_it_raises_nowhere_where_trimesh_does_not():
    mesh = trimesh.creation.box()
    mine, theirs = RayMeshIntersector(mesh), Theirs(mesh)
    cases = (
        ([[0, 0, 3]], [[0, 0, 0]]), (np.zeros((0, 3)), np.zeros((0, 3))), ([[0, 0, np.nan]], [[0, 0, 1]]),
        ([[0.1, 0, 3]], [[0, 0, -1e-9]]),
    )  # fmt: skip
    for rays in cases:
        same(mine.intersects_location(*rays), theirs.intersects_location(*rays), 1.0)
        same([mine.intersects_first(*rays)], [theirs.intersects_first(*rays)], 1.0)
        same([mine.intersects_any(*rays)], [theirs.intersects_any(*rays)], 1.0)
    assert mine.contains_points([[0, 0, np.nan], [0.1, 0, 0], [np.inf, 0, 0]]).tolist() == [False, True, False]
    for wrong in (([[0, 0, 0]], [[0, 0, 1]] * 2), ([0, 0, 3], [0, 0, 1])):
        with pytest.raises(ValueError):  # noqa: PT011 -- trimesh's own have no common message
            mine.intersects_id(*wrong)
    with pytest.raises(ValueError, match="points must be"):
        mine.contains_points([])
    for empty in (trimesh.Trimesh(), trimesh.Trimesh(np.full((3, 3), np.nan), [[0, 1, 2]], process=False)):
        none = RayMeshIntersector(empty)
        assert len(none.intersects_location([[0, 0, 0]], [[0, 0, 1]])[0]) == 0
        assert none.intersects_first([[0, 0, 0]], [[0, 0, 1]]).tolist() == [-1]
        assert none.contains_points([[0, 0, 0]]).tolist() == [False]


def test_points_in_an_open_mesh_are_inside_as_trimesh_guesses():
    ball = trimesh.creation.icosphere(subdivisions=3)
    ball.update_faces(ball.triangles_center[:, 2] < 0.8)
    points = np.random.default_rng(0).uniform(-1.2, 1.2, (4000, 3))
    mine, theirs = RayMeshIntersector(ball).contains_points(points), Theirs(ball).contains_points(points)
    assert (mine == theirs).mean() > 0.999


def test_voxels_and_copies_use_the_stand_in():
    mesh = trimesh.creation.icosphere(subdivisions=3)
    expected = trimesh.voxel.creation.voxelize(mesh, 0.2, method="ray").matrix
    mesh.ray = RayMeshIntersector(mesh)
    np.testing.assert_array_equal(trimesh.voxel.creation.voxelize(mesh, 0.2, method="ray").matrix, expected)
    rays = random_rays(mesh, 100)
    for other in (copy.copy(mesh.ray), copy.deepcopy(mesh.ray), pickle.loads(pickle.dumps(mesh.ray))):
        same([other.intersects_first(*rays)], [mesh.ray.intersects_first(*rays)], 1.0)


@pytest.mark.parametrize("offset", [1e3, 1e6])
def test_rays_from_far_away_hit_the_triangles_that_rays_from_nearby_hit(offset):
    mesh = trimesh.creation.icosphere(subdivisions=3)
    random = np.random.default_rng(0)
    targets, ways = random.uniform(-0.6, 0.6, (2000, 3)), random.normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    ray = RayMeshIntersector(mesh)
    near = ray.intersects_location(targets - 2 * ways, ways)
    far = ray.intersects_location(targets - offset * ways, ways)
    assert [len(one) for one in near] == [len(one) for one in far]
    assert (near[2] == far[2]).mean() > 0.999
    assert far[0] == pytest.approx(near[0], abs=1e-15 * offset * 100 + 1e-9)


def test_a_ray_that_starts_on_the_surface_meets_it_there_at_any_scale():
    for scale in (1e-4, 0.1, 1.0, 10.0, 1e4, 1e8):
        mesh = trimesh.creation.box().subdivide().subdivide()
        mesh.apply_scale(scale)
        for scale_to_box in (True, False):
            ray = RayMeshIntersector(mesh, scale_to_box=scale_to_box)
            assert len(ray.intersects_id([[0, 0, scale / 2]], [[0, 0, -1]])[0]) == 2
