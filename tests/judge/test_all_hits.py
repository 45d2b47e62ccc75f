"""The oracle for all hits: it accepts what was gathered, and no fault in it."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from tests.all_hits.crossings import all_crossings
from tests.all_hits.plain import gather_plainly
from tests.all_hits.test_gathering import METHODS, gathered
from tests.closed_meshes import cornell_boxes, sphere, view_of
from tests.judge.all_hits import wrong_counts, wrong_layers, wrong_thicknesses
from tests.meshes import EYE_AT_ORIGIN, random_triangles

CAMERA = atra.Camera(**EYE_AT_ORIGIN, width=48, height=32, fov_y_degrees=90)
PARALLEL = atra.OrthographicCamera((0.3, 0.2, -0.4), (1, 2, 3), view_height=5.0, width=48, height=32)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("camera", [CAMERA, PARALLEL], ids=["pinhole", "parallel"])
def test_counts_and_layers_are_what_float64_finds_by_volumes(camera, method):
    mesh = random_triangles(120, 3)
    assert not wrong_counts(gathered(method, mesh, camera, atra.Count())).any()
    assert not wrong_layers(gathered(method, mesh, camera, atra.Layers(4))).any()


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("mesh", [sphere(), cornell_boxes()], ids=["sphere", "boxes"])
def test_thickness_is_what_float64_finds_by_volumes(mesh, method):
    for seed in range(3):
        assert not wrong_thicknesses(gathered(method, mesh, view_of(mesh, seed), atra.Thickness())).any()


def test_a_hit_that_is_taken_twice_or_lost_is_seen():
    found = gather_plainly(all_crossings(sphere(), view_of(sphere(), 0)), atra.Count())
    y, x = (int(place[0]) for place in np.nonzero(found.count))
    for more in (-1, 1):
        count = found.count.copy()
        count[y, x] = int(count[y, x]) + more
        assert list(zip(*np.nonzero(wrong_counts(replace(found, count=count))), strict=True)) == [(y, x)]


def test_a_face_whose_sign_is_turned_is_seen():
    mesh, camera = sphere(1), view_of(sphere(1), 0)
    found = gather_plainly(all_crossings(mesh, camera), atra.Thickness())
    layers = gather_plainly(all_crossings(mesh, camera), atra.Layers(2))
    y, x = (int(place[0]) for place in np.nonzero(layers.count == 2))
    thickness = found.thickness.copy()
    thickness[y, x] += 2 * layers.depth[0, y, x]  # what enters leaves
    assert list(zip(*np.nonzero(wrong_thicknesses(replace(found, thickness=thickness))), strict=True)) == [(y, x)]


@pytest.mark.parametrize("fault", ["unsorted", "repeated", "lost", "another", "deeper"])
def test_a_fault_in_layers_is_seen(fault):
    mesh = random_triangles(120, 3)
    found = gather_plainly(all_crossings(mesh, CAMERA), atra.Layers(4))
    assert not wrong_layers(found).any()
    depth, prim_id = found.depth.copy(), found.prim_id.copy()
    y, x = (int(place[0]) for place in np.nonzero(found.count >= 5))
    if fault == "unsorted":
        depth[:, y, x], prim_id[:, y, x] = depth[[1, 0, 2, 3], y, x], prim_id[[1, 0, 2, 3], y, x]
    elif fault == "repeated":
        depth[1, y, x], prim_id[1, y, x] = depth[0, y, x], prim_id[0, y, x]
    elif fault == "lost":
        full = gather_plainly(all_crossings(mesh, CAMERA), atra.Layers(5))
        depth[:, y, x], prim_id[:, y, x] = full.depth[1:, y, x], full.prim_id[1:, y, x]
    elif fault == "another":
        prim_id[0, y, x] = (prim_id[0, y, x] + 1) % 120
    else:
        depth[0, y, x] *= 1.001
    wrong = wrong_layers(replace(found, depth=depth, prim_id=prim_id))
    assert list(zip(*np.nonzero(wrong), strict=True)) == [(y, x)]
