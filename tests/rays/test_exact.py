"""Nearest hits and occlusion decided without rounding: no ray is lost at corners and edges."""

import numpy as np
import pytest

import atra
from atra.rays.enlarged import REACH
from tests.closed_meshes import box, sphere
from tests.machine import WIDTHS
from tests.meshes import beams, random_triangles

GRAZING = 1e-3
"""Cosine between a ray and a triangle's normal."""

each_width = pytest.mark.parametrize("width", WIDTHS)


def through_corners(mesh, count, away=1.5, seed=1):
    """From outside through corners, and through middles of edges, of a mesh."""
    random = np.random.default_rng(seed)
    faces = mesh.faces[random.integers(0, mesh.triangle_count, count)]
    ends = mesh.vertices[faces[:, :2]].astype(np.float64)
    ends[::2, 1] = ends[::2, 0]
    ways = random.normal(size=(count, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    size = float((mesh.bounds[1] - mesh.bounds[0]).max())
    origins = (mesh.bounds.mean(axis=0) + away * size * ways).astype(np.float32)
    return atra.Rays(origins, ends.mean(axis=1) - origins)


def anywhere(mesh, count, lengths=1.0, **interval):
    random = np.random.default_rng(2)
    low, high = mesh.bounds
    return atra.Rays(random.uniform(low, high, (count, 3)), random.normal(size=(count, 3)) * lengths, **interval)


def wrong(scene, rays):
    """Rays whose nearest hit lies elsewhere than that of all hits, decided exactly; and those occluded otherwise.

    A hit may be lost where the ray grazes a triangle, closer to its plane than `GRAZING`.
    """
    lists = scene.all_hits(rays, max_hits=1)
    hit = np.diff(lists.ray_splits) > 0
    t, grazes = np.full(len(rays), np.inf), np.zeros(len(rays), np.bool_)
    ways = rays.directions.astype(np.float64)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    t[hit], grazes[hit] = lists.t, np.abs((lists.normals * ways[hit]).sum(axis=1)) < GRAZING
    found = scene.intersect(rays)
    with np.errstate(invalid="ignore"):
        away = np.abs(found.t - t) * np.linalg.norm(rays.directions.astype(np.float64), axis=1)
    near = (away <= 2e-5 * (scene.mesh.bounds[1] - scene.mesh.bounds[0]).max()) | (found.t == t)
    return int((~near & ~grazes).sum()), int(((scene.occluded(rays) != hit) & ~grazes).sum())


@each_width
def test_no_ray_through_a_corner_or_an_edge_is_lost_where_embree_alone_loses_some(width):
    mesh = sphere(4)
    rays = through_corners(mesh, 20_000)
    with atra.RayScene(mesh, exact=True, packet_width=width, threads=1) as scene:
        assert wrong(scene, rays) == (0, 0)
    with atra.RayScene(mesh, packet_width=width, threads=1) as plain:
        assert min(wrong(plain, rays)) > 10


@pytest.mark.parametrize(
    "make", [lambda: beams(1), lambda: random_triangles(500, 3), box], ids=["beams", "random", "box"]
)
@pytest.mark.parametrize("away", [0.7, 2 * REACH])
def test_needles_large_triangles_and_rays_from_afar_lose_nothing_either(make, away):
    mesh = make()
    with atra.RayScene(mesh, exact=True, threads=2) as scene:
        assert wrong(scene, through_corners(mesh, 3000, away)) == (0, 0)
        assert wrong(scene, anywhere(mesh, 3000)) == (0, 0)


def test_intervals_and_lengths_of_directions_are_respected():
    mesh = sphere(3)
    lengths = 10.0 ** np.random.default_rng(3).uniform(-15, 15, (5000, 1))
    size = np.linalg.norm(anywhere(mesh, 5000, lengths).directions, axis=1)
    rays = anywhere(mesh, 5000, lengths, tnear=0.2 / size, tfar=1.0 / size)
    with atra.RayScene(mesh, exact=True) as scene:
        assert wrong(scene, rays) == (0, 0)
        assert 0.2 < scene.occluded(rays).mean() < 0.8
        assert not scene.occluded(atra.Rays(rays.origins, rays.directions, 1.0, 1.0)).any()


def test_a_mesh_far_from_the_worlds_origin_and_a_moved_one_lose_nothing():
    mesh = sphere(3)
    far = atra.Mesh(mesh.vertices + np.float32(1000.0), mesh.faces)
    with atra.RayScene(mesh, exact=True) as scene:
        scene.intersect(through_corners(mesh, 10))
        scene.update(far)
        assert wrong(scene, through_corners(far, 5000)) == (0, 0)


def test_only_the_faces_asked_for_are_met_and_meshes_are_told_apart():
    mesh = sphere(3)
    rays = through_corners(mesh, 2000)
    some = np.arange(mesh.triangle_count) % 2 == 0
    with atra.RayScene(mesh, faces=some, exact=True) as scene:
        assert wrong(scene, rays) == (0, 0)
        assert not (scene.intersect(rays).prim_id[scene.occluded(rays)] % 2).any()
    moves = np.stack([np.eye(3, 4), np.eye(3, 4)])
    moves[1, 2, 3] = 5.0
    with atra.RayScene([mesh, mesh], transforms=moves, exact=True) as scene:
        origins = np.concatenate([rays.origins, rays.origins + np.float32((0, 0, 5))])
        found = scene.intersect(origins, np.tile(rays.directions, (2, 1)))
        assert (found.geometry_id[found.hit] == np.repeat([0, 1], 2000)[found.hit]).mean() > 0.9
        assert found.hit.mean() > 0.95  # others pass corners of the outline
        assert found.prim_id[found.hit].max() < mesh.triangle_count


def test_kernels_of_ones_own_are_refused_triangles_that_are_not_the_meshs():
    with atra.RayScene(box(), exact=True) as scene, pytest.raises(atra.InputError, match="exact=True"):
        scene.run(lambda query: None)


def test_degenerate_triangles_are_missed():
    mesh = atra.Mesh(np.array([(0, 0, 1), (1, 0, 1)], np.float32), np.array([(0, 1, 1), (0, 0, 0)]))
    with atra.RayScene(mesh, exact=True) as scene:
        rays = atra.Rays(np.zeros((3, 3)), np.array([(0, 0, 1), (0.5, 0, 1), (1, 0, 1)]))
        assert not scene.occluded(rays).any()
        assert not scene.intersect(rays).hit.any()


def test_rays_that_meet_an_outline_in_an_edge_or_a_corner_hit_it_if_exact_says_touches():
    mesh = box((0, 0, 0), (1, 1, 1))
    places = np.stack(np.meshgrid(*2 * [(-0.5, 0.0, 0.25, 1.0, 1.5)]), axis=-1).reshape(-1, 2)
    origins, down = np.insert(places, 2, 3.0, axis=1), np.tile((0.0, 0.0, -1.0), (len(places), 1))
    within = ((places >= 0) & (places <= 1)).all(axis=1)
    inside = ((places > 0) & (places < 1)).all(axis=1)
    for threads in (1, 2):
        with atra.RayScene(mesh, exact="touches", threads=threads) as scene:
            np.testing.assert_array_equal(scene.occluded(origins, down), within)
            np.testing.assert_array_equal(scene.intersect(origins, down).t, np.where(within, 2.0, np.inf))
        with atra.RayScene(mesh, exact=True, threads=threads) as scene:
            hit = scene.occluded(origins, down)
            assert hit[inside].all()
            assert 0 < hit[within & ~inside].sum() < (within & ~inside).sum()
            np.testing.assert_array_equal(hit, scene.count(origins, down) > 0)
    with pytest.raises(atra.InputError, match="exact is 'corners', expected False, True"):
        atra.RayScene(mesh, exact="corners")
