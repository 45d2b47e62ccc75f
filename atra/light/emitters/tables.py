"""A scene's emitters as kernels read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.emitters.emitters_kernels import Emitters, fill_alias_table
from atra.light.emitters.grid_kernels import lamp_grid, no_grid
from atra.light.lights import Light, SpotLight, Sun, light_row
from atra.light.lights_kernels import LIGHT_WORDS
from atra.light.materials import Material
from atra.light.numbers_kernels import LUMINANCE
from atra.light.scene import Scene
from atra.light.sky import PanoramaSky
from atra.light.tables import area_vectors
from atra.light.textures import linear

_LUMINANCE = np.array(LUMINANCE)

_LEAST_SHARE = 0.25
"""Least share of rays for triangles, for the sky, and for lamps, where several shine: only one may reach a room."""

_MOST_CANDIDATES = 5
"""Most points of emitters that are weighed for each ray. The points of one lamp are alike, and weighing takes time."""

_PANORAMA_COUNTS = 4
"""How many emitters a panorama counts as."""


def emitters_of(scene: Scene, lights: str = "aimed") -> Emitters:
    """The triangles of a scene that shine by their power, its lamps by theirs, and its sky, if a panorama, by the
    radiance of texels. A sky of a gradient is left to scattering, which finds it everywhere.

    lights: "grid": lamps are chosen by what each may give where a ray starts, by a grid over the mesh. "found": nothing
    is aimed at.
    """
    scene = scene.local
    mesh, is_aimed = scene.mesh, lights != "found"
    luminance = np.array([_LUMINANCE @ mean_emission(material) for material in scene.materials])[scene.face_materials]
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    areas = np.linalg.norm(area_vectors(corners), axis=1)
    powers = np.pi * areas * luminance * is_aimed
    prim_ids = np.flatnonzero(powers > 0.0).astype(np.uint32)
    corners = corners[prim_ids]
    corners[:, 1:] -= corners[:, :1]
    texels = _sky_weights(scene) if is_aimed else np.zeros((0, 0))
    radius = float(0.5 * np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
    lamps = [lamp for lamp in scene.lights if lamp.power * max(lamp.colour) > 0.0 and is_aimed]
    of_lamps = np.array([_lamp_power(lamp, radius) for lamp in lamps])
    of_triangles, sky_share, lamp_share = _shares(
        float(powers.sum()), float(texels.sum() * np.pi * radius**2), float(of_lamps.sum())
    )
    densities = np.zeros(mesh.triangle_count if len(prim_ids) else 0)
    if len(prim_ids):
        densities[prim_ids] = of_triangles * powers[prim_ids] / powers.sum() / areas[prim_ids]
    sky = texels / texels.sum() * sky_share * texels.size / (2.0 * np.pi**2) if texels.size else texels
    rows = np.array([light_row(lamp) for lamp in lamps], np.float32).reshape(-1, LIGHT_WORDS)
    light = np.array([np.pi * lamp.power * np.array(lamp.colour) for lamp in lamps]).reshape(-1, 3)
    grid, chosen = no_grid(), lamp_share * of_lamps[:, None] / max(of_lamps.sum(), 1e-300)
    if len(lamps) and lights == "grid":
        grid, chosen = lamp_grid(rows, light @ _LUMINANCE / np.pi, mesh.bounds), np.full(1, lamp_share)
    count = len(prim_ids) + len(lamps) + _PANORAMA_COUNTS * bool(texels.size)
    return Emitters(
        prim_ids,
        corners.reshape(-1, 9).astype(np.float32),
        *_alias_table(powers[prim_ids]),
        densities.astype(np.float32),
        *_alias_table(texels.ravel()),
        sky.astype(np.float32),
        rows,
        np.minimum(light / chosen, 1e30).astype(np.float32),
        *_alias_table(of_lamps),
        np.float32(sky_share),
        np.float32(lamp_share),
        min(max(1, count.bit_length() - 1), _MOST_CANDIDATES),
        grid,
    )


def _shares(*powers: float) -> NDArray[np.float64]:
    """How often triangles, the sky and lamps are chosen: by their power, and each that shines by its least share."""
    given = np.array(powers)
    shining = given > 0.0
    rest = 1.0 - _LEAST_SHARE * shining.sum() if shining.sum() > 1 else 1.0
    return np.asarray(np.where(shining, 1.0 - rest, 0.0) / max(shining.sum(), 1) + rest * given / (given.sum() or 1.0))


def mean_emission(material: Material) -> NDArray[np.float64]:
    """Radiance of a material, that of its image on average."""
    emission, image = np.array(material.emission), material.images[3]
    if image is None or not emission.any():
        return emission
    step = max(1, int(max(image.texels.shape[:2]) / 256))
    mean = linear(image.texels[::step, ::step, :3], image.is_coded).reshape(-1, 3).mean(axis=0)
    return np.asarray(emission * mean * image.factor[:3])


def _lamp_power(lamp: Light, radius: float) -> float:
    """Light that a lamp sends into a scene of this radius."""
    strength = np.pi * lamp.power * float(_LUMINANCE @ np.array(lamp.colour))
    if isinstance(lamp, Sun):
        return float(strength * np.pi * radius**2)
    if isinstance(lamp, SpotLight):
        return float(strength * 2.0 * np.pi * (1.0 - np.cos(np.radians(lamp.outer_degrees))))
    return float(strength * 4.0 * np.pi)


def _sky_weights(scene: Scene) -> NDArray[np.float64]:
    """(H, W): luminance times solid angle of the texels of a panorama; (0, 0) for another sky, or a black one."""
    sky = scene.sky
    if not isinstance(sky, PanoramaSky) or sky.power == 0.0 or not sky.texels.any():
        return np.zeros((0, 0))
    weights = sky.power * (sky.texels.astype(np.float64) @ _LUMINANCE)
    heights = np.cos(np.pi * np.arange(len(weights) + 1) / len(weights))
    return np.asarray(weights * (heights[:-1] - heights[1:])[:, None] * (2.0 * np.pi / weights.shape[1]))


def _alias_table(weights: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """`odds` and `others` of `fill_alias_table`."""
    count = len(weights)
    odds = weights * (count / weights.sum()) if count else np.zeros(0)
    others, small, large = (np.empty(count, np.int32) for _ in range(3))
    fill_alias_table(odds, others, small, large)
    return odds.astype(np.float32), others
