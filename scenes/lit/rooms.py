"""Lit rooms: materials and lights for meshes of which triangles alone are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from atra.geometry.mesh import Mesh
from atra.light import Emissive, GradientSky, Lambertian, Scene, Sun, constant_sky
from atra.light.materials import Material
from scenes.cornell_box import cornell_box

_WHITE, _RED, _GREEN = (0.725, 0.71, 0.68), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)
_LAMP = (17.0, 12.0, 4.0)
"""Radiance of the original box's lamp in linear RGB, as most renderers give it."""

_GREY = 0.7
_SUN = Sun((-0.35, -1.0, 0.25), 0.5, (1.0, 0.95, 0.85), 3.0)


def lit_cornell_box() -> Scene:
    """The built-in box: a red wall on the left, a green one on the right, all else white, and a lamp."""
    mesh = cornell_box()
    numbers = np.zeros(mesh.triangle_count, np.int32)
    numbers[6:8], numbers[8:10], numbers[10:12] = 1, 2, 3
    materials: Sequence[Material] = (Lambertian(_WHITE), Lambertian(_RED), Lambertian(_GREEN), Emissive(_LAMP))
    return Scene(mesh, materials, numbers, sky=constant_sky(0.0))


def lit_room(mesh: Mesh) -> Scene:
    """The mesh with light: that of the built-in box as above, anything else grey, beneath a sun and a sky."""
    box = lit_cornell_box()
    if np.array_equal(mesh.vertices, box.mesh.vertices) and np.array_equal(mesh.faces, box.mesh.faces):
        return replace(box, mesh=mesh)
    sky = GradientSky((0.3, 0.3, 0.3), (0.5, 0.7, 1.0))
    return Scene(mesh, [Lambertian((_GREY, _GREY, _GREY))], lights=[_SUN], sky=sky)
