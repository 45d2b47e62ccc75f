"""No ray slips through between two triangles, and none meets both: decisions about samples are exact."""

from fractions import Fraction

import numpy as np
import pytest

import atra
from atra.exact.edges_kernels import SUMMANDS, first_beyond, side, turn
from tests.images import draw
from tests.meshes import EYE_AT_ORIGIN
from tests.raster.test_raster import every_width_the_native_quick

ROOM = np.empty(SUMMANDS)


def exactly(px, py, qx, qy, x, y):
    px, py, qx, qy, x, y = (Fraction(number) for number in (px, py, qx, qy, x, y))
    found = (qx - px) * (y - py) - (qy - py) * (x - px)
    return (found > 0) - (found < 0)


def hostile_edges(count, seed):
    """Edges that pass through a whole position, or next to it, some of them from very far away."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        i, j = random.integers(0, 60, 2)
        step = random.normal(size=2) * 10.0 ** random.integers(-3, 4)
        if random.random() < 0.4:
            step = random.integers(-9, 10, 2) * 0.125
        reach = random.choice([1.0, -1.0, 0.5, 1e12, 1e30], 2)
        p, q = np.array([i, j]) - step * abs(reach[0]), np.array([i, j]) + step * reach[1]
        yield (*np.nextafter(p, p + random.integers(-1, 2, 2)), *np.nextafter(q, q + random.integers(-1, 2, 2))), i, j


def test_the_side_of_a_sample_is_that_of_whole_arithmetic_for_edges_through_samples():
    on_the_line = 0
    for edge, i, j in hostile_edges(4000, 0):
        expected = exactly(*edge, int(i), int(j))
        assert turn(*edge, float(i), float(j), ROOM.ctypes.data) == expected
        on_the_line += expected == 0
    assert on_the_line > 100


def test_every_sample_is_on_one_side_of_an_edge_and_on_the_other_of_its_reverse():
    for edge, i, j in hostile_edges(2000, 1):
        if edge[:2] != edge[2:]:
            found = side(*edge, float(i), float(j), ROOM.ctypes.data)
            assert found in (-1, 1)
            assert side(*edge[2:], *edge[:2], float(i), float(j), ROOM.ctypes.data) == -found


def test_a_sample_on_an_edge_counts_as_moved_right_by_very_little_and_down_by_less():
    step = Fraction(1, 2**700)  # less than any of the differences below
    on_the_line = 0
    for edge, i, j in hostile_edges(1000, 3):
        edge = [0.0 if abs(number) < 1e-60 else number for number in edge]  # as corners are projected
        if edge[:2] != edge[2:] and exactly(*edge, int(i), int(j)) == 0:
            expected = exactly(*edge, int(i) + step, int(j) + step**2)
            assert side(*edge, float(i), float(j), ROOM.ctypes.data) == expected
            on_the_line += 1
    assert on_the_line > 15


def test_the_first_sample_beyond_an_edge_is_where_the_side_changes():
    for edge, _, j in hostile_edges(2000, 2):
        if edge[1] != edge[3]:
            sides = [side(*edge, float(i), float(j), ROOM.ctypes.data) for i in range(60)]
            first = first_beyond(*edge, float(j), 60, ROOM.ctypes.data)
            changes = [i for i in range(1, 60) if sides[i] != sides[i - 1]]
            beyond = -1 if edge[3] > edge[1] else 1
            assert len(changes) <= 1
            assert first == (changes[0] if changes else 0 if sides[0] == beyond else 60)


def sliver_ball(rows, columns, seed):
    """A closed mesh around the origin, of random slivers; every ray from the origin meets it."""
    random = np.random.default_rng(seed)
    latitudes = np.arccos(np.sort(random.uniform(-1, 1, rows)))
    longitudes = np.sort(random.uniform(0, 2 * np.pi, columns))
    longitudes[::3] = longitudes[: len(longitudes[::3])].min() + np.linspace(0, 2 * np.pi, len(longitudes[::3]), False)
    longitudes.sort()
    around = np.stack([np.cos(longitudes), np.sin(longitudes)], axis=1)
    rings = np.concatenate(
        [
            np.broadcast_to(np.sin(latitudes)[:, None, None] * around, (rows, columns, 2)),
            np.broadcast_to(np.cos(latitudes)[:, None, None], (rows, columns, 1)),
        ],
        axis=2,
    )
    poles = [[0, 0, 1.0], [0, 0, -1.0]]
    vertices = np.concatenate([rings.reshape(-1, 3), poles]) * random.uniform(1, 1.5, (rows * columns + 2, 1))
    a = np.arange((rows - 1) * columns)
    b = a // columns * columns + (a + 1) % columns
    first = np.arange(columns)
    following, last = (first + 1) % columns, (rows - 1) * columns
    faces = np.concatenate(
        [
            np.stack([a, b, a + columns], axis=1),
            np.stack([b, b + columns, a + columns], axis=1),
            np.stack([first, following, np.full(columns, rows * columns)], axis=1),
            np.stack([last + first, last + following, np.full(columns, rows * columns + 1)], axis=1),
        ]
    )
    return atra.Mesh(vertices, faces[random.permutation(len(faces))])


def test_no_ray_from_inside_a_closed_mesh_of_a_hundred_thousand_slivers_misses_it():
    mesh = sliver_ball(225, 224, 0)
    assert mesh.triangle_count > 100_000
    random = np.random.default_rng(1)
    camera = atra.Camera((0, 0, 0), (0.3, 0.2, -0.9), width=96, height=64, fov_y_degrees=100)
    with atra.RasterTracer(mesh, camera, threads=1, ties="any") as tracer:
        for _ in range(100):
            eye = random.normal(size=3) * 1e-3
            fov = random.choice([20.0, 90.0, 150.0])
            tracer.look(atra.Camera(tuple(eye), tuple(random.normal(size=3)), (0.1, 1, 0.2), fov, 96, 64))
            offset = tuple(random.uniform(0, 1, 2).tolist())
            assert tracer.trace(offset).hit.all()


@pytest.mark.parametrize("seed", range(4))
def test_few_large_slivers_around_the_eye_leave_no_ray_without_a_hit(seed):
    random = np.random.default_rng(seed)
    mesh = sliver_ball(4 + seed, 7, seed)
    with atra.RasterTracer(mesh, atra.Camera((0, 0, 0), (0, 0, 1)), threads=1, ties="any") as tracer:
        for _ in range(100):
            tracer.look(atra.Camera((0, 0, 0), tuple(random.normal(size=3)), (0.1, 1, 0.2), 120, 64, 48))
            assert tracer.trace((0.0, 0.0)).hit.all()


def grid(size, seed):
    """A square of triangles at z = 4 whose corners are whole pixels of `on_the_grid`, in random order and winding."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(size), np.arange(size))
    vertices = np.stack([-x, -y, np.full_like(x, 4)], axis=-1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(size - 1)[:, None] * size + np.arange(size - 1)).reshape(-1)
    turned = random.random(len(a)) < 0.5
    b, c, d = a + 1, a + size + 1, a + size
    one = np.where(turned[:, None], np.stack([a, b, d], axis=1), np.stack([a, b, c], axis=1))
    other = np.where(turned[:, None], np.stack([b, c, d], axis=1), np.stack([a, c, d], axis=1))
    faces = np.concatenate([one, other])
    faces = np.take_along_axis(faces, np.argsort(random.random(faces.shape), axis=1), axis=1)
    return atra.Mesh(vertices, faces[random.permutation(len(faces))])


def assert_covered_once(mesh, camera, **options):
    """Without a triangle, the rays that met it meet nothing, and all others something."""
    hits = draw(mesh, camera, (0.0, 0.0), ties="any", **options)
    assert hits.hit.all()
    for prim_id in np.random.default_rng(0).permutation(np.unique(hits.prim_id))[:30]:
        rest = atra.Mesh(mesh.vertices, np.delete(mesh.faces, prim_id, axis=0))
        found = draw(rest, camera, (0.0, 0.0), ties="any", **options)
        np.testing.assert_array_equal(found.hit, hits.prim_id != prim_id)


@pytest.mark.core
@every_width_the_native_quick
@pytest.mark.parametrize("pixels_apart", [1, 2, 5, 40])
def test_rays_through_corners_and_edges_meet_exactly_one_of_their_triangles(pixels_apart, lanes):
    size = 2 + 80 // pixels_apart
    mesh, pixels = grid(size, pixels_apart), (size - 1) * pixels_apart
    half = (size - 1) / 2
    camera = atra.OrthographicCamera((-half, -half, 0), (-half, -half, 1), (0, 1, 0), size - 1, pixels, pixels)
    assert_covered_once(mesh, camera, lanes=lanes)


def test_the_corners_of_a_pinholes_pixels_are_covered_once_too():
    mesh = grid(40, 3)
    camera = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=np.degrees(2 * np.arctan(4 / 4)), width=32, height=32)
    assert_covered_once(atra.Mesh(mesh.vertices + np.float32([20, 20, 0]), mesh.faces), camera)
