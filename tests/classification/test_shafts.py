"""Ray classification: lists hold all that rays of a shaft may hit, as Algorithm 1 orders it, and no hit is lost."""

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.geometry.mesh import Mesh
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.single import BOXES, FROM_ROOT, PROVEN, STEPS
from experiments.classification.bvh.starts import FIRST_LIST, PASSES, UNKNOWN
from experiments.classification.options import SUBSETS, BvhOptions, ClassifiedOptions
from experiments.classification.ray_sets import KINDS, ray_set
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.shafts.shafts import build_shafts, grid_of
from experiments.classification.tracer import BvhTracer
from tests.images import assert_no_pixel_wrong, assert_same_bits
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, quads, random_triangles
from tests.raster.test_raster import PARALLEL
from tests.rays.test_ray_scene import nearest_in_float64
from tests.trees.test_trees import MESHES, below, built, deep_mesh

POOL = WorkerPool(1)


def shafts(cells=27, directions=2, **options):
    """Options of classified rays, without their prefix."""
    named = {name if name in ("traversal", "ray_order") else f"shaft_{name}": one for name, one in options.items()}
    return ClassifiedOptions(shaft_cells=cells, shaft_directions=directions, **named)


def traced(mesh, camera, options=None, offset=(0.5, 0.5)):
    with BvhTracer(mesh, camera, options, threads=1) as tracer:
        return tracer.trace(offset)


def plain_scene(mesh):
    return BvhScene(mesh, BvhOptions(), 1)


def lists_of(bvh, **options):
    return build_shafts(bvh, shafts(**options), POOL)


def list_at(lists, number):
    """Nodes of a shaft's list, the first to be popped last."""
    shafts, of_voxel = lists.shafts, 6 * lists.shafts.grid.directions**2
    start = shafts.table[shafts.rows[number // of_voxel], number % of_voxel]
    return shafts.lists[start + 1 :][: shafts.lists[start]].tolist()


def random_rays(count, seed, spread=3.0):
    random = np.random.default_rng(seed)
    return atra.Rays(random.uniform(-spread, spread, (count, 3)), random.normal(size=(count, 3)))


VIEWS = {
    "pinhole": [
        (MESHES["random"], atra.Camera(**EYE_AT_ORIGIN, width=41, height=23, fov_y_degrees=150)),
        (cornell_box(), cornell_camera(41, 23)),  # from outside
    ],
    "parallel": [(MESHES["random"], PARALLEL)],
}
TRAVERSALS_AND_VIEWS = [("pop", "pinhole"), ("push", "parallel")]


@pytest.mark.core
@pytest.mark.parametrize(("traversal", "views"), TRAVERSALS_AND_VIEWS)
def test_rays_from_lists_hit_what_they_hit_from_the_root(traversal, views):
    for mesh, camera in VIEWS[views]:
        for offset in ((0.5, 0.5), (0.0, 0.7)):
            hits = traced(mesh, camera, shafts(traversal=traversal), offset)
            assert_same_bits(hits, traced(mesh, camera, None, offset))
            assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera, offset))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ray_order", ["image", "shaft"])
def test_batches_hit_the_same_with_every_subset_of_shafts(kind, ray_order):
    mesh, camera = MESHES["random"], atra.Camera(**EYE_AT_ORIGIN, width=41, height=23, fov_y_degrees=120)
    rays = ray_set(kind, mesh, camera, traced(mesh, camera))
    depth, prim_id = nearest_in_float64(mesh, rays)
    with plain_scene(mesh) as scene:
        expected, occluded = scene.intersect(scene.prepare(rays)), scene.occluded(scene.prepare(rays))
    same = expected.prim_id == prim_id
    assert same.mean() > 0.999
    np.testing.assert_allclose(expected.t[same & expected.hit], depth[same & expected.hit], rtol=1e-4)
    np.testing.assert_array_equal(occluded[same], prim_id[same] != atra.MISS)
    for subset in SUBSETS:
        with ShaftScene(mesh, shafts(subset=subset, ray_order=ray_order), 1) as scene:
            prepared = scene.prepare(rays)
            hits, counted = scene.intersect(prepared), scene.count(prepared)
            np.testing.assert_array_equal(hits.t, expected.t)
            np.testing.assert_array_equal(hits.prim_id, expected.prim_id)
            np.testing.assert_array_equal(counted[0], expected.prim_id)
            np.testing.assert_array_equal(scene.occluded(prepared), occluded)
            from_root = counted[1][FROM_ROOT]
            assert counted[1][STEPS] == counted[1][BOXES]
            if subset in ("complete", "hits") or (subset == "occupied" and kind != "primary"):
                assert from_root == 0  # secondary rays start where triangles are
            elif subset == "sampled":
                assert 0 < from_root < len(rays)


@pytest.mark.parametrize("factor", [1.0, 1e6])
def test_rays_on_the_borders_of_voxels_and_of_directions_are_not_lost(factor):
    mesh = atra.Mesh(random_triangles(400, 3, size=2.0).vertices * factor, random_triangles(400, 3, size=2.0).faces)
    grid = grid_of(built(mesh), 27, 2)
    random = np.random.default_rng(0)
    places = grid.low + random.integers(0, grid.voxels + 1, (4000, 3)) * grid.size
    free = random.uniform(grid.low, grid.high, (4000, 3))
    on_border = random.random((4000, 3)) < 0.7
    slopes = random.choice([-1.0, -0.5, 0.0, 0.5, 1.0], (4000, 3))
    slopes[np.arange(4000), random.integers(0, 3, 4000)] = random.choice([-1.0, 1.0], 4000)
    rays = atra.Rays(np.where(on_border, places, free), slopes)
    with plain_scene(mesh) as scene, ShaftScene(mesh, shafts(), 1) as seeded:
        expected, found = scene.intersect(scene.prepare(rays)), seeded.intersect(seeded.prepare(rays))
    np.testing.assert_array_equal(found.prim_id, expected.prim_id)
    np.testing.assert_array_equal(found.t, expected.t)
    assert expected.hit.sum() > 500


def test_with_voxels_smaller_than_they_are_hits_are_lost():
    mesh = random_triangles(400, 3, size=0.05)
    bvh = built(mesh)
    grid = grid_of(bvh, 27, 2)
    whole, tight = (build_shafts(bvh, shafts(), POOL, grid=grid._replace(slack=slack)) for slack in (grid.slack, -0.1))
    held = [[set(under(bvh, list_at(lists, number))) for number in range(lists.count)] for lists in (whole, tight)]
    assert any(more - fewer for more, fewer in zip(*held, strict=True))


def under(bvh, nodes):
    return [prim_id for node in nodes for prim_id in below(bvh, node)]


@pytest.mark.parametrize("seed", range(2))
def test_every_triangle_that_rays_of_a_shaft_hit_lies_below_its_list(seed):
    mesh = random_triangles(150, seed)
    lists, bvh = lists_of(built(mesh)), built(mesh)
    rays = random_rays(3000, seed)
    with ShaftScene(mesh, shafts(), 1) as scene:
        numbers = scene.classified(scene.prepare(rays).batch)
    _, prim_id = nearest_in_float64(mesh, rays)
    for number in np.unique(numbers[numbers >= 0]):
        hit = prim_id[(numbers == number) & (prim_id != atra.MISS)]
        assert set(hit) <= set(under(bvh, list_at(lists, number)))
    assert (prim_id[numbers == PASSES] == atra.MISS).all()


def row_of_quads():
    """Eight squares across the x axis, at x = 0 to 7."""
    return quads([[(x, -1, -1), (x, 1, -1), (x, 1, 1), (x, -1, 1)] for x in range(8)])


def test_lists_of_a_tree_made_by_hand_are_those_of_algorithm_1():
    mesh = row_of_quads()
    bvh = built(mesh)
    # Two voxels along the row, one cell a face: from the first one towards +x rays meet everything, and from the last
    # one, whose shafts are 6 to 11, towards -x.
    ahead = {"cells": 2, "directions": 1, "rays": 20}
    opened = lists_of(bvh, **ahead, probability=1e-9, occlusion=False)
    leaves = [node for node in range(2, len(bvh.nodes)) if bvh.block_counts[node]]
    for number, sign in ((0, 1), (7, -1)):
        listed = list_at(opened, number)
        places = [sign * bvh.boxes[node, 0, 0] for node in listed]
        assert sorted(listed) == sorted(leaves)
        assert places == sorted(places, reverse=True)  # the far ones first
    closed = lists_of(bvh, **ahead, probability=1.0, list=1)
    assert list_at(closed, 0) == list_at(closed, 7) == [0]
    assert list_at(closed, 1) == [2]  # of the root's children only the first is met
    # A list that is too long is made shorter by a higher probability, and never cut.
    short = lists_of(bvh, **ahead, probability=1e-9, list=len(leaves) - 1, occlusion=False)
    assert sorted(under(bvh, list_at(short, 0))) == list(range(16))
    assert short.lengths.max() < len(leaves)


def test_nodes_of_which_a_shaft_meets_one_child_give_way_to_it():
    """Two crowds far apart: shafts that start within one and head away from the other never name what is above both."""
    mesh = random_triangles(40, 0, size=0.2, spread=0.5)
    both = atra.Mesh(np.concatenate([mesh.vertices, mesh.vertices + np.float32([50, 0, 0])]),
                     np.concatenate([mesh.faces, mesh.faces + len(mesh.vertices)]))  # fmt: skip
    bvh = built(both)
    lists = lists_of(bvh, cells=50, directions=1, probability=1.0)
    voxels = lists.shafts.grid.voxels
    of_last = 6 * (int(voxels.prod()) - 1)  # towards +x, from the last voxel
    assert voxels[0] > 10
    assert set(under(bvh, list_at(lists, of_last))) <= set(range(40, 80))
    empty = [number for number in range(0, lists.count, 6) if number // 6 % voxels[0] == voxels[0] // 2]
    assert all(0 not in list_at(lists, number) for number in empty)


def test_equal_lists_are_stored_once_and_hidden_nodes_are_not_opened():
    mesh = row_of_quads()
    bvh = built(mesh)
    lists = lists_of(bvh, cells=1, directions=2)
    unique = {tuple(list_at(lists, number)) for number in range(lists.count)} - {()}
    assert lists.lists_unique == len(unique) < lists.count
    assert lists.list_bytes == 4 * (FIRST_LIST + sum(1 + len(one) for one in unique))
    seeing = lists_of(bvh, cells=64, directions=2, occlusion=False)
    hiding = lists_of(bvh, cells=64, directions=2)
    assert hiding.lengths.sum() < seeing.lengths.sum()


def test_a_box_that_is_missed_is_proven_and_a_ray_from_too_far_away_starts_at_the_root():
    mesh = row_of_quads()
    origins = [(-5.0, 0.1, 0.1), (-5.0, 9.0, 0.0), (-1e6, 0.1, 0.1)]
    rays = atra.Rays(origins, [(1.0, 0.0, 0.0)] * 3)
    with ShaftScene(mesh, shafts(), 1) as scene:
        prepared = scene.prepare(rays)
        hits, (_, counts) = scene.intersect(prepared), scene.count(prepared)
        numbers = scene.classified(prepared.batch)
    np.testing.assert_array_equal(hits.hit, [True, False, True])
    assert (counts[PROVEN], counts[FROM_ROOT]) == (1, 1)
    assert numbers[0] >= 0
    assert (numbers[1], numbers[2]) == (PASSES, UNKNOWN)


WITHOUT_AREA = Mesh(np.array([(0, 0, 1), (1, 0, 1), (2, 0, 1)]), np.array([[0, 1, 2]]))


@pytest.mark.parametrize("mesh", [*(MESHES[name] for name in ("flat", "one", "one box")), WITHOUT_AREA])
def test_meshes_that_are_flat_or_empty_lose_nothing(mesh):
    rays = random_rays(500, 1, spread=4.0)
    with plain_scene(mesh) as scene, ShaftScene(mesh, shafts(), 1) as seeded:
        expected, hits = scene.intersect(scene.prepare(rays)), seeded.intersect(seeded.prepare(rays))
    np.testing.assert_array_equal(hits.prim_id, expected.prim_id)
    assert expected.hit.any() == (mesh is not WITHOUT_AREA)
    assert mesh is not MESHES["flat"] or 1 in grid_of(built(mesh), 27, 2).voxels


@pytest.mark.parametrize("subset", ["complete", "occupied"])
def test_lists_and_look_up_keep_to_their_budget(subset):
    bvh = built(random_triangles(3000, 1))
    lists = build_shafts(bvh, shafts(None, memory=0.5, subset=subset, rays=4), POOL)
    assert 0.1 * bvh.bytes < lists.lookup_bytes + lists.list_bytes <= 0.5 * bvh.bytes
    with pytest.raises(atra.MemoryBudgetError, match="shafts of a single voxel with shaft_directions=64"):
        build_shafts(built(row_of_quads()), shafts(None, 64), POOL)


def test_more_shafts_than_memory_holds_are_refused_before_anything_is_made():
    with pytest.raises(atra.InputError, match="voxels; expected fewer than 16,777,216"):
        lists_of(built(row_of_quads()), cells=10**9)
    with pytest.raises(atra.MemoryBudgetError, match="shafts"):
        lists_of(built(row_of_quads()), cells=10**7, directions=1024)


def test_a_tree_as_deep_as_the_stack_is_high_is_traced():
    """Triangles each twice as far away as the one before, seen by rays that pass many of their boxes."""
    mesh = deep_mesh()
    random = np.random.default_rng(0)
    aims = mesh.vertices[mesh.faces[random.integers(0, mesh.triangle_count, 400)]].astype(np.float64).mean(axis=1)
    origins = aims * random.choice([(0, 0, 0), (1, 1, 2)], 400)
    rays = atra.Rays(origins, (aims - origins) / np.abs(aims).max(axis=1, keepdims=True))
    with plain_scene(mesh) as scene, ShaftScene(mesh, shafts(), 1) as seeded:
        expected, hits = scene.intersect(scene.prepare(rays)), seeded.intersect(seeded.prepare(rays))
    np.testing.assert_array_equal(hits.prim_id, expected.prim_id)
    assert expected.hit.any()


@pytest.mark.parametrize(("options", "message"), [
    ({"cells": 0}, "method.shaft_cells is 0, expected a whole number of at least 1"),
    ({"list": 256}, "shaft_list is 256, expected a whole number from 1 to 255"),
    ({"directions": 1025}, "shaft_directions is 1025, expected a whole number from 1 to 1024"),
    ({"probability": 0.0}, "shaft_probability is 0.0, expected more than 0 and at most 1"),
    ({"share": 1.5}, "shaft_share is 1.5"),
    ({"memory": 0.0}, "shaft_memory is 0.0"),
    ({"subset": "some"}, "shaft_subset is 'some', expected one of complete, occupied"),
    ({"subset": "hits"}, "shaft_subset is 'hits', which depends on rays"),
])  # fmt: skip
def test_options_that_cannot_be_are_named(options, message):
    with pytest.raises(atra.InputError, match=message):
        BvhTracer(cornell_box(), cornell_camera(8, 8), shafts(**options))


def test_sets_of_rays_are_the_same_every_time_and_of_no_other_kind():
    mesh, camera = cornell_box(), cornell_camera(16, 16)
    hits = traced(mesh, camera)
    for kind in KINDS:
        one, other = ray_set(kind, mesh, camera, hits), ray_set(kind, mesh, camera, hits)
        assert (one.origins == other.origins).all()
        assert (one.directions == other.directions).all()
    with pytest.raises(atra.InputError, match="kind of rays is 'x', expected one of primary, occlusion, diffuse"):
        ray_set("x", mesh, camera, hits)


@pytest.mark.parametrize("scale", [0.1, 0.3, 0.7, 1.0, 3.0, 1e7])
def test_one_voxel_is_made_of_a_cube_and_never_more_than_were_asked_for(scale):
    cube = random_triangles(40, 0)
    vertices = np.clip(cube.vertices, -1.0, 1.0) * scale
    vertices[0], vertices[1] = -scale, scale
    bvh = built(atra.Mesh(vertices, cube.faces))
    for cells in range(1, 30):
        assert 1 <= grid_of(bvh, cells, 1).voxels.prod() <= cells
    assert (grid_of(bvh, 27, 1).voxels >= 2).all()
