"""Bakes through glass, metal and smooth normals, by closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from atra import light
from tests.baked import baked, sheet
from tests.meshes import quads
from tests.shown import BLACK, floor, sphere

SUN = light.Sun((0, -1, 0), 0.0)


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
