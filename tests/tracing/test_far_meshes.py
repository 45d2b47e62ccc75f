"""Every method sees a mesh at map coordinates as it sees the same mesh near the world's origin, to the bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import atra
from experiments.workloads.agreement.oracle import examine, nearest_hits
from tests.far import AWAY, FAR, NEAR, SEEN_FAR, SEEN_NEAR
from tests.images import METHODS, make_tracer
from tests.judge.reference import brute_force

KINDS = (*METHODS, "raster")


def make(kind, mesh, camera, **options):
    if kind == "raster":
        return atra.RasterTracer(mesh, camera, threads=1, **options)
    return make_tracer(kind, mesh, camera, (4, 1), **options)


def traced(kind, mesh, camera):
    with make(kind, mesh, camera) as tracer:
        return tracer.trace()


def assert_seen_alike(far, near):
    """far, near: hits of the same rays."""
    assert near.hit.sum() > 40
    np.testing.assert_array_equal(far.prim_id, near.prim_id)
    np.testing.assert_array_equal(far.depth, near.depth)
    for name in ("u", "v", "normals"):
        np.testing.assert_array_equal(getattr(far, name), getattr(near, name))
    assert far.points.dtype == np.float64
    np.testing.assert_array_equal(far.points, near.points + AWAY)


def takes(kind, view):
    if view in ("fisheye", "panorama"):
        return kind in ("pixels", "raster")
    return view != "orthographic" or kind not in ("visible_first", "unprobed")


@pytest.mark.parametrize(("kind", "view"), [(kind, view) for kind in KINDS for view in SEEN_FAR if takes(kind, view)])
def test_every_tracer_sees_a_far_mesh_as_the_near_one(kind, view):
    far, near = traced(kind, FAR, SEEN_FAR[view]), traced(kind, NEAR, SEEN_NEAR[view])
    assert_seen_alike(far, near)
    assert far.mesh is FAR
    assert far.camera is SEEN_FAR[view]


@pytest.mark.parametrize("geometry", ["copied", "instanced"])
def test_frames_of_a_far_mesh_are_those_of_the_near_one(geometry):
    images = []
    for mesh, views, at in ((FAR, SEEN_FAR, AWAY), (NEAR, SEEN_NEAR, 0.0)):
        camera = views["pinhole"]
        other = replace(camera, eye=tuple((np.array([2.0, 2.25, 9.75]) + at).tolist()))
        alignment = atra.Alignment.of_frames([camera, other], atra.Split(4, 1, camera.width, camera.height))
        with atra.FramesTracer(mesh, alignment, threads=1, geometry=geometry, culling=False) as tracer:
            images.append(tracer.trace())
    for far, near in zip(*images, strict=True):
        assert_seen_alike(far, near)


@pytest.mark.parametrize("kind", ["raster", "pixels", "aligned", "instanced"])
@pytest.mark.parametrize("view", ["pinhole", "orthographic"])
@pytest.mark.parametrize(
    "what", [atra.Count(), atra.Thickness(), atra.Layers(3), atra.Transmittance(np.full(NEAR.triangle_count, 0.5))]
)
def test_gathering_along_rays_through_a_far_mesh_is_as_through_the_near_one(kind, view, what):
    found = []
    for mesh, views in ((FAR, SEEN_FAR), (NEAR, SEEN_NEAR)):
        with make(kind, mesh, views[view]) as tracer:
            found.append(tracer.gather(what))
    far, near = found
    assert far.mesh is FAR
    assert far.camera is SEEN_FAR[view]
    for name in ("count", "thickness", "depth", "prim_id", "transmittance"):
        if hasattr(near, name):
            np.testing.assert_array_equal(getattr(far, name), getattr(near, name))


@pytest.mark.parametrize("kind", KINDS)
def test_look_and_update_take_a_mesh_from_one_origin_to_another(kind):
    with make(kind, NEAR, SEEN_NEAR["pinhole"]) as tracer:
        near = tracer.trace()
        tracer.update(FAR)
        assert not tracer.trace().hit.any()
        tracer.look(SEEN_FAR["pinhole"])
        assert_seen_alike(tracer.trace(), near)
        assert tracer.mesh is FAR
        assert tracer.camera is SEEN_FAR["pinhole"]
        tracer.look(SEEN_NEAR["pinhole"])
        tracer.update(NEAR)
        np.testing.assert_array_equal(tracer.trace().prim_id, near.prim_id)


@pytest.mark.parametrize("view", SEEN_FAR)
def test_judges_of_a_far_mesh_are_those_of_the_near_one(view):
    far_camera, near_camera = SEEN_FAR[view], SEEN_NEAR[view]
    far, near = brute_force(FAR, far_camera), brute_force(NEAR, near_camera)
    np.testing.assert_array_equal(far.prim_id, near.prim_id)
    np.testing.assert_array_equal(far.depth, near.depth)
    hits = traced("raster", FAR, far_camera)
    agreement = atra.compare(hits, far)
    same = atra.compare(traced("raster", NEAR, near_camera), near)
    assert agreement.pixels_wrong == 0
    np.testing.assert_array_equal(agreement.verdict, same.verdict)
    examined = examine(hits, far, np.arange(200))
    assert not examined.hits_wrong.any()
    y, x = np.divmod(np.arange(100), far_camera.width)
    truths = nearest_hits(FAR, far_camera, x, y), nearest_hits(NEAR, near_camera, x, y)
    np.testing.assert_array_equal(truths[0].depth, truths[1].depth)
