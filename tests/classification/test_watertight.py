"""No ray of the wing passes between two triangles of a closed surface, unless it is asked to be fast."""

from functools import partial

import numpy as np
import pytest

import atra
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.tracer import BvhTracer
from experiments.classification.shafts.eye import EyeTracer
from experiments.classification.shafts.scene import ShaftScene
from experiments.classification.shafts.tracer import ClassifiedTracer
from tests.images import draw
from tests.machine import NATIVE_LANES
from tests.tracing import watertight_scenes as scenes
from tests.tracing.test_watertight import FEW, many_meshes, one_view

SHAFTS = {"cells": 8, "directions": 2, "rays": 4}

TRACERS = {
    "own BVH": partial(BvhTracer, threads=1),
    "classified": partial(ClassifiedTracer, threads=1, **SHAFTS),
    "eye's shafts": partial(EyeTracer, threads=1, rays=4),
}
SCENES = {
    "single rays": partial(BvhScene, threads=1, packet_width=1),
    "packets": partial(BvhScene, threads=1, packet_width=NATIVE_LANES),
    "shafts": partial(ShaftScene, threads=1, **SHAFTS),
}


def lost(method, **options):
    """Rays of images from inside of meshes that hit nothing."""
    count = 0
    for mesh in FEW:
        with TRACERS[method](mesh, *one_view(mesh), **options) as tracer:
            count += int((~tracer.trace().hit).sum())
    return count


@pytest.mark.parametrize("method", TRACERS)
def test_no_camera_ray_leaves_a_closed_mesh_but_in_the_fast_setting(method):
    assert lost(method) == 0
    assert lost(method, robust=False) > 0


@pytest.mark.parametrize("method", TRACERS)
def test_from_outside_no_ray_passes_through_the_front(method):
    mesh = scenes.ball(3)
    view = atra.Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 40.0, scenes.SIZE, scenes.SIZE)
    with TRACERS[method](mesh, view) as tracer:
        found = atra.compare(tracer.trace(), draw(mesh, view))
    assert (found.pixels_wrong, found.pixels_hole) == (0, 0)


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("mesh", [scenes.cube(2), scenes.ball(3)], ids=lambda mesh: mesh.name)
def test_no_ray_to_an_edge_leaves_a_closed_mesh(kind, mesh):
    rays = scenes.edge_rays(mesh, np.zeros(3), 5000, 0)
    with SCENES[kind](mesh) as scene:
        assert scene.intersect(scene.prepare(rays)).hit.all()
    if kind == "single rays":
        with SCENES[kind](mesh, robust=False) as scene:
            assert not scene.intersect(scene.prepare(rays)).hit.all()


def test_rays_to_corners_of_a_fine_mesh_do_not_leave_it_through_our_own_bvh():
    """Embree's robust test, watertight along edges, loses some of them: docs/trust.md."""
    mesh = scenes.ball(5)
    random = np.random.default_rng(3)
    origins = random.uniform(-0.3, 0.3, (20_000, 3)).astype(np.float32)
    rays = atra.Rays(origins, mesh.vertices[random.integers(0, len(mesh.vertices), len(origins))] - origins)
    with BvhScene(mesh, threads=1) as scene:
        assert scene.intersect(scene.prepare(rays)).hit.all()


@pytest.mark.slow
@pytest.mark.parametrize("kind", SCENES)
def test_rays_to_edges_of_many_closed_meshes_are_all_stopped(kind):
    for number, mesh in enumerate(many_meshes()):
        rays = scenes.edge_rays(mesh, np.zeros(3), 20_000, number)
        with SCENES[kind](mesh) as scene:
            assert scene.intersect(scene.prepare(rays)).hit.all(), mesh.name
