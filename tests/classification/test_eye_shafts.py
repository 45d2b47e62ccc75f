"""Shafts of an eye: the parts of an image, each with a list of its own, over a BVH that every eye shares."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra.embree.packets_kernels import TracedImage
from experiments.classification.bvh.single import FROM_ROOT, LISTED, PROVEN, STEPS
from experiments.classification.bvh.starts import ROOT_LIST
from experiments.classification.shafts.eye import EyeTracer, shapes_of_tiles
from tests.images import assert_no_pixel_wrong, assert_same_bits
from tests.judge.reference import brute_force
from tests.machine import NATIVE_LANES
from tests.meshes import EYE_AT_ORIGIN, cornell_box, cornell_camera, random_triangles
from tests.raster.test_raster import PARALLEL
from tests.trees.test_trees import below

MESH = random_triangles(300, 0)
WIDE = atra.Camera(**EYE_AT_ORIGIN, width=75, height=41, fov_y_degrees=150)
VIEWS = [(MESH, WIDE), (cornell_box(), cornell_camera(75, 41))]
KINDS = [(1, "pop"), pytest.param(1, "push", marks=pytest.mark.slow), (NATIVE_LANES, "push")]  # compiled for each


def tracer_of(mesh, camera, **options):
    return EyeTracer(mesh, camera, **{"threads": 1, "rays": 8, **options})


def from_the_root(tracer):
    """The same tracer without its lists."""
    lists = tracer.prepared.lists
    table = np.full_like(lists.shafts.table, ROOT_LIST)
    tracer.prepared.lists = replace(lists, shafts=lists.shafts._replace(table=table))
    return tracer


def counts_of(tracer):
    height, width = tracer.camera.height, tracer.camera.width
    return tracer.prepared.count(
        TracedImage(np.empty((height, width), np.float32), np.empty((height, width), np.uint32))
    )


@pytest.mark.parametrize(("packet_width", "traversal"), KINDS)
def test_pixels_from_the_lists_of_their_tiles_have_the_bits_that_they_have_from_the_root(packet_width, traversal):
    for mesh, camera in VIEWS:
        with tracer_of(mesh, camera, packet_width=packet_width, traversal=traversal) as tracer:
            for offset in ((0.5, 0.5), (0.0, 0.99)):
                hits = tracer.trace(offset)
                assert_no_pixel_wrong(mesh, camera, hits, brute_force(mesh, camera, offset))
            assert_same_bits(hits, from_the_root(tracer).trace(offset))


def test_tiles_take_fewer_steps_and_only_those_without_a_triangle_are_proven_to_miss():
    mesh, camera = VIEWS[1]
    with tracer_of(mesh, camera) as tracer:
        own, root = counts_of(tracer), counts_of(from_the_root(tracer))
    assert own[STEPS] < root[STEPS]
    assert (own[FROM_ROOT], root[FROM_ROOT]) == (0, camera.width * camera.height)
    assert own[PROVEN] < camera.width * camera.height
    assert own[LISTED] > 0


def test_every_triangle_that_a_tile_shows_lies_below_its_list():
    for mesh, camera in VIEWS:
        prim_id = brute_force(mesh, camera, (0.5, 0.5)).prim_id
        with tracer_of(mesh, camera) as tracer:
            shafts, tiles, bvh = tracer.prepared.lists.shafts, tracer.prepared.tiles, tracer.prepared.bvh
            for (left, top), start in zip(tiles.corners, shafts.table[0], strict=True):
                shown = prim_id[top : top + tiles.height, left : left + tiles.width]
                nodes = shafts.lists[start + 1 :][: shafts.lists[start]].tolist()
                held = {triangle for node in nodes for triangle in below(bvh, node)}
                assert set(shown[shown != atra.MISS].tolist()) <= held


def test_with_tiles_smaller_than_they_are_hits_are_lost(monkeypatch):
    def smaller(camera, eye, tiles, slack):
        return shapes_of_tiles(camera, eye, tiles, -0.3)

    with tracer_of(MESH, WIDE) as tracer:
        whole = tracer.trace()
    monkeypatch.setattr("experiments.classification.shafts.eye.shapes_of_tiles", smaller)
    with tracer_of(MESH, WIDE) as tracer:
        assert (tracer.trace().prim_id != whole.prim_id).any()


def test_an_eye_that_moves_takes_new_lists_and_keeps_the_bvh():
    mesh, camera = VIEWS[1]
    x, y, z = camera.eye
    moved = replace(camera, eye=(x + 0.07, y - 0.03, z + 0.1), width=60)
    with tracer_of(mesh, camera) as tracer, tracer_of(mesh, moved) as new:
        bvh, lists = tracer.prepared.bvh, tracer.prepared.lists
        tracer.look(moved)
        assert tracer.prepared.bvh is bvh
        assert tracer.prepared.lists is not lists
        assert_same_bits(tracer.trace(), new.trace())
        assert tracer.counters["shafts"] == len(tracer.prepared.tiles.corners)


def test_a_mesh_without_area_is_hit_nowhere():
    mesh = atra.Mesh(np.array([(0, 0, 1), (1, 0, 1), (2, 0, 1)]), np.array([[0, 1, 2]]))
    with tracer_of(mesh, WIDE) as tracer:
        assert not tracer.trace().hit.any()


@pytest.mark.parametrize(("camera", "message"), [
    (PARALLEL, "EyeTracer needs rays through one point"),
    (replace(WIDE, fov_y_degrees=0.1), "too narrow|expected at least 0.0002"),
])  # fmt: skip
def test_cameras_that_cannot_be_are_named(camera, message):
    with pytest.raises(atra.InputError, match=message):
        tracer_of(MESH, camera)
