"""Faces that let light on."""

from dataclasses import replace

import numpy as np

import atra
from atra import light
from atra.light import Baker
from tests.baked import baked, cube, painted, sheet
from tests.meshes import joined, quads
from tests.shown import floor

ROOM = joined(cube(inwards=True), cube(0.3))
SUN = light.Sun((0.3, -1.0, 0.2), 0.0)


def scene_of(mesh, opacity, albedo=0.6):
    lights = [SUN, light.PointLight((0.6, 0.7, -0.6))]
    return painted(mesh, albedo, opacity=opacity, lights=lights, sky=light.constant_sky(0.5))


def test_a_room_of_nothing_but_panes_lets_the_sun_and_the_sky_in():
    mesh = cube(inwards=True)
    lightmap = baked(replace(scene_of(mesh, 0.25, albedo=0.0), lights=[SUN]), sheet(mesh, 4), 1024, bounces=0)
    below = lightmap.texels.normals[:, 1] > 0.9
    cosine = 1.0 / np.linalg.norm(SUN.direction)
    np.testing.assert_allclose(lightmap.direct[below], 0.75 * cosine, rtol=1e-5)
    count = 1024 * len(below)
    np.testing.assert_allclose(lightmap.environment.mean(), 0.5 * 0.75, rtol=5 * np.sqrt(1 / 3 / count))


def test_an_opaque_face_right_behind_a_pane_still_stops_rays_to_lights():
    plate, lid = quads([floor(0.5)]), floor(50.0, 0.5)
    just_below = [(x, y - 1e-3, z) for x, y, z in lid]
    mesh = joined(plate, quads([just_below]), quads([lid]))
    scene = scene_of(mesh, np.repeat([1.0, 0.0, 1.0], 2))
    lightmap = baked(replace(scene, lights=[SUN]), sheet(mesh, 4), 16, bounces=0)
    below = lightmap.texels.prim_id < 2
    assert lightmap.direct[below].max() == 0.0


def test_a_view_shows_the_same_texels_whether_or_not_faces_let_light_on():
    atlas, camera = sheet(ROOM, 8), atra.Camera((0.9, 0.8, 0.9), (0, -0.2, 0), width=48, height=32)
    seen = []
    for opacity in (1.0, 0.5):
        with Baker(scene_of(ROOM, np.full(24, opacity)), atlas, threads=1) as baker:
            baker.look(camera)
            seen.append(baker.visible)
    np.testing.assert_array_equal(*seen)
    assert 0.05 < seen[0].mean() < 0.9


def test_probes_see_through_panes():
    mesh = cube(inwards=True)
    found = []
    for opacity in (0.0, 1.0):
        scene = replace(scene_of(mesh, np.full(12, opacity)), lights=[])
        with Baker(scene, sheet(mesh, 4), threads=1) as baker:
            found.append(baker.probes([(0, 0, 0)], 256).environment[0, 0, 0])
    np.testing.assert_allclose(found, [0.5 * np.sqrt(4 * np.pi), 0.0], rtol=1e-5)
