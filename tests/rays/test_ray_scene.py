"""Batches of rays: every one is answered as if it were alone, in every packet width, and as float64 would."""

import pickle
import threading
from itertools import pairwise

import numpy as np
import pytest

import atra
import atra.rays.kernel_scene
import atra.rays.order
import atra.rays.tree.finding
from atra.compiled.instruction_sets import chosen_instruction_set, cpu_features
from atra.compiled.threads import WorkerPool
from atra.embree.layout import FLAG_COHERENT
from atra.exact.intersection import FLOAT64_TOLERANCE, intersect_rays
from atra.rays.embree_kernels import CHUNK, embree_kernel
from atra.rays.order import RayOrder, box_of
from atra.rays.order_kernels import CELLS, SORTED_CHUNK
from experiments.workloads.brute_force import near_pairs, nearest_of
from tests.images import assert_no_pixel_wrong, assert_same_bits, trace
from tests.machine import WIDEST, WIDTHS
from tests.meshes import EYE_AT_ORIGIN, boards, cornell_box, cornell_camera, quads, random_triangles
from tests.packets.test_axis_near_views import closed_box
from tests.tracing.test_lifetimes import in_threads

UNIT = 2.0**-24
each_native = pytest.mark.parametrize("width", WIDTHS)
each_width = pytest.mark.parametrize("width", [*WIDTHS, None], ids=[*map(str, WIDTHS), "exact"])
"""Packets of each width, by Embree, and our own tree, which decides exactly."""
each_flag = pytest.mark.parametrize("coherent", [False, True])


def random_rays(count, seed, mesh, length=1.0, **interval):
    """From anywhere in and around the mesh to anywhere; `length`: of the directions, one or (count, 1)."""
    random = np.random.default_rng(seed)
    low, high = mesh.bounds
    margin = np.maximum(0.2 * (high - low), 0.3)
    origins = random.uniform(low - margin, high + margin, (count, 3))
    directions = random.normal(size=(count, 3))
    return atra.Rays(origins, directions / np.linalg.norm(directions, axis=1)[:, None] * length, **interval)


def any_length(count, seed):
    return 10.0 ** np.random.default_rng(seed).uniform(-18, 18, (count, 1))


def scene_of(mesh, width=None, **options):
    options = {"threads": 1, "precision": "exact" if width is None else "watertight"} | options
    return atra.RayScene(mesh, packet_width=width, **options)


def traced(mesh, rays, width=None, *, coherent=False, **options):
    with scene_of(mesh, width, **options) as scene:
        return scene.intersect(rays, coherent=coherent)


def occluded(mesh, rays, width=None, *, coherent=False):
    with scene_of(mesh, width) as scene:
        return scene.occluded(rays, coherent=coherent)


def nearest_in_float64(mesh, rays):
    """(t, prim_id) of the nearest of all triangles behind tnear, by testing all; MISS beyond tfar."""
    origins, directions = rays.origins.astype(np.float64), rays.directions.astype(np.float64)
    start = rays.tnear.astype(np.float64)
    starts = origins + start[:, None] * directions
    ray, face = near_pairs(starts, directions, mesh.triangles(np.arange(mesh.triangle_count)))
    met = intersect_rays(mesh, starts[ray], directions[ray], face)
    depth = np.where(met.edge_distance >= -FLOAT64_TOLERANCE, met.depth, np.inf)
    t, prim_id = nearest_of(len(rays), ray, face, depth)
    prim_id[t + start > rays.tfar] = atra.MISS
    return t + start, prim_id


def judged(mesh, rays, hits):
    """(wrong, excused), bool (N,) each: float32 may decide otherwise than float64 on the rim of a triangle, between
    triangles that are all but equally far, and where the hit is all but at an end of the interval."""
    _, prim_id = nearest_in_float64(mesh, rays)
    one, one_slack, one_rim = candidate(mesh, rays, prim_id)
    other, other_slack, other_rim = candidate(mesh, rays, hits.prim_id)
    with np.errstate(invalid="ignore"):
        close = np.abs(one - other) <= one_slack + other_slack
        wrong_t = hits.hit & ~(np.abs(hits.t - other) <= other_slack)
        ends = [
            np.abs(depth - end) <= slack
            for depth, slack in ((one, one_slack), (other, other_slack))
            for end in (rays.tnear.astype(np.float64), rays.tfar.astype(np.float64))
        ]
    differs = prim_id != hits.prim_id
    excused = differs & (close | one_rim | other_rim | np.any(ends, axis=0)) & ~wrong_t
    assert ((hits.t == np.inf) == ~hits.hit).all()
    return (differs & ~excused) | wrong_t, excused


def candidate(mesh, rays, prim_id):
    """t of each ray's triangle in float64, how far off float32 may find it, and whether the ray meets its rim."""
    t, slack, rim = np.full(len(rays), np.inf), np.zeros(len(rays)), np.zeros(len(rays), bool)
    named = prim_id != atra.MISS
    origins, directions = (part[named].astype(np.float64) for part in (rays.origins, rays.directions))
    found = intersect_rays(mesh, origins, directions, prim_id[named])
    corners = mesh.triangles(prim_id[named])
    edges = corners - np.roll(corners, 1, axis=1)
    far = np.linalg.norm(corners - origins[:, None], axis=2).max(axis=1) + np.linalg.norm(origins, axis=1)
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    facing = np.abs((np.cross(edges[:, 1], edges[:, 2]) * directions).sum(axis=1))
    error = 8 * UNIT * far * longest / facing  # of a volume of an edge, the ray and its origin, over `facing`
    t[named] = found.depth
    slack[named] = error * longest + 16 * UNIT * found.depth
    rim[named] = np.abs(found.edge_distance) <= error * np.linalg.norm(directions, axis=1)
    return t, slack, rim


MESHES = {
    "few": random_triangles(60, 1), "many small": random_triangles(2000, 2, size=0.1), "room": cornell_box(),
    "needles": boards(), "one": random_triangles(1, 3, spread=0.1),
}  # fmt: skip


@pytest.mark.core
@each_width
@each_flag
@pytest.mark.parametrize("name", MESHES)
def test_rays_of_any_length_hit_what_float64_says(name, width, coherent):
    mesh, count = MESHES[name], 3001
    for seed in range(2):
        rays = random_rays(count, seed, mesh, any_length(count, seed))
        hits = traced(mesh, rays, width, coherent=coherent)
        wrong, excused = judged(mesh, rays, hits)
        assert not wrong.any(), np.flatnonzero(wrong)
        assert excused.mean() < 0.01
        assert hits.hit.mean() > 0.02


@pytest.mark.core
@each_width
def test_intervals_are_respected(width):
    mesh = random_triangles(400, 4)
    random = np.random.default_rng(0)
    tnear = random.uniform(0, 4, 4001)
    rays = random_rays(4001, 5, mesh, tnear=tnear, tfar=tnear + random.choice([-1.0, 0.0, 0.5, 3.0, np.inf], 4001))
    hits = traced(mesh, rays, width)
    wrong, excused = judged(mesh, rays, hits)
    assert not wrong.any()
    assert excused.mean() < 0.01
    assert hits.hit.mean() > 0.05
    found = hits.hit
    assert (hits.t[found] >= rays.tnear[found]).all()
    assert (hits.t[found] <= rays.tfar[found]).all()
    assert not found[rays.tfar <= rays.tnear].any()


@pytest.mark.core
@each_width
def test_an_interval_picks_one_of_several_walls_and_an_empty_one_none(width):
    walls = quads([[(-9, -9, z), (9, -9, z), (9, 9, z), (-9, 9, z)] for z in (1, 2, 3)])
    intervals = np.array([
        (0, np.inf), (1.5, np.inf), (2.5, 9), (3.5, np.inf), (0, 0.5), (1.5, 1.75), (2.5, 1.5), (0, -1), (1.5, 1.5),
        (0, -np.inf), (1e9, np.inf), (0, 1e9),
    ])  # fmt: skip
    expected = np.array([1, 2, 3, *[np.inf] * 8, 1])
    for size in (1.0, 1e-19, 1e15):
        rays = atra.Rays(np.tile([0.3, 0.1, 0.0], (12, 1)), np.tile([0.0, 0.0, size], (12, 1)), *(intervals / size).T)
        hits = traced(walls, rays, width)
        assert hits.t == pytest.approx(expected / size, rel=1e-6)
        assert (hits.prim_id[hits.hit] // 2 == expected[hits.hit] - 1).all()
        assert (occluded(walls, rays, width) == np.isfinite(expected)).all()


@pytest.mark.core
@each_width
@each_flag
def test_a_ray_is_occluded_where_it_hits_something(width, coherent):
    for name in ("few", "many small", "room"):
        mesh, count = MESHES[name], 5003
        tfar = np.random.default_rng(1).choice([0.5, 2.0, np.inf], count)
        rays = random_rays(count, 9, mesh, tnear=0.25, tfar=tfar)
        hits = traced(mesh, rays, width, coherent=coherent)
        assert (occluded(mesh, rays, width, coherent=coherent) == hits.hit).all()
        assert 0.02 < hits.hit.mean() < 0.98


@each_width
def test_no_bit_of_a_hit_depends_on_the_length_of_the_direction(width):
    mesh = MESHES["many small"]
    rays = random_rays(2000, 4, mesh, tnear=0.5, tfar=3.0)
    hits = traced(mesh, rays, width)
    factor = 2.0 ** np.random.default_rng(4).integers(-60, 60, 2000)
    scaled = atra.Rays(rays.origins, rays.directions * factor[:, None], 0.5 / factor, 3.0 / factor)
    found = traced(mesh, scaled, width)
    assert (found.prim_id == hits.prim_id).all()
    assert (found.t == hits.t / factor).all()


def axis_near_rays(count, seed, axis_only=False):
    """Along an axis of the world, other components zero, of either sign, or tiny; origins inside a box, some of their
    components, too, zero or tiny."""
    random = np.random.default_rng(seed)
    tiny = [0.0, -0.0] if axis_only else [0.0, -0.0, 6e-17, -6e-17, 1e-18, -1e-18, -1e-19, 1e-30, -1e-38, 1e-45, -1e-45]
    directions = random.choice(tiny, (count, 3))
    directions[np.arange(count), random.integers(0, 3, count)] = random.choice([-1.0, 1.0], count)
    origins = random.uniform(-0.9, 0.9, (count, 3))
    some = random.random((count, 3)) < 0.3
    origins[some] = random.choice([0.0, -0.0, 1e-19, -1e-19, -1e-40], some.sum())
    return origins, directions


@pytest.mark.core
@each_width
@each_flag
@pytest.mark.parametrize("length", [1.0, 1e-3, 3e-19, 1e18])
def test_rays_along_an_axis_or_all_but_along_it_lose_nothing(width, coherent, length):
    box = closed_box()
    for seed in range(4):
        origins, directions = axis_near_rays(5000, seed, axis_only=seed == 0)
        rays = atra.Rays(origins, directions * length)
        hits = traced(box, rays, width, coherent=coherent)
        assert hits.hit.all(), (origins[~hits.hit][0], directions[~hits.hit][0])
        assert occluded(box, rays, width, coherent=coherent).all()


@pytest.mark.core
@each_width
@pytest.mark.parametrize("direction", [(-1e-19, 0, -1), (0, -1e-19, -1), (-1e-30, -6e-17, -1), (1e-18, -1e-18, -1)])
def test_a_packet_that_shares_a_tiny_component_misses_no_wall(width, direction):
    x, y = np.meshgrid(np.linspace(-8.5, 8.5, 97), np.linspace(-8.5, 8.5, 61))
    origins = np.stack([x, y, np.full_like(x, 3)], -1).reshape(-1, 3)
    steps = np.linspace(-9, 9, 41) + 0.123
    wall = quads([
        [(a, c, 0.0), (b, c, 0.0), (b, d, 0.0), (a, d, 0.0)]
        for a, b in pairwise(steps) for c, d in pairwise(steps)
    ])  # fmt: skip
    rays = atra.Rays(origins, np.broadcast_to(direction, origins.shape))
    for coherent in (False, True):
        assert traced(wall, rays, width, coherent=coherent).hit.all()
        assert occluded(wall, rays, width, coherent=coherent).all()


@each_width
@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 8, 15, 16, 17, 31, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK + 13])
def test_a_batch_of_any_size_is_answered_ray_by_ray_and_nothing_else_is_written(width, count):
    mesh = MESHES["few"]
    rays = random_rays(2 * CHUNK + 13, 6, mesh)
    every = traced(mesh, rays, width)
    memory = np.full((3, count + 32), 7.0, np.float32)
    out = atra.RayHits(memory[0, 16:][:count], memory[1].view(np.uint32)[16:][:count], None, mesh)
    found_any = memory[2].view(np.bool_)[64:][:count]
    with scene_of(mesh, width) as scene:
        own = atra.Rays(rays.origins[:count], rays.directions[:count])
        hits = scene.intersect(own, out=out)
        assert scene.occluded(own, out=found_any) is found_any
    assert hits.t is out.t
    assert hits.prim_id is out.prim_id
    assert len(hits) == len(own) == count
    assert (hits.t == every.t[:count]).all()
    assert (hits.prim_id == every.prim_id[:count]).all()
    assert (found_any == hits.hit).all()
    assert (memory[:2, :16] == 7).all()
    assert (memory[:2, 16 + count :] == 7).all()
    whole_words = 16 + -(-count // 4)
    assert (memory[2, :16] == 7).all()
    assert (memory[2, whole_words:] == 7).all()


@each_width
def test_any_number_of_threads_gives_the_same_bits(width):
    mesh = MESHES["many small"]
    rays = random_rays(20_011, 8, mesh)
    one, two = (traced(mesh, rays, width, threads=threads) for threads in (1, 2))
    assert one.t.tobytes() == two.t.tobytes()
    assert one.prim_id.tobytes() == two.prim_id.tobytes()


def camera_rays(camera):
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(x, y, (0.5, 0.5))
    return atra.Rays(origins @ camera.axes + camera.eye, directions @ camera.axes)


def as_image(hits, mesh, camera):
    shape = (camera.height, camera.width)
    return atra.Hits(hits.t.reshape(shape), hits.prim_id.reshape(shape), (0.5, 0.5), mesh, camera)


@pytest.mark.core
@each_width
@each_flag
def test_the_rays_of_a_camera_hit_what_the_pixel_tracer_hits(width, coherent):
    for mesh, camera in (
        (cornell_box(), cornell_camera(45, 31)),
        (random_triangles(80, 7), atra.Camera((0.1, 0.2, -6), (0, 0, 0), (0, 1, 0), 50, 40, 27)),
        (random_triangles(80, 7), atra.OrthographicCamera((0.1, 0.2, -6), (0.5, 0, 0), (0, 1, 0), 7.0, 40, 27)),
    ):
        hits = as_image(traced(mesh, camera_rays(camera), width, coherent=coherent), mesh, camera)
        reference = trace("pixels", mesh, camera, packet_width=width)
        assert assert_no_pixel_wrong(mesh, camera, hits, reference).pixels_edge < 4


@pytest.mark.core
@each_native
def test_rays_that_float32_holds_exactly_are_the_pixel_tracers_to_the_bit(width):
    mesh = random_triangles(80, 7)
    camera = atra.OrthographicCamera(**EYE_AT_ORIGIN, view_height=4.0, width=64, height=64)  # pixels of 1 / 16
    reference = trace("pixels", mesh, camera, packet_width=width, ties="any")
    assert reference.hit.mean() > 0.5
    assert_same_bits(as_image(traced(mesh, camera_rays(camera), width), mesh, camera), reference)


def test_barycentric_weights_lead_to_the_hit():
    mesh = boards()  # whose corners are turned for Embree
    assert (mesh.traced_faces != mesh.faces).any()
    rays = random_rays(2000, 3, mesh)
    hits = traced(mesh, rays)
    found = hits.hit
    assert found.sum() > 100
    assert np.isnan(hits.u[~found]).all()
    assert np.isnan(hits.v[~found]).all()
    corners = mesh.triangles(hits.prim_id[found])
    u, v = hits.u[found, None], hits.v[found, None]
    points = (1 - u - v) * corners[:, 0] + u * corners[:, 1] + v * corners[:, 2]
    assert np.allclose(points, rays.origins[found] + hits.t[found, None] * rays.directions[found], atol=1e-3)
    assert (np.minimum(u, v) > -1e-3).all()


@pytest.mark.core
@each_native
def test_robust_loses_no_ray_far_from_the_origin_where_others_do(width):
    place = np.array([1, -0.7, 0.3]) * 1e4
    box = closed_box(12)
    box = atra.Mesh((box.vertices + place).astype(np.float32), box.faces)
    random = np.random.default_rng(0)
    rays = atra.Rays(place + random.uniform(-0.9, 0.9, (20_000, 3)), random.normal(size=(20_000, 3)))
    lost = int((~traced(box, rays, width, precision="fast").hit).sum())
    fuses = "fma" in cpu_features() and chosen_instruction_set() not in ("sse4.2", "avx")
    assert lost < 200
    assert lost > 0 or not fuses  # multiply-add, which Embree's boxes use where there is one
    assert traced(box, rays, width).hit.all()


def test_embree_is_given_the_faces_that_tracers_trace(monkeypatch):
    given = []
    made, room = atra.rays.kernel_scene.EmbreeScene, atra.rays.kernel_scene
    monkeypatch.setattr(
        room, "EmbreeScene", lambda *arrays, **options: given.extend(arrays) or made(*arrays, **options)
    )
    mesh = boards()
    traced(mesh, random_rays(1, 0, mesh))
    assert not given
    traced(mesh, random_rays(1, 0, mesh), precision="watertight")
    assert (given[0] == mesh.vertices).all()
    assert given[1] is mesh.traced_faces


HOSTILE = [
    ({"origins": [(0, 0, 0), (np.nan, 0, 0)]}, r"ray 1 has the origin \(nan, 0.0, 0.0\), expected finite"),
    ({"origins": [(0, np.inf, 0), (0, 0, 0)]}, r"ray 0 has the origin \(0.0, inf, 0.0\)"),
    ({"origins": [(0, 0, 0), (0, 0, -2e11)]}, "ray 1 has the origin .* at most 1e\\+11"),
    ({"directions": [(0, 0, 1), (0, 0, 0)]}, r"ray 1 has the direction \(0.0, 0.0, 0.0\)"),
    ({"directions": [(0, 0, 1), (0, -np.inf, 0)]}, "ray 1 has the direction"),
    ({"directions": [(0, np.nan, 1), (0, 0, 1)]}, "ray 0 has the direction"),
    ({"directions": [(1, 0, 0), (0, 1e-21, 0)]}, "ray 1 has the direction .* from 1e-20 to 1e\\+20"),
    ({"directions": [(1, 0, 0), (0, 1e21, 0)]}, "ray 1 has the direction"),
    ({"tnear": [0.0, np.nan]}, "ray 1 has the tnear nan, expected a finite number of at least 0"),
    ({"tnear": -1.0}, "ray 0 has the tnear -1.0"),
    ({"tnear": np.inf}, "ray 0 has the tnear inf"),
    ({"tfar": [np.inf, np.nan]}, "ray 1 has the tfar nan"),
    ({"origins": [(0, 0, 0)]}, "1 origins and 2 directions"),
    ({"origins": np.zeros((2, 2))}, r"origins have shape \(2, 2\), expected \(N, 3\)"),
    ({"origins": np.zeros(3)}, r"shape \(3,\)"),
    ({"directions": np.ones((2, 3), complex)}, "directions have dtype complex128"),
    ({"directions": [("a", "b", "c")] * 2}, "directions have dtype"),
    ({"directions": [(1, 2, 3), (1, 2)]}, "directions cannot be read as an array"),
    ({"tfar": [1.0, 2.0, 3.0]}, r"tfar has shape \(3,\), expected a number, or \(2,\)"),
    ({"tnear": None}, "tnear have dtype object"),
]


@pytest.mark.parametrize(("wrong", "message"), HOSTILE)
def test_rays_that_cannot_be_traced_are_refused_naming_the_first(wrong, message):
    good = {"origins": [(0, 0, 0), (1, 0, 0)], "directions": [(0, 0, 1), (1, 1, 1)]}
    atra.Rays(**good)
    with pytest.raises(atra.InputError, match=message):
        atra.Rays(**(good | wrong))


def test_rays_are_private_copies_that_cannot_be_changed():
    origins, directions = np.zeros((2, 3), np.float32), np.ones((2, 3), np.float32)
    rays = atra.Rays(origins, directions)
    origins[:] = np.nan
    assert (rays.origins == 0).all()
    for one in (rays, pickle.loads(pickle.dumps(rays))):
        for array in (one.origins, one.directions, one.tnear, one.tfar):
            assert array.dtype == np.float32
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1


def test_an_empty_batch_of_any_spelling_has_no_hits():
    with atra.RayScene(cornell_box(), threads=2) as scene:
        for empty in ([], np.zeros((0, 3))):
            rays = atra.Rays(empty, empty)
            assert scene.intersect(rays).t.shape == scene.occluded(rays).shape == (0,)


def test_scenes_refuse_what_they_cannot_trace():
    for wrong, message in (
        ({"packet_width": 3}, "packet_width"), ({"threads": 0}, "threads"),
        ({"build_quality": "best"}, "build_quality"),
    ):  # fmt: skip
        with pytest.raises(atra.InputError, match=message):
            atra.RayScene(cornell_box(), **wrong)
    box = cornell_box()
    with pytest.raises(atra.InputError, match="from the world's origin, expected at most 1e\\+11"):
        atra.RayScene(atra.Mesh(box.vertices.astype(float) * 1e11 + 1e11, box.faces))
    with pytest.raises(atra.InputError, match="scale mesh and rays up"):
        atra.RayScene(atra.Mesh(box.vertices.astype(float) * 1e-13, box.faces))
    rays = random_rays(3, 0, box)
    with atra.RayScene(box, threads=1) as scene:
        for call in (scene.intersect, scene.occluded):
            with pytest.raises(atra.InputError, match=r"expected atra\.Rays, or origins and directions"):
                call((box.vertices, box.vertices))
            with pytest.raises(atra.InputError, match=r"tnear and tfar are part of atra\.Rays"):
                call(rays, tfar=1.0)
            with pytest.raises(atra.InputError, match=r"ray 1 has the direction \(0.0, 0.0, 0.0\)"):
                call(np.zeros((2, 3)), [[1, 0, 0], [0, 0, 0]])


def test_an_out_that_does_not_fit_is_refused():
    mesh = cornell_box()
    rays = random_rays(10, 0, mesh)
    memory = np.zeros(10, np.float32)
    read_only = np.zeros(10, np.float32)
    read_only.setflags(write=False)

    def result(t, prim_id):
        return atra.RayHits(t, prim_id, rays, mesh)

    whole = np.zeros(10, np.uint32)
    with atra.RayScene(mesh, threads=1) as scene:
        for out, message in (
            (result(np.zeros(9, np.float32), whole), r"out.t is float32 of \(9,\)"),
            (result(np.zeros(10), whole), "out.t is float64"),
            (result(np.zeros(20, np.float32)[::2], whole), "not contiguous"),
            (result(read_only, whole), "read-only"),
            (result(memory, np.zeros(10, np.int32)), "out.prim_id is int32"),
            (result(memory, memory.view(np.uint32)), "one memory"),
            (result(None, whole), "out.t is None"),
            (memory, "out.t is None"),
        ):
            with pytest.raises(atra.InputError, match=message):
                scene.intersect(rays, out=out)
        with pytest.raises(atra.InputError, match="out is uint32"):
            scene.occluded(rays, out=whole)
        first = scene.intersect(rays)
        again = scene.intersect(random_rays(10, 1, mesh), out=first)
        assert again.t is first.t


def test_origins_and_directions_are_traced_as_the_rays_made_of_them():
    mesh = cornell_box()
    rays = random_rays(300, 3, mesh)
    arrays = rays.origins.astype(np.float64), rays.directions.tolist()
    scene = atra.RayScene(mesh, threads=1)
    for given in ({}, {"tnear": 0.2, "tfar": np.linspace(0.1, 2.0, 300)}):
        expected = atra.Rays(rays.origins, rays.directions, **given)
        found = scene.intersect(*arrays, **given)
        assert_same_bits_of_rays(found, scene.intersect(expected))
        assert (scene.occluded(*arrays, **given) == scene.occluded(expected)).all()
        assert 0 < found.hit.sum() < 300


def assert_same_bits_of_rays(found, expected):
    assert (found.t.tobytes(), found.prim_id.tobytes()) == (expected.t.tobytes(), expected.prim_id.tobytes())


@each_width
def test_the_order_that_a_large_batch_is_traced_in_changes_no_bit(width, monkeypatch):
    monkeypatch.setattr(atra.rays.kernel_scene, "FEWEST_TRIANGLES", 1)
    monkeypatch.setattr(atra.rays.tree.finding, "FEWEST_TRIANGLES", 1)
    fewest, mesh, ordered = 4000, MESHES["many small"], []
    monkeypatch.setattr(atra.rays.order, "FEWEST_RAYS", fewest)
    monkeypatch.setattr(atra.rays.order, "ORDERED", fewest - 700)  # in two parts, the second of 777
    order = RayOrder.ordered
    monkeypatch.setattr(RayOrder, "ordered", lambda *given: ordered.append(1) or order(*given))
    nearest = np.linspace(0.0, 0.1, fewest + 77)
    rays = random_rays(len(nearest), 9, mesh, tnear=nearest, tfar=nearest + 2)
    assert_same_bits_of_rays(traced(mesh, rays, width, coherent=None), traced(mesh, rays, width))
    with scene_of(mesh, width) as scene:
        assert (scene.occluded(rays) == scene.occluded(rays, coherent=False)).all()
        assert len(ordered) == 4
        scene.intersect(atra.Rays(np.zeros((fewest, 3)), np.ones((fewest, 3))))  # has an order
        scene.intersect(random_rays(fewest - 1, 1, mesh))
        assert len(ordered) == 4
    with pytest.raises(atra.ClosedError, match="closed"):
        scene.intersect(rays)


def test_a_large_batch_is_ordered_by_where_rays_start_and_head_whoever_orders_it():
    mesh = MESHES["many small"]
    nearest = np.linspace(0.0, 0.1, 2 * SORTED_CHUNK + 5)
    rays = random_rays(len(nearest), 9, mesh, tnear=nearest, tfar=nearest + 1)
    given = rays.origins, rays.directions, rays.tnear, rays.tfar
    found = []
    for threads in (1, 3):
        pool = WorkerPool(threads)
        ordered, places, _ = RayOrder(pool).ordered(*given)
        found.append((*ordered, places))
        pool.close()
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)
    origins, directions, *_, places = found[0]
    np.testing.assert_array_equal(np.sort(places), np.arange(len(rays)))
    for numbers, own in zip(found[0], given, strict=False):
        np.testing.assert_array_equal(numbers[places], own)
    low, high = box_of(rays.origins)
    inside = ((low <= rays.origins) & (rays.origins <= high)).all(axis=1).mean()
    assert 0.95 < inside < 1.0  # others are put into the cells at the sides
    cells = np.clip((origins - low) * (CELLS / (high - low)), 0, CELLS - 1).astype(int)
    bucket = np.column_stack([cells, np.signbit(directions)])
    changes = (bucket[1:] != bucket[:-1]).any(axis=1).sum()
    assert changes == len(np.unique(bucket, axis=0)) - 1 > 500


@each_native
def test_packets_of_coherent_rays_go_together_and_others_do_not(width):
    mesh, camera = cornell_box(), cornell_camera(256, 256).crop(0, 100, 256, 16)
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    directions = camera.rays(x, y)[1] @ camera.axes
    origins = np.broadcast_to(camera.eye, directions.shape)
    with scene_of(mesh, width) as scene:
        found = scene.intersect(origins, directions)
        flags = scene._embree._workspaces[width][0].flags
        assert flags[0] == FLAG_COHERENT
        assert_same_bits_of_rays(found, scene.intersect(origins, directions, coherent=True))
        scene.intersect(random_rays(64, 1, mesh))
        assert flags[0] == (FLAG_COHERENT if width == 1 else 0)


@each_native
def test_rays_that_are_not_coherent_are_traced_one_by_one_unless_a_width_is_given(width, monkeypatch):
    mesh, widths = cornell_box(), []
    coherent = camera_rays(cornell_camera(256, 256).crop(0, 100, 256, 16))
    others = random_rays(256, 1, mesh)

    def kernel_of(width, any_hit):
        widths.append(width)
        return embree_kernel(width, any_hit)

    monkeypatch.setattr(atra.rays.kernel_scene, "embree_kernel", kernel_of)
    for given in (None, width):
        with atra.RayScene(mesh, packet_width=given, threads=1, precision="fast") as scene:
            for rays in (coherent, others):
                scene.intersect(rays)
                scene.intersect(rays, coherent=True)
                scene.intersect(rays, coherent=False)
    assert widths == [WIDEST, WIDEST, 1, 1, WIDEST, 1] + [width] * 6


def test_the_first_batch_builds_a_scene_that_is_not_built_and_none_builds_a_closed_one():
    mesh = cornell_box()
    rays = random_rays(100, 0, mesh)
    scene = atra.RayScene(mesh, threads=1, precision="watertight")
    assert (scene.embree_bytes, scene.build_time_s) == (0, 0)
    assert scene.occluded(rays).any()
    assert scene.embree_bytes > 1000
    taken, before = scene.build_time_s, scene.intersect(rays)
    assert scene.build_time_s == taken > 0
    scene.build()
    assert_same_bits_of_rays(scene.intersect(rays), before)
    for _ in range(2):
        scene.close()
        assert scene.embree_bytes == 0
    unbuilt = atra.RayScene(mesh, threads=1)
    unbuilt.close()
    for closed in (scene, unbuilt):
        with pytest.raises(atra.ClosedError, match="closed"):
            closed.intersect(rays)


@each_width
def test_two_threads_may_use_one_scene(width):
    mesh = MESHES["many small"]
    batches = [random_rays(3 * CHUNK, seed, mesh) for seed in (1, 2)]
    expected = [traced(mesh, rays, width).t for rays in batches]
    wrong = []
    with scene_of(mesh, width, threads=2) as scene:

        def repeat(k):
            for _ in range(30):
                hits = scene.intersect(batches[k], coherent=k == 1)
                if k == 0 and hits.t.tobytes() != expected[k].tobytes():
                    wrong.append(k)
                if (scene.occluded(batches[k]) != np.isfinite(expected[k])).any():
                    wrong.append(k)

        in_threads(lambda: repeat(0), lambda: repeat(1))
    assert not wrong


def test_closing_waits_for_the_batch_in_progress():
    mesh = random_triangles(5000, 1)
    rays = random_rays(200_000, 1, mesh)
    scene = atra.RayScene(mesh, threads=2)
    scene.build()
    expected = scene.intersect(rays).t.tobytes()
    found = []
    thread = threading.Thread(target=lambda: found.append(scene.intersect(rays).t.tobytes()))
    thread.start()
    while not scene._lock._is_owned() and scene._lock.acquire(blocking=False):  # until the batch has the lock
        scene._lock.release()
    scene.close()
    thread.join()
    assert found == [expected]
