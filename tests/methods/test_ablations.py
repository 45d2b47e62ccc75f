"""What is switched off to show what it gains changes no answer, and is really off."""

import numpy as np
import pytest

from atra.compiled.threads import WorkerPool
from atra.geometry.camera import Camera
from atra.light import Atlas, Texels
from atra.raster.frames import FrameMemory, bands_of
from atra.raster.image import eye_of
from experiments.harness.method import Tracing
from experiments.light.bake_rays import AlignedTiles, directions_of
from experiments.light.sun.tiles import Tiles
from experiments.methods.raster import CLUSTERS, RASTER, RasterOptions, WithoutClusters, WithoutOcclusion
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box
from tests.machine import FEW_LANES
from tests.points import planned

SIZE = 72, 48
CAMERA = Camera(**CORNELL_BOX_CAMERA, width=SIZE[0], height=SIZE[1])


def image(**options):
    mesh, camera = cornell_box(), CAMERA
    with RASTER.make(mesh, camera, RasterOptions(**options), Tracing(1)) as tracer:
        return tracer.trace()


@pytest.mark.parametrize("options", [*({"left_out": one} for one in CLUSTERS[1:]), {"lanes": FEW_LANES}])
def test_the_rasteriser_draws_the_same_without_occlusion_without_clusters_and_with_few_lanes(options):
    usual, other = image(), image(**options)
    assert usual.hit.sum() > 100
    assert np.array_equal(usual.prim_id, other.prim_id)
    assert np.array_equal(usual.depth, other.depth)


@pytest.mark.parametrize(("kind", "hides", "culls"), [
    (FrameMemory, True, True), (WithoutOcclusion, False, True), (WithoutClusters, False, False),
])  # fmt: skip
def test_without_occlusion_nothing_counts_as_hidden_and_without_clusters_every_band_draws_all(kind, hides, culls):
    mesh, camera, pool = cornell_box(), CAMERA, WorkerPool(1)
    memory = kind.of(mesh, pool)
    eye, _numbers = eye_of(mesh, camera, (0.5, 0.5))
    memory.cull(eye, camera, bands_of(*SIZE)[0], pool)
    order = memory.order()
    pool.close()
    assert bool(np.isfinite(memory.bounds[order]).any()) == hides
    whole = (memory.rectangles == (0, SIZE[0] - 1, 0, SIZE[1] - 1)).all(axis=1)
    assert bool(whole.all()) != culls
    assert len(order) == memory.clusters.count or culls


def test_without_the_shortcut_more_triangles_are_copied_and_every_ray_sees_the_same():
    asked = {"map_size": 64, "tile_size": 8}
    points = [planned("raster", "bake_rays", asked=asked | {"shortcut": how}).point for how in (True, False)]
    mesh = cornell_box()
    tiles = Tiles.of(Texels.of(mesh, Atlas.unwrap(mesh, 64)), 8, 16)
    direction, offsets = directions_of(points[0]), np.array([(0.5, 0.5), (0.25, 0.75)])
    with_it, without = (AlignedTiles(point, tiles) for point in points)
    (one,), (other,) = (rays.trace(direction, offsets, keep=True) for rays in (with_it, without))
    assert one.any()
    assert np.array_equal(one, other)
    assert without.triangles > with_it.triangles
