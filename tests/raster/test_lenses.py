"""The rasteriser's tiles of a lens: the same image whatever draws it, and planes for views of any width."""

import numpy as np
import pytest

import atra
from atra.compiled.threads import WorkerPool
from atra.raster.lenses.planes import lens_planes
from atra.tracing.lens_rays import lens_directions
from tests.images import assert_equal_images, assert_no_pixel_wrong
from tests.judge.reference import brute_force
from tests.lenses import lens_camera, random_lens
from tests.machine import FEW_LANES
from tests.meshes import cornell_box, cornell_camera, random_triangles
from tests.raster.test_raster import every_width_the_native_quick

BARREL = atra.OpenCVLens(k1=-0.3, k2=0.08, p1=0.002, p2=-0.001)
PANORAMA = atra.EquirectangularLens()


def planes_of(camera):
    pool = WorkerPool(1)
    return lens_planes(lens_directions(camera, (0.5, 0.5), pool), camera.pixel_pitch, pool)


def drawn(mesh, camera, **options):
    with atra.RasterTracer(mesh, camera, **{"threads": 1, **options}) as tracer:
        return tracer.trace()


@every_width_the_native_quick
@pytest.mark.parametrize("lens", [BARREL, PANORAMA])
def test_lanes_and_threads_change_no_bit(lens, lanes):
    mesh, camera = cornell_box(), lens_camera(lens, cornell_camera(300, 200), 300, 200)
    first = drawn(mesh, camera, lanes=FEW_LANES)
    assert first.hit.any()
    for options in ({"lanes": lanes}, {"lanes": lanes, "threads": 2}):
        other = drawn(mesh, camera, **options)
        assert other.depth.tobytes() == first.depth.tobytes(), options
        assert other.prim_id.tobytes() == first.prim_id.tobytes(), options


def test_every_sample_lies_where_its_tile_says():
    for lens in (BARREL, atra.OpenCVLens(k1=-0.6), atra.FisheyeLens(k1=0.05), PANORAMA):
        camera = lens_camera(lens, cornell_camera(200, 150), 200, 150)
        planes = planes_of(camera)
        for tile in range(len(planes.forms)):
            top, left = tile // planes.columns * planes.side, tile % planes.columns * planes.side
            y, x = np.mgrid[top : min(top + planes.side, camera.height), left : min(left + planes.side, camera.width)]
            directions = camera.rays(x, y)[1]
            right, down, parameter = planes.places[tile][:, : y.shape[0], : x.shape[1]].astype(np.float64)
            a, b, c = np.moveaxis(directions @ planes.forms[tile].T, -1, 0)
            np.testing.assert_allclose(x - left + right, a / c, atol=1e-5)
            np.testing.assert_allclose(y - top + down, b / c, atol=1e-5)
            np.testing.assert_allclose(parameter, 1.0 / c, rtol=1e-6)
            assert np.nanmax(np.abs([right, down]), initial=0.0) <= planes.margins[tile]
            unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
            assert np.nanmin(unit @ planes.cones[tile, :3], initial=1.0) >= planes.cones[tile, 3]


@pytest.mark.parametrize("size", [(1, 1), (129, 1), (1, 130), (17, 33)])
def test_images_of_any_size(size):
    mesh = cornell_box()
    for lens in (BARREL, PANORAMA):
        camera = lens_camera(lens, cornell_camera(*size), *size)
        assert_equal_images(mesh, camera, drawn(mesh, camera), brute_force(mesh, camera))


def test_from_among_the_triangles_nothing_is_wrong():
    """Many reach behind the plane of a tile, and through the eye's surroundings."""
    random = np.random.default_rng(3)
    for mesh in (random_triangles(400, seed=2), random_triangles(200, seed=5, size=8.0)):
        middle = mesh.bounds.mean(axis=0)
        for _ in range(6):
            eye, target = middle + random.normal(size=3) * 0.2, middle + random.normal(size=3)
            placed = atra.Camera(tuple(eye), tuple(target))
            for lens in (random_lens(random), PANORAMA):
                camera = lens_camera(lens, placed, 80, 60, random.uniform(0.3, 1.5))
                assert_no_pixel_wrong(mesh, camera, drawn(mesh, camera), brute_force(mesh, camera))


def test_planes_are_kept_for_other_poses():
    mesh, camera = cornell_box(), lens_camera(BARREL, cornell_camera(96, 72))
    with atra.RasterTracer(mesh, camera, threads=1) as tracer:
        tracer.trace()
        kept = tracer.prepared.lens_drawing.planes(camera, (0.5, 0.5), tracer._pool)
        moved = lens_camera(BARREL, atra.Camera((0.4, 0.1, 3.0), (0.0, 0.0, 0.0)))
        tracer.look(moved)
        assert_equal_images(mesh, moved, tracer.trace(), brute_force(mesh, moved))
        assert tracer.prepared.lens_drawing.planes(moved, (0.5, 0.5), tracer._pool) is kept
