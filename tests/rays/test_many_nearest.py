"""What judges the nearest hits of many rays: it finds what whole numbers find, and counts every fault."""

from __future__ import annotations

import numpy as np
import pytest

import atra
from tests.rays.many_nearest import Truth, tree_over
from tests.rays.near_rays import KINDS, mesh_of, rays_of

RAYS = 60


def truth_of(name, kind, is_far=False, count=RAYS):
    mesh, _ = mesh_of(name, is_far)
    corners = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64)
    rays = rays_of(kind, corners, count, np.float64 if is_far else np.float32, np.random.default_rng(2))
    return mesh, rays, Truth(tree_over(corners), corners, *(array.astype(np.float64) for array in rays))


@pytest.mark.parametrize(("name", "is_far"), [("boxes", False), ("boxes", True), ("needles", False)])
@pytest.mark.parametrize("kind", KINDS)
def test_float64_with_bounds_names_the_hits_that_whole_numbers_find_among_all_triangles(name, is_far, kind):
    mesh, _, truth = truth_of(name, kind, is_far, 20)
    for ray in range(20):
        found = truth.exact(ray).nearest(range(mesh.triangle_count))
        assert truth.prim_ids[ray] == (-1 if found is None else found[1])
        assert found is None or abs(truth.t[ray] - float(found[0])) <= truth.errors[ray]


@pytest.mark.parametrize("kind", KINDS)
def test_exact_rays_have_no_fault(kind):
    for name, is_far in (("whole steps", False), ("whole steps", True), ("needles", False)):
        mesh, rays, truth = truth_of(name, kind, is_far, 500)
        with atra.RayScene(mesh, threads=1) as scene:
            found, occluded = scene.intersect(*rays), scene.occluded(*rays)
        prim_ids = np.where(found.hit, found.prim_id.astype(np.int64), -1)
        assert truth.faults(prim_ids, found.t, occluded, is_strict=True) == (0, 0, 0, 0)


def test_every_kind_of_fault_is_counted_once():
    _, _, truth = truth_of("boxes", "random")
    hits, misses = np.flatnonzero(truth.prim_ids >= 0), np.flatnonzero(truth.prim_ids < 0)
    prim_ids, t, occluded = truth.prim_ids.copy(), truth.t.astype(np.float32), truth.prim_ids >= 0
    assert truth.faults(prim_ids, t, occluded, is_strict=True) == (0, 0, 0, 0)
    prim_ids[hits[0]] = (prim_ids[hits[0]] + 12) % 24  # a triangle of the other box
    prim_ids[hits[1]] = -1
    occluded[hits[2]] = False
    prim_ids[misses[0]], occluded[misses[1]] = 0, True
    t[hits[3]] += 2 * np.spacing(t[hits[3]])
    for is_strict in (True, False):
        assert truth.faults(prim_ids, t, occluded, is_strict=is_strict) == (1, 2, 2, 1)
