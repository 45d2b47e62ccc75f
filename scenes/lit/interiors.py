"""The built-in interiors in light: the living room by its window and lamps, the atrium through its glass roof."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from atra.light import Emissive, GradientSky, Lambertian, MetallicRoughness, Scene, Sun
from atra.light.lights import Light
from atra.light.materials import Material
from scenes.atrium import planted_court
from scenes.living_room import furnished_room
from scenes.shapes import Part

_CLEAR = MetallicRoughness((1.0, 1.0, 1.0), opacity=0.0, alpha="blend")
"""A pane that light passes as if it were open: rays that are aimed at the sun find it."""

_BRASS = MetallicRoughness((0.8, 0.6, 0.3), metallic=1.0, roughness=0.35)
_LEAF = Lambertian((0.12, 0.27, 0.07))
_CLAY = Lambertian((0.5, 0.2, 0.1))

ROOM: Mapping[str, Material] = {
    "wall": Lambertian((0.72, 0.67, 0.58)),
    "white": Lambertian((0.82, 0.8, 0.76)),
    "floor": MetallicRoughness((0.34, 0.19, 0.09), roughness=0.4),
    "pane": _CLEAR,
    "curtain": Lambertian((0.5, 0.16, 0.1)),
    "brass": _BRASS,
    "brick": Lambertian((0.38, 0.16, 0.1)),
    "slate": Lambertian((0.12, 0.12, 0.13)),
    "log": Lambertian((0.25, 0.15, 0.08)),
    "wax": Lambertian((0.85, 0.78, 0.62)),
    "blue": MetallicRoughness((0.05, 0.14, 0.32), roughness=0.25),
    "canvas": Lambertian((0.22, 0.35, 0.4)),
    "walnut": MetallicRoughness((0.2, 0.1, 0.05), roughness=0.45),
    "oak": Lambertian((0.5, 0.34, 0.18)),
    "red": Lambertian((0.45, 0.07, 0.05)),
    "green": Lambertian((0.1, 0.24, 0.14)),
    "porcelain": MetallicRoughness((0.85, 0.84, 0.8), roughness=0.2),
    "fruit": Lambertian((0.75, 0.3, 0.04)),
    "linen": Lambertian((0.3, 0.38, 0.42)),
    "mustard": Lambertian((0.7, 0.45, 0.1)),
    "leather": MetallicRoughness((0.36, 0.15, 0.06), roughness=0.55),
    "clay": _CLAY,
    "leaf": _LEAF,
    "wool": Lambertian((0.74, 0.68, 0.55)),
    "shade": MetallicRoughness((0.8, 0.7, 0.5), emission=(3.2, 2.0, 0.9)),
    "bulb": Emissive((120.0, 80.0, 40.0)),
    "flame": Emissive((320.0, 200.0, 90.0)),
}
"""The living room's materials by what its triangles are made of."""

_ROOM_SUN = Sun((1.0, -0.62, -0.28), 0.5, (1.0, 0.86, 0.66), 28.0)
_ROOM_SKY = GradientSky((0.5, 0.6, 0.4), (1.5, 2.4, 4.0), 4.0)

COURT: Mapping[str, Material] = {
    "plaster": Lambertian((0.72, 0.64, 0.5)),
    "stone": Lambertian((0.68, 0.6, 0.48)),
    "marble": MetallicRoughness((0.78, 0.74, 0.66), roughness=0.5),
    "floor": MetallicRoughness((0.5, 0.42, 0.32), roughness=0.35),
    "glass": _CLEAR,
    "iron": Lambertian((0.1, 0.12, 0.12)),
    "door": Lambertian((0.2, 0.1, 0.05)),
    "shutter": Lambertian((0.15, 0.28, 0.24)),
    "brass": _BRASS,
    "curtain": Lambertian((0.55, 0.07, 0.05)),
    "banner": Lambertian((0.12, 0.2, 0.45)),
    "clay": _CLAY,
    "leaf": _LEAF,
    "lantern": MetallicRoughness((0.8, 0.6, 0.3), emission=(3.0, 1.8, 0.7)),
    "globe": Emissive((8.0, 6.0, 3.5)),
}
"""The atrium's materials by what its triangles are made of."""

_COURT_SUN = Sun((0.3, -1.0, 0.42), 0.5, (1.0, 0.9, 0.74), 5.0)
_COURT_SKY = GradientSky((0.5, 0.5, 0.5), (1.0, 1.5, 2.2), 0.8)


def lit_living_room() -> Scene:
    """An afternoon's sun through the window, a blue sky, a lamp in the corner, candles on the chandelier."""
    return _scene("living_room", furnished_room(), ROOM, _ROOM_SUN, _ROOM_SKY)


def lit_atrium() -> Scene:
    """A sun and a sky through the glass over the court, six hanging lamps, and lanterns in the aisles."""
    return _scene("atrium", planted_court(), COURT, _COURT_SUN, _COURT_SKY)


def _scene(name: str, part: Part, materials: Mapping[str, Material], light: Light, sky: GradientSky) -> Scene:
    names, numbers = np.unique(np.asarray(part.stuff, np.str_), return_inverse=True)
    used = [materials[one] for one in names.tolist()]
    return Scene(part.to_mesh(name), used, numbers.ravel().astype(np.int32), [light], sky)
