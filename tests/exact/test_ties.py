"""Where triangles tie, the lowest prim_id wins, whichever method traced them."""

import json
import os
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.exact import ties
from atra.prim_ids import MISS
from experiments.harness.point import make_own
from experiments.methods import find_method
from experiments.results.terminal import say_label
from experiments.workloads.rounds import make_single
from tests.harness.processes.test_launch import POINT
from tests.images import assert_no_pixel_wrong, make_tracer, trace, trace_pixels
from tests.judge.reference import brute_force
from tests.machine import WIDTHS
from tests.meshes import EYE_AT_ORIGIN, cornell_box, joined, quads, random_triangles

TRACED = {
    **{f"packets of {width}": ("pixels", (1, 1), {"packet_width": width}) for width in WIDTHS},
    "pixels, low quality, two threads": ("pixels", (1, 1), {"build_quality": "low", "threads": 2}),
    "aligned": ("aligned", (8, 1), {}),
    "aligned, single rays": ("aligned", (4, 3), {"packet_width": 1}),
    "aligned, two threads": ("aligned", (1, 4), {"threads": 2}),
    "aligned, not culled": ("unculled", (24, 2), {}),
    "instanced": ("instanced", (8, 2), {}),
    "visible first": ("visible_first", (8, 1), {}),
    "visible first, empty probe, two threads": ("unprobed", (4, 1), {"threads": 2}),
}
each_traced = pytest.mark.parametrize(("method", "split", "options"), TRACED.values(), ids=TRACED)


def tilted(u, v, lift=0.0):
    """A point of a plane that lies along no axis and is exact in float32: coordinates are multiples of 1/64."""
    return (u, v, 4 + 0.5 * u - 0.25 * v + lift)


def rectangle(left, right, bottom, top, lift=0.0, place=tilted):
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return [place(u, v, lift) for u, v in corners]


def facing(u, v, lift=0.0):
    """The same on the wall z = 4, which lies along the axes."""
    return (u, v, 4 + lift)


def reordered(mesh, order=(1, 2, 0), turned=False):
    """The same triangles with their corners in another order; turned: seen from the back."""
    faces = mesh.faces[:, list(order)]
    return atra.Mesh(mesh.vertices, faces[:, ::-1] if turned else faces)


def other_diagonal(corners):
    return atra.Mesh(corners, [[1, 2, 3], [1, 3, 0]])


def fan(corners, centre):
    """The quadrilateral as four triangles around a point within."""
    return atra.Mesh([*corners, centre], [[4, 0, 1], [4, 1, 2], [4, 2, 3], [4, 3, 0]])


def strips(place):
    """Two walls of strips that cross at right angles, and a third wall of two triangles, all in one plane."""
    across = quads([rectangle(-8, 8, y, y + 1, place=place) for y in range(-8, 8)])
    along = quads([rectangle(x, x + 0.75, -8, 8, place=place) for x in range(-8, 8)])
    return joined(quads([rectangle(-1, 3, -3, 2, place=place)]), along, across)


WALL = rectangle(-8, 8, -8, 8)
FACING_WALL = rectangle(-8, 8, -8, 8, place=facing)
DECAL = quads([rectangle(-1.25, 1.5, -1.0, 1.75, place=facing)])

TIED = {
    "a wall twice": joined(quads([WALL]), quads([WALL])),
    "a wall and its back": joined(quads([WALL]), reordered(quads([WALL]), turned=True)),
    "corners in other orders": joined(
        reordered(quads([WALL]), (2, 0, 1)), reordered(quads([WALL])), reordered(quads([WALL]), turned=True)
    ),
    "the other diagonal": joined(quads([WALL]), other_diagonal(WALL)),
    "the other diagonal, facing": joined(other_diagonal(FACING_WALL), quads([FACING_WALL])),
    "a stack of three tessellations, twice": joined(
        *2 * [fan(WALL, tilted(1.5, -0.5)), quads([WALL]), fan(WALL, tilted(-2, 1))]
    ),
    "a decal below its wall in number": joined(DECAL, quads([FACING_WALL])),
    "a decal above its wall in number": joined(quads([FACING_WALL]), DECAL),
    "a decal between two walls": joined(other_diagonal(FACING_WALL), DECAL, quads([FACING_WALL])),
    "crossing strips": strips(tilted),
    "crossing strips, facing": strips(facing),
    "every wall of a room twice": joined(cornell_box(), reordered(cornell_box(), turned=True)),
}


def camera_before(mesh):
    if mesh.triangle_count > 1000:
        return atra.Camera((0.011, 0.8, 2.3), (0.02, 0.83, -1.0), (0, 1, 0), 45, width=48, height=24)
    return atra.Camera((0.1, 0.2, -0.3), (0.3, 0.1, 4), (0, 1, 0), 70, width=48, height=24)


# No ray passes so close to an edge of the meshes above that float32 could take either side.
OFFSETS = [(0.37, 0.61), (0.513, 0.129)]


@cache
def reference(scene, offset):
    return brute_force(TIED[scene], camera_before(TIED[scene]), offset)


def pairs_of(mesh):
    """What was found, as {(triangle, lower partner)}; twins are spelt out as partners."""
    found = ties.coplanar_overlaps(mesh)
    pairs = {(t, int(twin)) for t, twin in enumerate(found.twins) if twin != t}
    for t in range(mesh.triangle_count):
        pairs |= {(t, int(p)) for p in found.partners[found.starts[t] : found.starts[t + 1]]}
    return pairs


@pytest.mark.core
@each_traced
@pytest.mark.parametrize("scene", TIED)
def test_every_method_stores_the_lowest_triangle_bit_for_bit(scene, method, split, options):
    hits = None
    with make_tracer(method, TIED[scene], camera_before(TIED[scene]), split, **options) as tracer:
        for offset in OFFSETS:  # the second into the memory of the first
            hits, expected = tracer.trace(offset, out=hits), reference(scene, offset)
            np.testing.assert_array_equal(hits.prim_id, expected.prim_id)
            np.testing.assert_allclose(hits.depth, expected.depth, rtol=1e-5)


@pytest.mark.parametrize("scene", TIED)
def test_without_the_rule_some_method_stores_another_triangle(scene):
    expected = reference(scene, OFFSETS[0]).prim_id
    images = (
        trace(method, TIED[scene], camera_before(TIED[scene]), split, OFFSETS[0], ties="any", **options)
        for method, split, options in TRACED.values()
    )
    assert any((image.prim_id != expected).any() for image in images)


@each_traced
def test_a_wall_a_millionth_nearer_is_not_tied_and_wins_whatever_its_number(method, split, options):
    for place in (tilted, facing):
        far, near = quads([rectangle(-8, 8, -8, 8, place=place)]), quads([rectangle(-8, 8, -8, 8, -4e-6, place)])
        mesh = joined(far, near)
        assert not pairs_of(mesh)
        hits = trace(method, mesh, camera_before(mesh), split, OFFSETS[0], **options)
        assert set(np.unique(hits.prim_id[hits.hit])) == {2, 3}


@pytest.mark.parametrize(("distance", "winners"), [(4.0, {0, 1}), (1e-4, {2, 3})])
def test_equally_deep_depends_on_the_distance_of_the_eye(distance, winners):
    # Around zero float32 can put two walls a ten-billionth apart: one plane from afar, two from very near.
    walls = [[(x, y, z) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))] for z in (0.0, -1e-10)]
    mesh = joined(quads(walls[:1]), quads(walls[1:]))
    assert pairs_of(mesh) == {(2, 0), (3, 1)}
    camera = atra.Camera((0.01, 0.02, -distance), (0.01, 0.02, 0), (0, 1, 0), 20, width=16, height=16)
    assert set(np.unique(trace("pixels", mesh, camera, offset=OFFSETS[0]).prim_id)) <= winners


@pytest.mark.parametrize("mesh", [
    quads([WALL]), fan(WALL, tilted(1.5, -0.5)), quads([FACING_WALL]), random_triangles(2000, 3),
    quads([rectangle(x, x + 1, y, y + 1, place=facing) for x in range(9) for y in range(9)]),
])  # fmt: skip
def test_neighbours_that_share_an_edge_or_a_corner_do_not_overlap(mesh):
    assert not pairs_of(mesh)
    assert not ties.coplanar_overlaps(mesh).may_tie.any()
    assert not ties.tie_tiles(mesh, camera_before(mesh)).any


def test_triangles_without_area_overlap_nothing_and_a_mesh_may_hold_nothing_else():
    needles = atra.Mesh([(0, 0, 4), (1, 0, 4), (2, 0, 4)], [[0, 1, 2], [2, 1, 0], [0, 0, 0]])
    assert not pairs_of(needles)
    assert not pairs_of(atra.Mesh([(1, 2, 3)], [[0, 0, 0]]))
    assert pairs_of(joined(needles, quads([FACING_WALL]), quads([FACING_WALL]))) == {(5, 3), (6, 4)}


def side(p, q, r):
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])


def share_an_area(a, b):
    """Two triangles of whole numbers in the plane: no line along an edge has them on different sides. Exact."""
    for one, other in ((a, b), (b, a)):
        turn = side(*one)
        for i in range(3):
            if all(side(one[i], one[(i + 1) % 3], corner) * turn <= 0 for corner in other):
                return False
    return True


@pytest.mark.parametrize("seed", range(9))
def test_the_overlaps_of_random_triangles_in_one_plane_are_those_of_exact_arithmetic(seed):
    random = np.random.default_rng(seed)
    basis = random.integers(-5, 6, (2, 3))
    while not np.cross(*basis).any():
        basis = random.integers(-5, 6, (2, 3))
    flat = random.integers(-6, 7, (60, 3, 2)) // (1 + seed % 3)  # coarse grids have many neighbours and twins
    flat = flat[[side(*t) != 0 for t in flat.tolist()]]
    vertices = (random.integers(-9, 10, 3) + flat @ basis).reshape(-1, 3) / 8
    mesh = atra.Mesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    corners = [sorted(map(tuple, t)) for t in flat.tolist()]
    twins = [corners.index(t) for t in corners]
    expected = {(t, twin) for t, twin in enumerate(twins) if t != twin}
    alone = [t for t, twin in enumerate(twins) if t == twin]
    expected |= {(t, p) for t in alone for p in alone if p < t and share_an_area(corners[t], corners[p])}
    assert len(expected) > 100
    assert pairs_of(mesh) == expected
    found = ties.coplanar_overlaps(mesh)
    for start, end in pairwise(found.starts):
        assert (np.diff(found.partners[start:end].astype(int)) > 0).all()


def test_planes_that_are_not_the_same_have_no_overlaps():
    random = np.random.default_rng(5)
    walls = [quads([rectangle(-8, 8, -8, 8, lift=k / 16)]) for k in range(-20, 20)]
    assert not pairs_of(joined(*walls))
    turned = random.normal(size=(200, 3, 3))
    turned[:, 0] = 0  # all through one point
    assert not pairs_of(atra.Mesh(turned.reshape(-1, 3), np.arange(600).reshape(-1, 3)))


def test_a_stack_of_many_equal_triangles_needs_no_list_of_pairs():
    stack = atra.Mesh([(-8, -8, 4), (8, -8, 4), (0, 8, 4)], [[0, 1, 2], [1, 0, 2]] * 20_000)
    found = ties.coplanar_overlaps(stack)
    assert not found.twins.any()
    assert not len(found.partners)
    camera = atra.Camera(**EYE_AT_ORIGIN, width=16, height=16)
    assert not trace("pixels", stack, camera, offset=OFFSETS[0]).prim_id.any()


def test_more_overlaps_than_can_be_kept_are_refused_and_may_be_traced_without_the_rule(monkeypatch):
    monkeypatch.setattr(ties, "MOST_PAIRS", 20)
    mesh = strips(facing)
    camera = camera_before(mesh)
    with pytest.raises(atra.MemoryBudgetError, match=r'more than 20 pairs .* trace it with ties "any"'):
        atra.AlignedTracer(mesh, camera, (8, 1)).build()
    assert trace("aligned", mesh, camera, (8, 1), ties="any").hit.any()


@pytest.mark.parametrize("seed", range(4))
def test_every_tie_lies_in_a_tile_that_is_looked_at(seed):
    some = random_triangles(60, seed, size=0.6)  # before, behind and through the eye
    mesh = joined(some, reordered(some, turned=True), TIED["a decal below its wall in number"])
    camera = atra.Camera(**EYE_AT_ORIGIN, width=120, height=70, fov_y_degrees=[20, 60, 90, 150][seed])
    pool = WorkerPool(1)
    tiles = ties.tie_tiles(mesh, camera)
    assert tiles.marked.shape == (5, 8)
    everywhere_looked_at = ties.TieTiles.of(np.ones_like(tiles.marked))
    for offset in [(0.0, 0.0), (0.999999, 0.999999)]:
        traced = trace("pixels", mesh, camera, offset=offset, ties="any").prim_id
        everywhere, looked_at = traced.copy(), traced.copy()
        ties.lowest_of_ties(mesh, camera, everywhere_looked_at, offset, everywhere, pool)
        ties.lowest_of_ties(mesh, camera, tiles, offset, looked_at, pool)
        assert (everywhere != traced).any()
        np.testing.assert_array_equal(looked_at, everywhere)


def test_a_floor_below_many_boxes_is_tested_against_those_of_its_tile_only_and_ties_as_against_all():
    """Boxes' bottoms lie in the floor's plane and come before it in number; some reach behind the eye."""
    squares = [[(x, -1, z), (x + 0.2, -1, z), (x + 0.2, -1, z + 0.2), (x, -1, z + 0.2)]
               for x in np.arange(-3, 3, 0.3) for z in np.arange(-1, 6, 0.3)]  # fmt: skip
    mesh = joined(quads(squares), quads([[(-9, -1, -9), (9, -1, -9), (9, -1, 9), (-9, -1, 9)]]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=120, height=70, fov_y_degrees=80)
    tiles = ties.tie_tiles(mesh, camera)
    assert len(tiles.listed)
    assert np.diff(tiles.firsts).max() < len(squares)
    floor = np.where(trace("pixels", mesh, camera, ties="any").hit, 2 * len(squares), MISS).astype(np.uint32)
    listed, all_tested, pool = floor.copy(), floor.copy(), WorkerPool(1)
    ties.lowest_of_ties(mesh, camera, tiles, (0.5, 0.5), listed, pool)
    ties.lowest_of_ties(mesh, camera, ties.TieTiles.of(tiles.marked), (0.5, 0.5), all_tested, pool)
    assert len(np.unique(listed)) > 20
    np.testing.assert_array_equal(listed, all_tested)


def test_a_tie_that_reaches_the_plane_of_the_eye_may_be_anywhere_and_one_behind_it_nowhere():
    for z, everywhere in (([0, 4, 4], True), ([-1, 4, 4], True), ([-1, -4, -4], False)):
        corners = [(x, y, depth) for x, y, depth in zip((-1, 1, 1), (-1, -1, 1), z, strict=True)]
        mesh = atra.Mesh(corners, [[0, 1, 2], [1, 2, 0]])
        tiles = ties.tie_tiles(mesh, atra.Camera(**EYE_AT_ORIGIN, width=100, height=70)).marked
        assert tiles.shape == (5, 7)
        assert tiles.all() if everywhere else not tiles.any()


def test_a_small_decal_makes_only_its_own_tiles_worth_a_look():
    mesh = joined(quads([rectangle(-0.1, 0.1, -0.1, 0.1, place=facing)]), quads([FACING_WALL]))
    camera = atra.Camera(**EYE_AT_ORIGIN, width=160, height=160)
    assert 1 <= ties.tie_tiles(mesh, camera).marked.sum() <= 4


@pytest.mark.parametrize("rule", ["lowest", "any"])
@pytest.mark.parametrize("method", ["pixel", "aligned", "visible_first", "tiles"])
def test_a_point_is_traced_by_the_rule_it_names(method, rule):
    kind = find_method(method)
    point = replace(POINT, method=kind, options=kind.resolve(kind.options(), POINT.width), ties=rule)
    for make in (make_own, make_single):
        with make(point, cornell_box(), point.camera) as tracer:
            assert tracer.options.ties == rule
    assert ("ties any" in say_label(point)) == (rule == "any")


@pytest.mark.skipif("ATRA_SCENES" not in os.environ, reason="needs the scene sponza")
def test_sponza_has_no_ties_left_but_on_shared_edges():
    folder = Path(os.environ["ATRA_SCENES"])
    mesh = atra.load_mesh(folder / "sponza.ply")
    fields = json.loads((folder / "cameras.json").read_text())["sponza"]
    camera = atra.Camera(**fields, width=1024, height=1024)
    tied = []
    for rule in ("any", "lowest"):
        single = trace_pixels(mesh, camera, ties=rule)
        hits = trace("aligned", mesh, camera, (128, 1), ties=rule)
        tied.append(assert_no_pixel_wrong(mesh, camera, hits, single).pixels_tied)
    assert tied[1] < 10
    assert tied[0] > 50  # how many depends on the order in which Embree finds them


@pytest.mark.core
def test_every_frame_and_parallel_rays_show_the_lowest_of_twins():
    walls = quads([[(-3, -3, z), (3, -3, z), (3, 3, z + 1), (-3, 3, z + 1)] for z in (5, 5)])
    mesh = joined(reordered(walls, turned=True), reordered(walls))
    cameras = [atra.Camera(**EYE_AT_ORIGIN, width=32, height=24, fov_y_degrees=fov) for fov in (30, 40)]
    alignment = atra.Alignment.of_frames(cameras, atra.Split(8, 1, 32, 24))
    with atra.FramesTracer(mesh, alignment, threads=1) as tracer:
        assert set(np.unique(tracer.trace().prim_id)) <= {0, 1}
    flat = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=4.0, width=32, height=24)
    for method in ("pixels", "aligned"):
        assert set(np.unique(trace(method, mesh, flat, (8, 1)).prim_id)) <= {0, 1}
