"""Bakes through glass, metal and smooth normals, by closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from atra import light
from atra.light import Baker
from scenes.lit.rooms import lit_cornell_box
from tests.baked import baked, sheet
from tests.meshes import quads
from tests.shown import BLACK, floor, sphere

SUN = light.Sun((0, -1, 0), 0.0)


def test_the_sun_shines_through_a_clear_pane_and_takes_its_colour():
    tint = np.array((0.9, 0.6, 0.3))
    pane = light.MetallicRoughness(tuple(tint), roughness=0.0, transmission=1.0)
    mesh = quads([floor(1.0), floor(4.0, 1.5)])
    scene = light.Scene(mesh, [light.Lambertian(0.5), pane], [0, 0, 1, 1], [SUN], BLACK)
    lit = baked(scene, sheet(mesh, 4), 4, bounces=0)
    below = lit.direct[lit.texels.prim_id < 2]
    np.testing.assert_allclose(below, np.broadcast_to(0.96 * tint, below.shape), rtol=1e-4)


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
    ball = replace(sphere(light.Lambertian(0.5), BLACK, segments=12), lights=[SUN])
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


def test_threads_change_no_bit_and_probes_see_the_sky():
    room = replace(lit_cornell_box(), sky=light.constant_sky(0.3))
    atlas = sheet(room.mesh, 5)
    one, two = (baked(room, atlas, 20, threads=threads).combined for threads in (1, 2))
    np.testing.assert_array_equal(one, two)
    open_ = light.Scene(quads([floor(0.1, -90.0)]), sky=light.constant_sky(0.5))
    with Baker(open_, sheet(open_.mesh, 4), threads=1) as baker:
        probes = baker.probes([(0, 0, 0), (1, 0, 0)], 256)
    np.testing.assert_allclose(probes.environment[:, 0, 0], 0.5 * np.sqrt(4 * np.pi), rtol=1e-3)


def test_a_probe_holds_the_light_of_a_lamp_over_the_squared_distance():
    scene = light.Scene(quads([floor(0.1, -90.0)]), lights=[light.PointLight((0, 2, 0), power=8.0)], sky=BLACK)
    with Baker(scene, sheet(scene.mesh, 4), threads=1) as baker:
        probes = baker.probes([(0, 0, 0), (0, 1, 0)], 64)
    constant = 8.0 * np.pi / np.array([4.0, 1.0]) * np.sqrt(0.25 / np.pi)
    np.testing.assert_allclose(probes.direct[:, 0, 0], constant, rtol=1e-3)
