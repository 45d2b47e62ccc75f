"""Rays, meshes and points at the ends of what numbers can be: a clear error, or what fractions say."""

from fractions import Fraction

import numpy as np
import pytest
import trimesh

import atra
from atra.compat.trimesh import RayMeshIntersector
from tests.closed_meshes import box, sphere
from tests.rays.near_whole_numbers import crosses, hits_without_rounding

each_precision = pytest.mark.parametrize("precision", ["exact", "watertight", "fast"])

CALLS = {
    "intersect": lambda scene, *rays, **ends: scene.intersect(*rays, **ends).t,
    "occluded": lambda scene, *rays, **ends: scene.occluded(*rays, **ends),
    "count": lambda scene, *rays, **ends: scene.count(*rays, **ends),
    "all_hits": lambda scene, *rays, **ends: scene.all_hits(*rays, **ends).t,
    "gather": lambda scene, *rays, **ends: scene.gather(atra.Layers(2), *rays, **ends).t,
}
"""Calls of a scene that take rays; each gives an array."""

BAD = {
    "a NaN origin": ((np.nan, 0, 0), (0, 0, 1), {}),
    "an infinite origin": ((0, -np.inf, 0), (0, 0, 1), {}),
    "an origin too far away": ((0, 2e11, 0), (0, 0, 1), {}),
    "a NaN direction": ((0, 0, 0), (0, np.nan, 1), {}),
    "an infinite direction": ((0, 0, 0), (np.inf, 0, 1), {}),
    "no direction": ((0, 0, 0), (0, -0.0, 0), {}),
    "a direction all but 0": ((0, 0, 0), (0, 1e-300, 0), {}),
    "a NaN tnear": ((0, 0, 0), (0, 0, 1), {"tnear": np.nan}),
    "a negative tnear": ((0, 0, 0), (0, 0, 1), {"tnear": -1e-300}),
    "a NaN tfar": ((0, 0, 0), (0, 0, 1), {"tfar": np.nan}),
}


@each_precision
@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_rays_that_are_none_are_refused_by_every_call_naming_the_ray(bad, precision):
    origin, direction, ends = bad
    rays = np.array([(0, 0, 5), origin], np.float64), np.array([(0, 0, -1), direction], np.float64)
    ends = {name: np.array([0.0, value]) for name, value in ends.items()}
    with atra.RayScene(box(), threads=1, precision=precision) as scene:
        for call in CALLS.values():
            with pytest.raises(atra.InputError, match=r"ray 1 has the (origin|direction|tnear|tfar) .*, expected"):
                call(scene, *rays, **ends)


@each_precision
@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_an_interval_that_ends_before_it_begins_holds_nothing(call, precision):
    origins, directions = np.tile((0.1, 0.2, 5.0), (7, 1)), np.tile((0.0, 0.0, -1.0), (7, 1))
    near = [3.0, 4.5, 4.5, 0.0, 0.0, 1e300, 1e300]
    far = [1.0, 4.0, 4.5, -np.inf, -1e-300, np.inf, 1e38]
    for kind in (np.float32, np.float64):
        with atra.RayScene(box(), threads=1, precision=precision) as scene:
            found = call(scene, origins.astype(kind), directions.astype(kind), tnear=near, tfar=far)
        assert not np.isfinite(found).any() or not found.any()


@each_precision
def test_a_mesh_of_one_point_is_never_hit_and_holds_nothing(precision):
    mesh = atra.Mesh(np.ones((3, 3), np.float32), [(0, 1, 2), (0, 0, 0)])
    origins = np.array([(1, 1, 5), (1, 1, 1), (0, 0, 0)], np.float64)
    directions = np.array([(0, 0, -1), (0, 0, 1), (1, 1, 1)], np.float64)
    with atra.RayScene(mesh, threads=1, precision=precision) as scene:
        for call in CALLS.values():
            found = call(scene, origins, directions)
            assert not np.isfinite(found).any() or not found.any()
        assert scene.gather(atra.Thickness(), origins, directions).tolist() == [0.0] * 3
        scene.update(mesh)
        assert not scene.occluded(origins, directions).any()
        points = np.random.default_rng(0).normal(1.0, 1.0, (1 << 17, 3))  # many: cells answer
        points[0] = 1.0
        for method in ("parity", "winding"):
            assert not scene.contains(points, method=method).any()
    camera = atra.Camera((1, 1, 5), (1, 1, 1), (0, 1, 0), 40.0, 8, 8)
    assert atra.visible_points(mesh, [(1, 1, 1), (1, 1, 0)], [camera]).all()
    assert not atra.face_counts(mesh, [camera]).dense().any()
    other = RayMeshIntersector(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))
    assert not other.intersects_any(origins, directions).any()
    assert other.intersects_first(origins, directions).tolist() == [-1] * 3
    assert len(other.intersects_location(origins, directions)[0]) == 0
    assert not other.contains_points(origins).any()


@pytest.mark.parametrize(("size", "said"), [(1e-30, "is 2e-30 in size, expected at least"), (1e12, "reaches 1e\\+12")])
def test_a_mesh_too_small_or_large_for_float32_is_refused_and_trimeshs_is_scaled(size, said):
    mesh = box((-1, -1, -1), (1, 1, 1))
    scaled = atra.Mesh(mesh.vertices * np.float32(size), mesh.faces)
    camera = atra.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, 8, 8)
    scene = atra.RayScene(mesh, threads=1)
    for refused in (
        lambda: atra.RayScene(scaled),
        lambda: atra.RayScene([mesh], transforms=[np.diag([size, size, size, 1.0])]),
        lambda: scene.update(scaled),
        lambda: atra.visible_points(scaled, [(0, 0, 0)], [camera]),
    ):
        with pytest.raises(atra.InputError, match=said):
            refused()
    with pytest.RaisesGroup(pytest.RaisesExc(atra.InputError, match="in size, expected at least|from the eye")):
        atra.face_counts(scaled, [camera])
    with pytest.raises(atra.InputError, match="expected finite numbers of at most"):
        atra.Mesh(mesh.vertices * np.float32(1e30), mesh.faces)
    for factor in (size, 1e30):
        given = trimesh.Trimesh(np.float64(mesh.vertices) * factor, mesh.faces, process=False)
        other = RayMeshIntersector(given, threads=1)
        locations = other.intersects_location([(0.1 * factor, 0.2 * factor, 5 * factor)], [(0, 0, -1)])[0]
        np.testing.assert_allclose(locations / factor, [(0.1, 0.2, 1), (0.1, 0.2, -1)], atol=1e-6)
        assert other.contains_points([(0, 0, 0), (0, 0, 1.5 * factor)]).tolist() == [True, False]


SMALL = [0, 0, 0, 1e-300, 1e-200, 1e-120, 1e-90, 1e-60, 1e-45, 1e-40, 1e-30, 1e-18, 1e-10, 1e-3]
"""Sizes of numbers whose products leave float64, or of which float32 has few digits."""

LARGE = {"1": (1.0, 0.5, 2.0), "1e10": (1.0, 1e10, 3.0), "1e-9": (1e-9, 5e-9)}
"""Sizes of meshes, by name."""


def odd_numbers(random, shape, sizes):
    numbers = random.choice(np.array(SMALL + 3 * list(sizes)), shape) * random.choice([-1, 1], shape)
    return numbers * np.where(random.random(shape) < 0.5, 1.0, random.uniform(0.5, 1.0, shape))


def odd_scene(seed, kind, sizes):
    """Eight triangles, and 24 rays to corners, to inner points and anywhere, all with numbers of odd sizes."""
    random = np.random.default_rng(seed)
    corners = odd_numbers(random, (8, 3, 3), sizes).astype(np.float32)
    origins, ways = odd_numbers(random, (24, 3), sizes), odd_numbers(random, (24, 3), (1.0, 2.0, 0.3))
    weights = random.dirichlet((1, 1, 1), 24)
    weights[:8] = (0.0, 1.0, 0.0)
    ends = (weights[:, :, None] * corners[random.integers(0, 8, 24)]).sum(axis=1)
    directions = np.where((np.arange(24) < 16)[:, None], ends - origins, ways)
    largest = np.abs(directions).max(axis=1, keepdims=True)
    directions = np.where(largest == 0.0, 1.0, directions / np.where((largest < 1e-19) & (largest > 0.0), largest, 1.0))
    near = random.choice([0, 0, 0, 1e-300, 1e-100, 1e-40, 1e-5, 1.0, 1e300], 24)
    far = random.choice([np.inf, np.inf, 1e300, 1e40, 1.0, 1e-300, 0.0, 1e-40], 24)
    with np.errstate(over="ignore", under="ignore"):
        rays = atra.Rays(origins.astype(kind), directions.astype(kind), tnear=near, tfar=far)
    return atra.Mesh(corners.reshape(-1, 3), np.arange(24).reshape(-1, 3)), rays


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("sizes", LARGE.values(), ids=LARGE)
def test_numbers_of_any_size_lead_to_the_hits_that_fractions_find(sizes, kind, seed):
    mesh, rays = odd_scene(seed, kind, sizes)
    expected = [
        hits_without_rounding(mesh, rays.origins[k], rays.directions[k], rays.tnear[k], rays.tfar[k]) for k in range(24)
    ]
    assert any(expected)
    with atra.RayScene(mesh, threads=1) as scene:
        lists = scene.all_hits(rays)
        for k, hits in enumerate(expected):
            found = lists.prim_id[lists.ray_splits[k] : lists.ray_splits[k + 1]]
            assert sorted(found.tolist()) == sorted(prim_id for _, prim_id in hits), k
        assert scene.count(rays).tolist() == [len(hits) for hits in expected]
        for coherent in (False, True):
            assert scene.occluded(rays, coherent=coherent).tolist() == [len(hits) > 0 for hits in expected]
            hits = scene.intersect(rays, coherent=coherent)
            nearest = [one[0][1] if one else atra.MISS for one in expected]
            assert hits.prim_id.tolist() == nearest
            for k in np.flatnonzero(hits.hit):
                unit = Fraction(float(np.spacing(hits.t[k])))
                assert abs(Fraction(float(hits.t[k])) - expected[k][0][0]) <= unit, k


def test_numbers_below_float32s_smallest_are_stored_as_0_and_late_ends_as_none():
    tiny, kept = 1.4e-45, 1.5e-45
    rays = atra.Rays([(tiny, -tiny, kept)], [(1.0, -1e-300, -kept)], tnear=[1e-300], tfar=[1e39])
    assert rays.origins.tolist() == [[0.0, 0.0, kept]]
    assert rays.directions.tolist() == [[1.0, 0.0, -kept]]
    assert (rays.tnear[0], rays.tfar[0]) == (0.0, np.inf)
    for kind in (np.float32, np.float64):
        rays = atra.Rays(np.zeros((1, 3), kind), np.ones((1, 3), kind), tnear=1e300, tfar=-1e-300)
        assert (rays.tnear[0], rays.tfar[0]) == (kind(1e38), 0.0)


@pytest.mark.parametrize("size", [1e-9, 1e-3, 1.0])
def test_rays_from_as_far_as_may_be_hit_what_fractions_say(size):
    mesh = atra.Mesh(sphere(1).vertices * np.float32(size), sphere(1).faces)
    random = np.random.default_rng(3)
    ways = random.normal(size=(40, 3))
    origins = 9e10 * ways / np.abs(ways).max(axis=1, keepdims=True)
    directions = -origins * 2.0 ** -random.integers(0, 60, (40, 1))
    origins[20:], directions[20:, 0] = origins[20:] * [[0, 1, 1]], 0.0
    origins[20:, 0] = random.uniform(-2 * size, 2 * size, 20)
    expected = [hits_without_rounding(mesh, *ray) for ray in zip(origins, directions, strict=True)]
    assert 20 <= sum(map(bool, expected)) < 40
    with atra.RayScene(mesh, threads=1) as scene:
        assert scene.count(origins, directions).tolist() == [len(hits) for hits in expected]
        for coherent in (False, True):
            found = scene.intersect(origins, directions, coherent=coherent)
            assert found.prim_id.tolist() == [hits[0][1] if hits else atra.MISS for hits in expected]


@pytest.mark.parametrize("precision", ["watertight", "fast"])
def test_embrees_precisions_hit_the_middles_of_triangles_with_rays_of_odd_numbers(precision):
    mesh = sphere(2)
    random = np.random.default_rng(4)
    middles = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64).mean(axis=1)
    origins = 3.0 * middles + random.choice(SMALL[:10], middles.shape)
    directions = (middles - origins) * random.choice([1e-19, 1.0, 1e19], (len(middles), 1))
    lengths = np.abs(middles - origins).max(axis=1) / np.abs(directions).max(axis=1)
    near = random.choice([0.0, 1e-300, 1e-45], len(middles))
    far = np.where(random.random(len(middles)) < 0.5, 1e300, 1.001 * lengths)
    with atra.RayScene(mesh, threads=1, precision=precision) as scene:
        for coherent in (False, True):
            found = scene.intersect(origins, directions, tnear=near, tfar=far, coherent=coherent)
            np.testing.assert_array_equal(found.prim_id, np.arange(mesh.triangle_count))
            np.testing.assert_allclose(found.t, lengths, rtol=1e-5)
            assert scene.occluded(origins, directions, tnear=near, tfar=far, coherent=coherent).all()


def test_points_of_odd_numbers_are_inside_where_fractions_say_and_far_ones_are_refused_or_outside():
    mesh = atra.Mesh(box((-1, -1, -1), (1, 1, 1)).vertices, box().faces)
    points = odd_numbers(np.random.default_rng(5), (500, 3), (0.5, 0.9, 1.5))
    inside = (np.abs(points) < 1.0).all(axis=1)
    far = np.array([(1e300, 0, 0), (0, -1e20, 0)])
    with atra.RayScene(mesh, threads=1) as scene:
        for method in ("parity", "winding"):
            np.testing.assert_array_equal(scene.contains(points, method=method), inside)
        assert not scene.contains(far).any()
        with pytest.raises(atra.InputError, match=r"point 0 is \(1e\+300, 0.0, 0.0\), expected .* at most 1e\+19"):
            scene.contains(far, method="winding")
    camera = atra.Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, 8, 8)
    with pytest.raises(atra.InputError, match=r"point 1 is \(0.0, -1e\+20, 0.0\), expected .* at most 1e\+19"):
        atra.visible_points(mesh, [(0, 0, 0), far[1]], [camera])
    for bad in (np.nan, np.inf):
        with pytest.raises(atra.InputError, match=r"point 1 is .*, expected finite"):
            atra.visible_points(mesh, [(0, 0, 0), (0, bad, 0)], [camera])
        for method in ("parity", "winding"):
            with pytest.raises(atra.InputError, match=r"point 1 is .*, expected finite"):
                atra.RayScene(mesh).contains([(0, 0, 0), (0, bad, 0)], method=method)


@pytest.mark.parametrize("away", [1e2, 1e5, 1e8])
def test_trimeshs_rays_from_far_away_hit_what_fractions_say(away):
    given = trimesh.creation.icosphere(1)
    random = np.random.default_rng(6)
    origins = random.normal(size=(30, 3))
    origins *= away / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = random.uniform(-1.2, 1.2, (30, 3)) - origins
    corners = given.vertices[given.faces]
    expected = [any(crosses(one, *ray) for one in corners) for ray in zip(origins, directions, strict=True)]
    assert 5 < sum(expected) < 25
    np.testing.assert_array_equal(RayMeshIntersector(given, threads=1).intersects_any(origins, directions), expected)


def test_trimeshs_rays_from_where_float64_cannot_tell_are_refused_and_others_miss():
    other = RayMeshIntersector(trimesh.creation.icosphere(1), threads=1)
    for far in (1e13, 1e100, 1e300):
        origins, directions = [(0.1, 0, 3), (0.6 * far, 0, 0.8 * far)], np.array([(0, 0, -1.0), (-0.6, 0, -0.8)])
        for call in (other.intersects_any, other.intersects_first, other.intersects_location, other.intersects_id):
            with pytest.raises(atra.InputError, match=r"ray 1 starts at .*, over 1e9 times the size of the mesh away"):
                call(origins, directions)
        assert other.intersects_any(origins, directions * [[1], [-1]]).tolist() == [True, False]
        assert other.intersects_any(origins, [(0, 0, -1), (0.8, 0, -0.6)]).tolist() == [True, False]
