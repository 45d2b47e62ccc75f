"""Pictures, lightmaps and probes of a mesh at map coordinates are those of the same mesh near the world's origin."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import atra
from atra import light
from atra.light import Baker, Scene, Sun, constant_sky, save_model
from atra.light.lightmaps.finish.views import lit_view
from tests.baked import baked, painted, sheet
from tests.far import AWAY, FAR, NEAR, SEEN_FAR, SEEN_NEAR
from tests.meshes import joined, quads
from tests.shown import floor, hybrid, traced

ROOM = joined(quads([floor(3.9375 + 2**-10)]), quads([floor(0.5, 1.0)]), quads([floor(0.5, 1.0)[::-1]]))
ROOM_AWAY = atra.Mesh(ROOM.vertices.astype(np.float64) + AWAY, ROOM.faces)

PLACES = (FAR, AWAY, SEEN_FAR), (NEAR, 0.0, SEEN_NEAR)
ROOMS = (ROOM_AWAY, AWAY), (ROOM, 0.0)


def lights(at):
    def place(*position):
        return tuple((np.array(position) + at).tolist())

    return (
        Sun((0.3, -1.0, 0.2)),
        light.PointLight(place(1.0, 3.0, 2.0), power=9.0),
        light.SphereLight(place(-2.0, 4.0, 1.0), 0.25, power=9.0),
        light.SpotLight(place(0.0, 5.0, 0.0), (0.1, -1.0, 0.0), power=9.0),
    )


def scene_of(mesh, at):
    """Boxes with a pattern, one of them a lamp."""
    numbers = np.arange(mesh.triangle_count) // 12 % 2
    checks = light.Checker((0.2, 0.4, 0.6), (0.9, 0.1, 0.3), 8)
    materials = [light.Lambertian(checks), light.Lambertian(0.5), light.Emissive((3.0, 2.0, 1.0))]
    numbers[-12:] = 2
    uv = np.random.default_rng(0).uniform(size=(len(mesh.vertices), 2))
    return Scene(mesh, materials, numbers, lights(at), constant_sky(0.3), uv=uv)


@pytest.mark.parametrize("view", ["pinhole", "orthographic", "fisheye", "hybrid"])
def test_a_picture_of_a_far_scene_is_that_of_the_near_one(view):
    def draw(scene, views):
        if view != "hybrid":
            return traced(scene, views[view], 2)
        return hybrid(scene, views["pinhole"], 2, occlusion_length=2.0, jitter="shared").image

    far, near = (draw(scene_of(mesh, at), views) for mesh, at, views in PLACES)
    assert near.std() > 0.02
    np.testing.assert_array_equal(far, near)


def test_a_renderer_goes_from_one_origin_to_another():
    with light.PathRenderer(scene_of(NEAR, 0.0), SEEN_NEAR["pinhole"], threads=1) as renderer:
        renderer.add(1)
        near = renderer.image
        renderer.update(scene_of(FAR, AWAY))
        renderer.look(SEEN_FAR["pinhole"])
        renderer.add(1)
        np.testing.assert_array_equal(renderer.image, near)
        assert renderer.scene.mesh is FAR


def bake_scene(mesh, at):
    emission = np.zeros((mesh.triangle_count, 3))
    emission[-2:] = 1.0
    opacity = np.ones(mesh.triangle_count)
    opacity[2:4] = 0.5
    return painted(mesh, 0.7, emission, opacity, lights=lights(at), sky=constant_sky(0.5))


@pytest.mark.parametrize("places", [ROOMS, [one[:2] for one in PLACES]], ids=["plain", "patterns"])
def test_a_lightmap_of_a_far_scene_is_that_of_the_near_one(places):
    make = bake_scene if places is ROOMS else scene_of
    far, near = (baked(make(mesh, at), sheet(mesh, 6), 4) for mesh, at in places)
    for name in ("direct", "indirect", "environment"):
        np.testing.assert_array_equal(getattr(far, name), getattr(near, name))
    assert near.combined.std() > 0.1
    assert far.texels.mesh is places[0][0]
    assert far.texels.positions.dtype == np.float64
    np.testing.assert_array_equal(far.texels.positions, near.texels.positions + AWAY)
    np.testing.assert_array_equal(far.texels.along_curve, near.texels.along_curve)


def test_a_view_of_a_far_scene_shows_the_colours_of_the_near_one():
    views, atlas = [], sheet(NEAR, 3)
    for mesh, at, cameras in PLACES:
        with atra.RasterTracer(mesh, cameras["pinhole"], threads=1) as tracer:
            image = np.ones((atlas.height, atlas.width, 3), np.float32)
            views.append(lit_view(tracer.trace(), scene_of(mesh, at), atlas, image))
    np.testing.assert_allclose(*views, atol=1e-5)


def test_probes_of_a_far_scene_are_those_of_the_near_one():
    found, points = [], np.array([[0.5, 0.5, 0.25], [0.0, 2.0, 0.0]])
    for mesh, at in ROOMS:
        with Baker(bake_scene(mesh, at), sheet(mesh, 6), threads=1) as baker:
            found.append(baker.probes(points + at, 64))
    np.testing.assert_array_equal(found[0].points, points + AWAY)
    np.testing.assert_array_equal(found[0].combined, found[1].combined)


def test_a_model_saved_with_the_light_of_a_far_scene_lies_where_the_scene_does(tmp_path):
    scene = bake_scene(ROOM_AWAY, AWAY)
    save_model(baked(scene, sheet(ROOM_AWAY, 6), 1), scene, tmp_path / "lit.glb")
    for mesh in (
        atra.load_mesh(tmp_path / "lit.glb"),
        atra.Mesh.from_trimesh(trimesh.load(tmp_path / "lit.glb").to_mesh()),
    ):
        np.testing.assert_allclose(mesh.bounds, ROOM_AWAY.bounds, rtol=0.0, atol=1e-6)
        assert mesh.has_origin
