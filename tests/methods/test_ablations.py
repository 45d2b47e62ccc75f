"""What is switched off to show what it gains changes no answer, and is really off."""

import numpy as np

from atra.light import Atlas, Texels
from experiments.light.bake_rays import AlignedTiles, directions_of
from experiments.light.sun.tiles import Tiles
from scenes.cornell_box import cornell_box
from tests.points import planned


def test_without_the_shortcut_more_triangles_are_copied_and_every_ray_sees_the_same():
    asked = {"map_size": 64, "tile_size": 8}
    points = [planned("raster", "bake_rays", asked=asked | {"shortcut": how}).point for how in (True, False)]
    mesh = cornell_box()
    tiles = Tiles.of(Texels.of(mesh, Atlas.unwrap(mesh, 64)), 8, 16)
    direction, offsets = directions_of(points[0]), np.array([(0.5, 0.5), (0.25, 0.75)])
    with_it, without = (AlignedTiles(point, tiles) for point in points)
    for rays in (with_it, without):
        rays.trace(direction, offsets)
    (one,), (other,) = (rays.met(direction) for rays in (with_it, without))
    assert one.any()
    assert np.array_equal(one, other)
    assert without.triangles > with_it.triangles
