"""Shading normals that lean far from the triangle: light is neither lost below the surface, nor counted twice."""

import numpy as np
import pytest

import atra
from atra import light
from tests.meshes import quads
from tests.shown import BLACK, floor, traced

UV = [(0, 0), (1, 0), (1, 1), (0, 1)]


def leaning(degrees):
    """An image of normals that lean towards growing u, here +x."""
    angle = np.radians(degrees)
    normal = 0.5 + 0.5 * np.array([np.sin(angle), 0.0, np.cos(angle)])
    return light.Image(np.broadcast_to(normal.astype(np.float32), (1, 1, 3)))


def bumped(degrees, sky, lamp=None, **material):
    """A floor whose normals lean, beneath a lamp."""
    parts = [floor(50.0)] + ([] if lamp is None else [lamp])
    materials = [
        light.MetallicRoughness(normals=leaning(degrees), **material), light.Emissive((5.0, 5.0, 5.0)),
    ]  # fmt: skip
    mesh = quads(parts)
    return light.Scene(mesh, materials[: len(parts)], np.repeat(range(len(parts)), 2), sky=sky, uv=UV * len(parts))


def from_side(x):
    """Looks at the origin at an angle of 45 degrees."""
    return atra.Camera((x, 4, 0), (0, 0, 0), (0, 1, 0), 2, 8, 8)


@pytest.mark.parametrize("x", [4, -4])
@pytest.mark.parametrize(("roughness", "lost"), [(0.0, 1e-5), (0.2, 0.04)])
def test_bumped_metal_reflects_all_light_of_a_furnace_from_both_sides(x, roughness, lost):
    scene = bumped(35, light.constant_sky(1.0), metallic=1.0, roughness=roughness)
    image = traced(scene, from_side(x), 64, bounces=1)
    np.testing.assert_allclose(image.mean(), 1.0, atol=lost)


@pytest.mark.parametrize("x", [4, -4])
@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_rays_aimed_at_a_lamp_and_scattered_ones_share_its_light_where_normals_lean(x, metallic):
    lamp = floor(20.0, 8.0)[::-1]  # its front faces down, above the camera
    scene = bumped(35, BLACK, lamp, metallic=metallic, roughness=0.5)
    aimed, found = (traced(scene, from_side(x), 512, bounces=1, lights=way).mean() for way in ("aimed", "found"))
    assert aimed > 0.5
    np.testing.assert_allclose(aimed, found, rtol=0.02)
