"""Layers: the nearest hits of however many, and results that are overwritten."""

import numpy as np
import pytest

import atra
from atra.raster.all_hits.drawing_kernels import SPARE
from tests.all_hits.crossings import all_crossings
from tests.all_hits.plain import gather_plainly
from tests.closed_meshes import sphere
from tests.machine import FEW_LANES
from tests.meshes import EYE_AT_ORIGIN, joined, quads, random_triangles

CAMERA = atra.Camera(**EYE_AT_ORIGIN, width=40, height=30, fov_y_degrees=90)
NAMES = ("depth", "prim_id", "count")


def walls(depths):
    return quads([[(-99, -99, z), (99, -99, z), (99, 99, z), (-99, 99, z)] for z in depths])


def assert_same(found, wanted):
    for name in NAMES:
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


@pytest.mark.parametrize("lanes", [pytest.param(FEW_LANES, marks=pytest.mark.slow), None])
@pytest.mark.parametrize("k", [1, 3, 40])
def test_the_nearest_of_many_walls_are_kept_in_whatever_order_they_come(k, lanes):
    depths = np.random.default_rng(k).permutation(36) // 2 + 2.0  # each depth twice
    mesh = walls(depths)
    with atra.RasterTracer(mesh, CAMERA, lanes=lanes, threads=1) as tracer:
        found = tracer.gather(atra.Layers(k))
    assert (found.count == 36).all()
    wall = found.prim_id[: min(k, 36)] // 2
    expected = np.lexsort((np.arange(36), depths))[:k]
    np.testing.assert_array_equal(wall, np.broadcast_to(expected[:, None, None], wall.shape))
    np.testing.assert_array_equal(np.isinf(found.depth).sum(axis=0), max(k - 36, 0))
    np.testing.assert_array_equal((found.prim_id == atra.MISS).sum(axis=0), max(k - 36, 0))


@pytest.mark.parametrize("tracer", [atra.RasterTracer, atra.PixelTracer])
def test_few_hits_and_many_are_sorted(tracer):
    most = []
    for count in (2, 25, 40, 90, 150):  # 16 neighbours are sorted at once, in one of several ways
        mesh = random_triangles(count, 7, 3.0)
        wanted = gather_plainly(all_crossings(mesh, CAMERA), atra.Layers(8))
        most.append(int(wanted.count.max()))
        with tracer(mesh, CAMERA, threads=1) as one:
            found = one.gather(atra.Layers(8))
        for name in ("count", "prim_id"):
            np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    assert most == [1, 4, 6, 12, 22]


@pytest.mark.slow
def test_layers_of_small_triangles_are_the_same_to_the_bit_with_vectors_of_any_width():
    mesh, found = random_triangles(2500, 3, 0.4), {}
    for lanes in (FEW_LANES, None):
        with atra.RasterTracer(mesh, CAMERA, lanes=lanes, threads=1) as tracer:
            found[lanes] = tracer.gather(atra.Layers(2))
    assert_same(found[FEW_LANES], found[None])
    wanted = gather_plainly(all_crossings(mesh, CAMERA), atra.Layers(2))
    assert wanted.count.max() > 2 + SPARE
    np.testing.assert_array_equal(found[FEW_LANES].count, wanted.count)
    np.testing.assert_array_equal(found[FEW_LANES].prim_id, wanted.prim_id)


def test_an_earlier_view_leaves_nothing_in_what_is_overwritten():
    mesh = joined(sphere(3), walls([2.0, 3.0, 4.0]))
    aside = atra.Camera((0, 0, -3), (2, 1, 5), width=40, height=30, fov_y_degrees=60)
    with atra.RasterTracer(mesh, CAMERA, threads=1) as tracer:
        results = {}
        for name, camera in (("ahead", CAMERA), ("aside", aside)):
            tracer.look(camera)
            results[name] = tracer.gather(atra.Layers(6))
        tracer.look(CAMERA)
        again = tracer.gather(atra.Layers(6), out=tracer.gather(atra.Layers(6)))
        assert_same(again, results["ahead"])
        tracer.look(aside)
        over = tracer.gather(atra.Layers(6), out=again)
        assert over.depth.ctypes.data == again.depth.ctypes.data
        assert_same(over, results["aside"])


def test_results_cannot_be_written_to_and_one_that_was_is_overwritten_as_a_whole():
    mesh = sphere()
    with atra.RasterTracer(mesh, CAMERA, threads=1) as tracer:
        wanted, changed = tracer.gather(atra.Layers(5)), tracer.gather(atra.Layers(5))
        with pytest.raises(ValueError, match="read-only"):
            changed.depth[:] = 1.0
        for name in NAMES:
            array = getattr(changed, name)
            array.setflags(write=True)
            array[:] = 1
        assert_same(tracer.gather(atra.Layers(5), out=changed), wanted)
