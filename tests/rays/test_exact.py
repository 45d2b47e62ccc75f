"""Nearest hits and occlusion decided without rounding: what fractions say, and no ray lost at corners and edges."""

import os
from fractions import Fraction

import numpy as np
import pytest

import atra
from atra.rays.kernel_scene import KernelScene
from scenes.directory import load_scene_from_directory
from tests.closed_meshes import box, sphere
from tests.machine import WIDTHS
from tests.meshes import beams, random_triangles
from tests.rays.near_whole_numbers import hits_without_rounding

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
    """Rays whose nearest hit is not the first of all hits, to a unit of float32; and those occluded otherwise."""
    lists = scene.all_hits(rays, max_hits=1)
    hit = np.diff(lists.ray_splits) > 0
    t = np.full(len(rays), np.inf)
    t[hit] = lists.t
    found = scene.intersect(rays)
    with np.errstate(invalid="ignore"):
        is_right = (found.t == t) | (np.abs(found.t - t) <= np.spacing(np.abs(t).astype(np.float32)))
    return int((~is_right).sum()), int((scene.occluded(rays) != hit).sum())


def assert_as_fractions_say(mesh, rays, **options):
    with atra.RayScene(mesh, threads=1, **options) as scene:
        for coherent in (False, True):
            found, occluded = scene.intersect(rays, coherent=coherent), scene.occluded(rays, coherent=coherent)
            for ray in range(len(rays)):
                ends = rays.tnear[ray], rays.tfar[ray]
                every = hits_without_rounding(mesh, rays.origins[ray], rays.directions[ray], *ends)
                expected = every[0] if every else None
                assert occluded[ray] == (expected is not None), ray
                if expected is None:
                    assert (found.t[ray], found.prim_id[ray]) == (np.inf, atra.MISS)
                    continue
                assert found.prim_id[ray] == expected[1], ray
                unit = Fraction(float(np.spacing(np.float32(expected[0]))))
                assert abs(Fraction(float(found.t[ray])) - expected[0]) <= unit, ray


WIDE_MISS = np.array([
    [-67.69551086, -102.00939178, 65.88462829], [-73.34773254, -111.52724457, 64.18085479],
    [-72.46593475, -110.29998779, 64.26013183],
])  # fmt: skip
"""A thin triangle that the ray of the test below passes at a distance of 12.5 units, all but in its plane."""


def test_a_thin_triangle_that_the_ray_passes_is_not_hit():
    mesh = atra.Mesh(WIDE_MISS, [[0, 1, 2]])
    origin = [366.5789794921875, 25.6765193939209, -240.27505493164062]
    ray = origin, [-0.791915237903595, -0.2140892744064331, 0.5718706250190735]
    with atra.RayScene(mesh, threads=1, precision="watertight") as scene:
        assert scene.occluded(*ray)  # Embree's issue 387
    with atra.RayScene(mesh, threads=1) as scene:
        assert not scene.occluded(*ray)
        assert scene.intersect(*ray).prim_id == atra.MISS
        assert scene.count(*ray) == 0


def test_the_distance_to_a_cube_is_right_to_the_last_unit():
    mesh = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    random = np.random.default_rng(0)
    origins = np.insert(random.uniform(-0.45, 0.45, (5000, 2)), 2, 5.0, axis=1).astype(np.float32)
    for coherent in (None, False, True):
        with atra.RayScene(mesh, threads=1) as scene:
            assert (scene.intersect(origins, (0.0, 0.0, -1.0), coherent=coherent).t == 4.5).all()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["few", "thin", "edges", "copies"])
def test_hits_are_those_that_fractions_find(name, kind):
    random = np.random.default_rng(5)
    made = {"few": random_triangles(60, 1), "thin": beams(1), "edges": box()}
    mesh = made.get(name, doubled(random_triangles(40, 2)))
    mesh = atra.Mesh(mesh.vertices, mesh.faces[:100])
    count = 64
    low, high = mesh.bounds
    origins = random.uniform(low - 1, high + 1, (count, 3)).astype(kind)
    corners = mesh.triangles(random.integers(0, mesh.triangle_count, count))
    weights = random.dirichlet((1, 1, 1), count)
    weights[::4], weights[1::4] = (0.5, 0.5, 0.0), (1.0, 0.0, 0.0)
    ends = (weights[:, :, None] * corners).sum(axis=1)
    directions = (ends - origins).astype(kind)
    rays = atra.Rays(origins, directions, tnear=random.choice([0.0, 0.5, 1.0], count).astype(kind))
    assert rays.origins.dtype == rays.tfar.dtype == kind
    assert_as_fractions_say(mesh, rays)


def doubled(mesh):
    """Every triangle three times, the last with its corners turned."""
    return atra.Mesh(mesh.vertices, np.concatenate([mesh.faces[::-1], mesh.faces, np.roll(mesh.faces, 1, axis=1)]))


def test_rays_all_but_in_the_planes_of_thin_triangles_hit_what_fractions_say():
    random = np.random.default_rng(7)
    corners = random.uniform(-1, 1, (30, 1, 3)) + random.normal(size=(30, 3, 3)) * [[[0.3], [0.3], [1e-4]]]
    mesh = atra.Mesh(corners.reshape(-1, 3), np.arange(90).reshape(-1, 3))
    held = mesh.triangles(np.arange(30))
    numbers = random.integers(0, 30, 64)
    one, other = (random.dirichlet((1, 1, 1), 64)[:, :, None] for _ in range(2))
    start = (other * held[numbers]).sum(axis=1) - 4 * ((one - other) * held[numbers]).sum(axis=1)
    rays = atra.Rays(start.astype(np.float32), ((one * held[numbers]).sum(axis=1) - start).astype(np.float32))
    assert_as_fractions_say(mesh, rays)


def test_of_equally_near_triangles_the_lowest_is_hit_in_any_order_and_direction():
    mesh = doubled(sphere(2))
    with atra.RayScene(mesh, threads=1) as scene:
        for coherent in (False, True):
            found = scene.intersect(through_corners(mesh, 2000), coherent=coherent)
            assert (found.prim_id[found.hit] < 2 * mesh.triangle_count // 3).all()
            every = scene.all_hits(through_corners(mesh, 2000))
            first = every.ray_splits[:-1][np.diff(every.ray_splits) > 0]
            np.testing.assert_array_equal(found.prim_id[found.hit], every.prim_id[first])


@pytest.mark.slow
@pytest.mark.skipif(not os.environ.get("ATRA_SCENES"), reason="ATRA_SCENES names no folder of scenes")
def test_a_ray_in_sponza_hits_the_nearer_of_two_triangles():
    mesh = load_scene_from_directory("sponza").mesh
    random = np.random.default_rng(0)
    low, high = mesh.bounds
    origins = random.uniform(low, high, (300_000, 3)).astype(np.float32)
    directions = random.normal(size=(300_000, 3)).astype(np.float32)
    with atra.RayScene(mesh, threads=1) as scene:
        found = scene.intersect(origins[127_453], directions[127_453])
        assert found.prim_id == 25_341
        assert found.t == pytest.approx(0.29199062, rel=1e-7)


def test_points_and_normals_of_hits_are_float64():
    mesh = sphere(3)
    rays = through_corners(mesh, 500)
    rays = atra.Rays(rays.origins, rays.directions * np.where(np.arange(500) % 20, 1, -1)[:, None])
    with atra.RayScene([mesh, mesh], transforms=[np.eye(4), np.diag([2.0, 2.0, 2.0, 1.0])], threads=1) as scene:
        found = scene.intersect(rays)
        hit = found.hit
        assert 0.9 < hit.mean() < 1.0
        assert found.points.dtype == found.normals.dtype == np.float64
        assert found.points.shape == found.normals.shape == (500, 3)
        assert np.isnan(found.points[~hit]).all()
        along = rays.origins + found.t.astype(float)[:, None] * rays.directions
        np.testing.assert_allclose(found.points[hit], along[hit], atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(found.points[hit], axis=1), 2.0, rtol=0.02)
        np.testing.assert_allclose((found.normals[hit] * found.points[hit]).sum(axis=1), 2.0, rtol=0.02)


@each_width
def test_no_ray_through_a_corner_or_an_edge_is_lost_where_embree_alone_loses_some(width):
    mesh = sphere(4)
    rays = through_corners(mesh, 20_000)
    with atra.RayScene(mesh, threads=1) as scene:
        assert wrong(scene, rays) == (0, 0)
    with atra.RayScene(mesh, precision="watertight", packet_width=width, threads=1) as plain:
        assert min(wrong(plain, rays)) > 10


@pytest.mark.parametrize(
    "make", [lambda: beams(1), lambda: random_triangles(500, 3), box], ids=["beams", "random", "box"]
)
@pytest.mark.parametrize("away", [0.7, 8.0])
def test_needles_large_triangles_and_rays_from_afar_lose_nothing_either(make, away):
    mesh = make()
    with atra.RayScene(mesh, threads=2) as scene:
        assert wrong(scene, through_corners(mesh, 3000, away)) == (0, 0)
        assert wrong(scene, anywhere(mesh, 3000)) == (0, 0)


def test_a_mesh_far_from_the_worlds_origin_and_a_moved_one_lose_nothing():
    mesh = sphere(3)
    far = atra.Mesh(mesh.vertices + np.float32(1000.0), mesh.faces)
    with atra.RayScene(mesh) as scene:
        scene.intersect(through_corners(mesh, 10))
        scene.update(far)
        assert wrong(scene, through_corners(far, 5000)) == (0, 0)


def test_only_the_faces_asked_for_are_met_and_meshes_are_told_apart():
    mesh = sphere(3)
    rays = through_corners(mesh, 2000)
    some = np.arange(mesh.triangle_count) % 2 == 0
    with atra.RayScene(mesh, faces=some) as scene:
        assert wrong(scene, rays) == (0, 0)
        assert not (scene.intersect(rays).prim_id[scene.occluded(rays)] % 2).any()
    moves = np.stack([np.eye(3, 4), np.eye(3, 4)])
    moves[1, 2, 3] = 5.0
    with atra.RayScene([mesh, mesh], transforms=moves) as scene:
        origins = np.concatenate([rays.origins, rays.origins + np.float32((0, 0, 5))])
        found = scene.intersect(origins, np.tile(rays.directions, (2, 1)))
        assert (found.geometry_id[found.hit] == np.repeat([0, 1], 2000)[found.hit]).mean() > 0.9
        assert found.hit.mean() > 0.95  # others pass corners of the outline
        assert found.prim_id[found.hit].max() < mesh.triangle_count


def test_kernels_ask_an_embree_scene_that_the_first_of_them_builds_and_an_update_builds_anew():
    mesh, asked = box(), []
    scene = KernelScene(mesh, threads=1)
    assert scene.embree_bytes == 0
    scene.run(lambda query: asked.append(query.scene))
    assert asked == [scene.address]
    assert scene.embree_bytes > 0
    before = scene._scene
    scene.update(atra.Mesh(mesh.vertices + 1, mesh.faces))
    assert before.closed
    assert scene.occluded([(1.1, 1.2, 9.0)], [(0.0, 0.0, -1.0)], tfar=[8.0]).all()
    with pytest.raises(atra.InputError, match="expected other vertices of the same faces"):
        scene.update(sphere(1))
    scene.close()
    assert scene.embree_bytes == 0
    with pytest.raises(atra.ClosedError):
        scene.run(lambda query: None)


def test_rays_that_meet_an_outline_in_an_edge_or_a_corner_hit_it_if_that_is_asked_for():
    mesh = box((0, 0, 0), (1, 1, 1))
    places = np.stack(np.meshgrid(*2 * [(-0.5, 0.0, 0.25, 1.0, 1.5)]), axis=-1).reshape(-1, 2)
    origins, down = np.insert(places, 2, 3.0, axis=1), np.tile((0.0, 0.0, -1.0), (len(places), 1))
    within = ((places >= 0) & (places <= 1)).all(axis=1)
    inside = ((places > 0) & (places < 1)).all(axis=1)
    for threads in (1, 2):
        with atra.RayScene(mesh, touches=True, threads=threads) as scene:
            np.testing.assert_array_equal(scene.occluded(origins, down), within)
            np.testing.assert_array_equal(scene.intersect(origins, down).t, np.where(within, 2.0, np.inf))
        with atra.RayScene(mesh, threads=threads) as scene:
            hit = scene.occluded(origins, down)
            assert hit[inside].all()
            assert 0 < hit[within & ~inside].sum() < (within & ~inside).sum()
            np.testing.assert_array_equal(hit, scene.count(origins, down) > 0)
    with pytest.raises(atra.InputError, match="touches is True, expected False"):
        atra.RayScene(mesh, touches=True, precision="fast")
    with pytest.raises(atra.InputError, match="precision is 'exactly', expected one of exact, watertight, fast"):
        atra.RayScene(mesh, precision="exactly")
