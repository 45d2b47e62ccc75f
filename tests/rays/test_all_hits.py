"""All hits of rays: each crossing exactly once, by oracles of whole numbers."""

import numpy as np
import pytest
import trimesh

import atra
import atra.rays.tree.finding as finding
from tests.closed_meshes import box, sphere
from tests.meshes import cornell_box, random_triangles
from tests.rays.near_whole_numbers import hits_without_rounding
from tests.rays.whole_numbers import SIZE, whole_crossings, whole_meshes, whole_rays

WHOLE = whole_meshes()
each_whole = pytest.mark.parametrize("name", WHOLE)


def in_lists(hits):
    """(N, F) bool: whether a ray's list has a triangle. Fails where one has it twice."""
    found = np.zeros((len(hits.ray_splits) - 1, hits.mesh.triangle_count), int)
    np.add.at(found, (hits.ray_ids, hits.traced_id), 1)
    assert found.max(initial=0) <= 1
    return found > 0


@pytest.mark.core
@each_whole
def test_every_crossing_is_found_once_also_through_corners_and_edges(name):
    mesh, is_closed = WHOLE[name]
    origins, directions = whole_rays(mesh, 1500, 1)
    expected, t = whole_crossings(mesh, origins, directions)
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(origins, directions)
        assert (in_lists(hits) == (expected != 0)).all()
        assert (scene.count(origins, directions) == (expected != 0).sum(axis=1)).all()
    at = hits.ray_ids, hits.traced_id
    assert hits.t == pytest.approx(t[at], rel=1e-13)
    assert (hits.leaving == (expected[at] > 0)).all()
    assert len(hits) > 300
    if is_closed:
        outside = (np.abs(origins) > SIZE).any(axis=1)
        assert outside.sum() > 300
        assert (hits.counts[outside] % 2 == 0).all()


@each_whole
def test_intervals_take_what_lies_from_tnear_on_up_to_but_not_at_tfar(name):
    mesh, _ = WHOLE[name]
    origins, directions = whole_rays(mesh, 1000, 2)
    step = np.gcd.reduce(directions, axis=1)[:, None]
    directions //= step
    _, t = whole_crossings(mesh, origins, directions)
    random = np.random.default_rng(0)
    whole = np.isfinite(t) & (np.abs(t) < 1e5) & (t == np.rint(t)) & (t >= 0)  # ends that lie exactly on triangles
    tnear = np.array([random.choice(np.append(row[is_whole], 3.0)) for row, is_whole in zip(t, whole, strict=True)])
    tfar = tnear + random.integers(-1, 2 * SIZE, len(tnear))
    expected, _ = whole_crossings(mesh, origins, directions, tnear.astype(int), tfar.astype(int))
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(origins, directions, tnear=tnear, tfar=tfar)
        assert (scene.count(origins, directions, tnear=tnear, tfar=tfar) == hits.counts).all()
    assert (in_lists(hits) == (expected != 0)).all()
    assert (hits.t >= hits.rays.tnear[hits.ray_ids]).all()
    assert (hits.counts[tfar <= tnear] == 0).all()


@each_whole
@pytest.mark.parametrize("farthest", [1 << 12, 1 << 19])
def test_rays_from_far_away_lose_nothing(name, farthest):
    mesh, is_closed = WHOLE[name]
    origins, directions = whole_rays(mesh, 900, 3, farthest)
    expected, _ = whole_crossings(mesh, origins, directions)
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(origins, directions)
        assert (in_lists(hits) == (expected != 0)).all()
    assert not is_closed or (hits.counts % 2 == 0).all()


def test_rays_of_any_numbers_cross_what_exact_arithmetic_says():
    for mesh, seed in ((random_triangles(40, 1), 0), (sphere(1), 1)):
        random = np.random.default_rng(seed)
        low, high = mesh.bounds
        some = mesh.vertices[mesh.faces[random.integers(0, mesh.triangle_count, 60)]].astype(float)
        weights = random.dirichlet((0.02, 0.02, 0.02), 60)  # next to edges and corners
        aims = (some * weights[:, :, None]).sum(axis=1)
        origins = random.uniform(low - 1, high + 1, (60, 3)).astype(np.float32)
        directions = ((aims - origins) * 10.0 ** random.uniform(-15, 15, (60, 1))).astype(np.float32)
        with atra.RayScene(mesh, threads=1) as scene:
            hits = scene.all_hits(origins, directions)
        for ray in range(60):
            own = slice(hits.ray_splits[ray], hits.ray_splits[ray + 1])
            expected = hits_without_rounding(mesh, origins[ray], directions[ray])
            assert hits.prim_id[own].tolist() == [prim_id for _, prim_id in expected]


def test_seen_from_outside_a_closed_mesh_is_crossed_an_even_number_of_times_also_far_from_the_worlds_origin():
    fine = trimesh.creation.icosphere(subdivisions=5)
    random = np.random.default_rng(0)
    for offset, size in (((0, 0, 0), 1.0), ((1e5, -2e5, 3e4), 1.0), ((0, 0, 0), 1e-8), ((1e9, 0, 0), 1e5)):
        mesh = atra.Mesh(fine.vertices * size + offset, fine.faces)
        corners = mesh.vertices[random.integers(0, len(mesh.vertices), 20_000)]
        ways = random.normal(size=corners.shape)
        start = np.asarray(offset) + 1.5 * size * ways / np.linalg.norm(ways, axis=1, keepdims=True)
        origins = start.astype(np.float32)
        directions = corners.astype(np.float64) - origins
        with atra.RayScene(mesh, threads=2) as scene:
            counts = scene.count(origins, directions)
        assert (counts % 2 == 0).all()
        assert (counts > 0).mean() > 0.4


def test_hits_are_sorted_and_say_where_they_are():
    mesh = random_triangles(300, 4)
    random = np.random.default_rng(0)
    origins, directions = random.normal(size=(2, 2000, 3)) * 2
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(origins, directions)
        first = scene.intersect(origins, directions)
    same = np.diff(hits.ray_ids) == 0
    order = np.diff(hits.t)[same]
    assert (order >= 0).all()
    assert (np.diff(hits.prim_id.astype(int))[same][order == 0] > 0).all()
    corners = mesh.triangles(hits.prim_id)
    weights = np.stack([1.0 - hits.u - hits.v, hits.u, hits.v], axis=1)
    assert (corners * weights[:, :, None]).sum(axis=1) == pytest.approx(hits.points, abs=1e-4)
    assert np.abs(((hits.points - corners[:, 0]) * hits.normals).sum(axis=1)).max() < 1e-4
    has_hits = hits.counts > 0
    assert (has_hits == first.hit).mean() > 0.999
    assert hits.t[hits.ray_splits[:-1][has_hits & first.hit]] == pytest.approx(first.t[has_hits & first.hit], rel=1e-3)


def test_max_hits_keeps_the_nearest_and_says_which_rays_have_more():
    mesh = random_triangles(400, 5)
    random = np.random.default_rng(0)
    rays = atra.Rays(*random.normal(size=(2, 3000, 3)))
    with atra.RayScene(mesh, threads=1) as scene:
        every = scene.all_hits(rays)
        assert not every.truncated.any()
        for most in (1, 2, 5, 1000):
            hits = scene.all_hits(rays, max_hits=most)
            assert (hits.truncated == (every.counts > most)).all()
            place = np.arange(len(every)) - every.ray_splits[every.ray_ids]
            for name in ("t", "prim_id", "u", "v", "ray_ids"):
                assert (getattr(hits, name) == getattr(every, name)[place < most]).all()
            assert most == 1000 or hits.truncated.any()
        for wrong in (0, -1, 1.5, "2"):
            with pytest.raises(atra.InputError, match="max_hits is"):
                scene.all_hits(rays, max_hits=wrong)


def test_max_hits_keeps_the_nearest_also_where_they_differ_by_less_than_float64_computes():
    tilts = np.array([0.0, 2e-4, -3e-4])
    pages = np.stack([np.array([(-1, 0, 0), (1, 0, 0), (0.1, 1, tilt)]) for tilt in tilts])  # all share an edge
    wall = np.array([[(-9, -9, 1), (9, -9, 1), (0, 9, 1)]])
    mesh = atra.Mesh(np.concatenate([pages, wall]).reshape(-1, 3), np.arange(12).reshape(-1, 3))  # the wall comes last
    random = np.random.default_rng(0)
    ends = np.column_stack([random.uniform(-0.5, 0.5, 5000), 10.0 ** random.uniform(-15, -10, 5000), np.zeros(5000)])
    origins = ends + random.uniform((-2, -2, 3), (2, 2, 5), (5000, 3))
    rays = atra.Rays(origins, ends - origins)
    with atra.RayScene(mesh, threads=1) as scene:
        every = scene.all_hits(rays)
        place = np.arange(len(every)) - every.ray_splits[every.ray_ids]
        assert (every.counts == 4).mean() > 0.5
        for most in (2, 3):
            hits = scene.all_hits(rays, max_hits=most)
            for name in ("t", "prim_id", "u", "v", "ray_ids"):
                np.testing.assert_array_equal(getattr(hits, name), getattr(every, name)[place < most])


def test_threads_and_batches_change_no_bit_and_memory_grows(monkeypatch):
    mesh = random_triangles(500, 6)
    rays = atra.Rays(*np.random.default_rng(0).normal(size=(2, 5000, 3)))
    with atra.RayScene(mesh, threads=1) as scene:
        expected, done = scene.all_hits(rays), []
    monkeypatch.setattr(finding, "BATCH", 1300)
    monkeypatch.setattr(finding, "_START", 16)  # fewer than the hits of a ray
    for threads in (1, 3):
        with atra.RayScene(mesh, threads=threads) as scene:
            hits = scene.all_hits(rays, progress=lambda *so_far: done.append(so_far))
            counts = scene.count(rays, progress=lambda *so_far: done.append(so_far))
        for name in ("ray_splits", "t", "prim_id", "u", "v"):
            assert getattr(hits, name).tobytes() == getattr(expected, name).tobytes()
        assert (counts == hits.counts).all()
    assert done == 4 * [(1300, 5000), (2600, 5000), (3900, 5000), (5000, 5000)]


def test_more_hits_than_memory_are_an_error_that_names_max_hits(monkeypatch):
    mesh = random_triangles(300, 6)
    rays = atra.Rays(*np.random.default_rng(0).normal(size=(2, 500, 3)))
    with atra.RayScene(mesh, threads=1) as scene:
        expected = scene.all_hits(rays)
        monkeypatch.setattr("psutil.virtual_memory", lambda: type("Free", (), {"available": 20 * len(expected) // 2}))
        with pytest.raises(atra.MemoryBudgetError, match=r"hits .* need about .* pass max_hits"):
            scene.all_hits(rays)
        assert len(scene.all_hits(rays, max_hits=1)) > 100


def test_an_interrupted_call_leaves_the_scene_as_it_was(monkeypatch):
    mesh = random_triangles(300, 6)
    rays = atra.Rays(*np.random.default_rng(0).normal(size=(2, 500, 3)))
    monkeypatch.setattr(finding, "BATCH", 100)

    def interrupt(done, all_rays):
        raise KeyboardInterrupt

    with atra.RayScene(mesh, threads=2) as scene:
        expected = scene.all_hits(rays)
        for call in (scene.all_hits, scene.count):
            with pytest.raises(KeyboardInterrupt):
                call(rays, progress=interrupt)
        assert scene.all_hits(rays).t.tobytes() == expected.t.tobytes()


def test_rays_as_one_array_keep_their_shape():
    mesh = cornell_box()
    random = np.random.default_rng(0)
    flat = random.uniform(-1, 1, (24, 6))
    rays = np.asfortranarray(flat.reshape(2, 3, 4, 6))
    with atra.RayScene(mesh, threads=1) as scene:
        expected = scene.intersect(flat[:, :3], flat[:, 3:], tfar=2.0)
        found = scene.intersect(rays, tfar=np.full((2, 3, 4), 2.0))
        for name in ("t", "prim_id", "geometry_id", "u", "v", "hit"):
            assert getattr(found, name).shape == (2, 3, 4)
            np.testing.assert_array_equal(getattr(found, name).reshape(-1), getattr(expected, name))
        np.testing.assert_array_equal(scene.occluded(rays, tfar=2.0).reshape(-1), expected.hit)
        assert (found.t[~found.hit] == np.inf).all()
        assert (found.prim_id[~found.hit] == atra.MISS).all()
        assert scene.count(rays).shape == scene.all_hits(rays).counts.shape == (2, 3, 4)
        assert scene.gather(atra.Layers(2), rays).t.shape == (2, 2, 3, 4)
        for wrong in (np.zeros((3, 5)), 1.0, [[1, 2], [3]]):
            with pytest.raises(atra.InputError):
                scene.all_hits(wrong)
        with pytest.raises(atra.InputError, match="tnear has shape"):
            scene.all_hits(rays, tnear=np.zeros(24))


def test_arrays_of_any_kind_are_taken_and_rays_that_are_none_refused():
    mesh = box()
    with atra.RayScene(mesh, threads=1) as scene:
        whole = scene.count(np.array([[0, 0, -3]]), np.array([[0, 0, 1]]))
        strided = np.zeros((1, 12))[:, ::2]
        strided[0] = (0, 0, -3, 0, 0, 1)
        assert whole.tolist() == scene.count(strided).tolist() == [2]
        assert scene.count(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
        assert len(scene.all_hits(np.zeros((0, 6)))) == 0
        for direction in ((0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0)):
            for call in (scene.all_hits, scene.count):
                with pytest.raises(atra.InputError, match="ray 0 has the direction"):
                    call([[0, 0, 0]], [direction])
    for call in (scene.all_hits, scene.count):
        with pytest.raises(atra.ClosedError):
            call([[0, 0, 0]], [[0, 0, 1]])
    with pytest.raises(atra.ClosedError):
        scene.contains([[0, 0, 0]])


def test_faces_without_area_are_never_crossed_and_open_no_mesh():
    cut = trimesh.creation.box()
    flat = np.array([[0, 0, 1], [2, 2, 2], [0, 1, 0]])
    mesh = atra.Mesh(cut.vertices, np.concatenate([flat, cut.faces]))
    with atra.RayScene(mesh, threads=1) as scene:
        hits = scene.all_hits(*whole_rays(atra.Mesh(cut.vertices * 2, cut.faces), 300, 0))
        assert (hits.prim_id >= 3).all()
        assert scene.contains([[0, 0, 0.1], [0, 0, 0.6]]).tolist() == [True, False]
    with atra.RayScene(atra.Mesh(cut.vertices, flat), threads=1) as scene:
        assert scene.count(np.zeros((3, 3)), np.eye(3)).tolist() == [0, 0, 0]


def test_of_several_meshes_each_hit_names_its_own():
    one, other = box(), sphere()
    moved = np.concatenate([np.eye(3) * 0.5, [[3.0], [0], [0]]], axis=1)
    transforms = np.stack([np.eye(3, 4), np.eye(3, 4), moved])
    random = np.random.default_rng(0)
    origins = random.uniform(-2, 4, (2000, 3))
    directions = random.normal(size=(2000, 3))
    placed = atra.Mesh(other.vertices * 0.5 + (3, 0, 0), other.faces)
    with atra.RayScene([one, other, other], transforms=transforms, threads=1) as scene:
        hits, first = scene.all_hits(origins, directions), scene.intersect(origins, directions)
        for geometry_id, mesh in enumerate((one, other, placed)):
            with atra.RayScene(mesh, threads=1) as alone:
                expected = alone.all_hits(origins, directions)
            own = hits.geometry_id == geometry_id
            assert (hits.prim_id[own] == expected.prim_id).all()
            assert (hits.ray_ids[own] == expected.ray_ids).all()
            assert len(expected) > 50
        assert set(first.geometry_id) == {0, 1, 2, atra.MISS}
        assert (first.prim_id[first.geometry_id == 0] < 12).all()
        assert ((first.prim_id == atra.MISS) == (first.geometry_id == atra.MISS)).all()
        layers = scene.gather(atra.Layers(1), origins, directions)
        assert (layers.geometry_id[0] == first.geometry_id).mean() > 0.999
        scene.update([one, other, other], transforms[[0, 2, 1]])
        assert (scene.count(origins, directions) == hits.counts).all()
        with pytest.raises(atra.InputError, match="expected other vertices of the same faces"):
            scene.update([one, other])
    for wrong, message in (
        ({"transforms": np.eye(3)}, "transforms have shape"),
        ({"transforms": [np.full((3, 4), np.nan)]}, "transform 0"),
    ):  # fmt: skip
        with pytest.raises(atra.InputError, match=message):
            atra.RayScene(one, **wrong)
    for wrong in ([], [one, 3], None):
        with pytest.raises(atra.InputError, match=r"expected an atra\.Mesh or a list"):
            atra.RayScene(wrong)
