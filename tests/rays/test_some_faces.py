"""Scenes of some of a mesh's faces."""

import numpy as np
import pytest

import atra
from tests.baked import cube
from tests.machine import WIDTHS
from tests.meshes import joined

ROOM = joined(cube(inwards=True), cube(0.3))


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("quality", ["low", "medium", "high"])
def test_a_scene_of_some_faces_meets_these_alone_and_numbers_them_as_the_mesh_does(width, quality):
    random = np.random.default_rng(0)
    ways = random.normal(size=(500, 3))
    rays = atra.Rays(random.uniform(-0.9, 0.9, (500, 3)), ways)
    some = random.random(ROOM.triangle_count) < 0.5
    alone = atra.Mesh(ROOM.vertices, ROOM.faces[some])
    options = {"threads": 1, "packet_width": width, "build_quality": quality}
    with atra.RayScene(ROOM, faces=some, **options) as scene, atra.RayScene(alone, **options) as other:
        hits, expected = scene.intersect(rays), other.intersect(rays)
        np.testing.assert_array_equal(hits.t, expected.t)
        hit = expected.hit
        assert 0.1 < hit.mean() < 0.95
        np.testing.assert_array_equal(hits.prim_id[hit], np.flatnonzero(some)[expected.prim_id[hit]])
        np.testing.assert_array_equal(scene.occluded(rays), hit)
    with atra.RayScene(ROOM, faces=np.zeros(24, bool), **options) as none:
        assert not none.occluded(rays).any()


def test_faces_that_are_no_choice_of_the_mesh_s_are_refused():
    for wrong in (np.ones(23, bool), np.ones(24, int), [True, False]):
        with pytest.raises(atra.InputError, match=r"expected \(24,\) bool, those that rays meet"):
            atra.RayScene(ROOM, faces=wrong)
