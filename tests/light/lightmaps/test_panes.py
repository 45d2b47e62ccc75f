"""Bakes through panes, and with metal and smooth normals, by closed forms."""

from dataclasses import replace

import numpy as np
import pytest

import atra
from atra import light
from atra.light import Baker
from tests.baked import baked, cube, painted, sheet
from tests.meshes import joined, quads
from tests.shown import BLACK, floor, sphere

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


@pytest.mark.parametrize("ceiling", [light.Metal(0.5), light.Lambertian(0.5)], ids=["mirror", "dull"])
def test_a_ceiling_throws_back_the_light_of_the_floor(ceiling):
    mesh = quads([floor(200.0), floor(200.0, 1.0)[::-1]])
    scene = light.Scene(mesh, [light.Emissive((1, 1, 1)), ceiling], [0, 0, 1, 1], sky=BLACK)
    lit = baked(scene, sheet(mesh, 4), 512, bounces=1)
    inner = (lit.texels.prim_id < 2) & (np.abs(lit.texels.positions) < 150).all(axis=1)
    np.testing.assert_allclose(lit.indirect[inner].mean(), 0.5, rtol=0.03)
    assert lit.direct[inner].max() == 0.0
    above = (lit.texels.prim_id >= 2) & (np.abs(lit.texels.positions) < 150).all(axis=1)
    np.testing.assert_allclose(lit.direct[above].mean(), 1.0, rtol=0.03)


def test_smooth_normals_light_a_ball_as_a_ball():
    ball = replace(sphere(light.Lambertian(0.5), BLACK, segments=12), lights=[light.Sun((0, -1, 0), 0.0)])
    count = ball.mesh.triangle_count
    side = int(np.ceil(np.sqrt(count)))
    row, column = np.divmod(np.arange(count), side)
    corners = np.array([(0.1, 0.1), (0.8, 0.1), (0.1, 0.8)])
    uv = (np.stack([column, row], -1)[:, None] + corners) / side
    atlas = light.Atlas.of_uv(uv, 8 * side, 8 * side)
    lit = baked(ball, atlas, 64, bounces=0)
    height = lit.texels.positions[:, 1] / np.linalg.norm(lit.texels.positions, axis=1)
    top = lit.texels.normals[:, 1] > 0.3
    np.testing.assert_allclose(lit.direct[top, 0], height[top], atol=0.06)
    flat = baked(replace(ball, normals=None), atlas, 64, bounces=0)
    assert np.abs(flat.direct[top, 0] - height[top]).max() > 0.1


def test_a_clamp_limits_each_share_of_indirect_light_and_no_other():
    mesh = quads([floor(1.0), floor(1.0, 1.0)[::-1]])
    scene = light.Scene(mesh, [light.Lambertian(1.0)], sky=light.constant_sky(1.0))
    whole, less = (
        baked(scene, sheet(mesh, 4), 16, bounces=64, roulette_from=None, clamp=most) for most in (None, 0.25)
    )
    np.testing.assert_array_equal(less.environment, whole.environment)
    np.testing.assert_allclose(less.indirect, 0.25 * whole.indirect, rtol=1e-5)
    assert whole.indirect.min() > 0.0
