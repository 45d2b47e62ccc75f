"""Materials: what a triangle does with light, and what colour it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.render.checks import Colour, check_one_of, checked_colour, checked_number, checked_texels

MOST_TEXELS = 1 << 26
"""Of an image: 768 MiB as it is kept."""

FRESNEL = ("exact", "schlick")
DIRECTIONS = ("cosine", "uniform")


@dataclass(frozen=True)
class Checker:
    """Two colours in turn: squares of 1 / `scale` of uv. first: where u and v are just above 0."""

    first: Colour
    second: Colour
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("first", "second"):
            object.__setattr__(self, name, checked_colour(f"{name} of a checker", getattr(self, name), 1.0))
        object.__setattr__(self, "scale", checked_number("scale of a checker", self.scale, 0.0, above=True))


@dataclass(frozen=True, eq=False)
class Image:
    """An image over uv in [0, 1], repeated beyond, read between its texels.

    texels: (H, W, 3), linear RGB in [0, 1], copied as float32; row 0 is at v = 1, column 0 at u = 0.
    """

    texels: NDArray[np.float32]

    def __post_init__(self) -> None:
        texels = checked_texels("texels of an image", self.texels, 1.0)
        if texels.shape[0] * texels.shape[1] > MOST_TEXELS:
            raise InputError(f"an image has {texels.shape[:2]} texels, expected at most {MOST_TEXELS}; make it smaller")
        object.__setattr__(self, "texels", texels)


Texture = Colour | Checker | Image
"""A colour is three numbers, linear RGB, or one for a grey."""


@dataclass(frozen=True)
class Lambertian:
    """Reflects equally to all sides. colour: albedo in [0, 1].

    directions: how a path goes on, "cosine" or "uniform" over the hemisphere; the picture converges to the same.
    """

    colour: Texture = (0.5, 0.5, 0.5)
    directions: str = "cosine"

    def __post_init__(self) -> None:
        _check_texture(self, "Lambertian")
        check_one_of("directions of Lambertian", self.directions, DIRECTIONS)


@dataclass(frozen=True)
class Metal:
    """A mirror, blurred by `fuzz`: the radius in [0, 1] of a sphere around the tip of the mirrored unit vector from
    which the new direction is chosen; those below the surface are absorbed. colour: reflectance in [0, 1]."""

    colour: Texture = (0.8, 0.8, 0.8)
    fuzz: float = 0.0

    def __post_init__(self) -> None:
        _check_texture(self, "Metal")
        object.__setattr__(self, "fuzz", checked_number("fuzz of Metal", self.fuzz, 0.0, 1.0))


@dataclass(frozen=True)
class Dielectric:
    """Clear glass, mirroring and refracting; its triangles' fronts (counter-clockwise) face outwards.

    ior: index of refraction, inside over outside. fresnel: "exact", or "schlick" for his approximation.
    """

    ior: float = 1.5
    fresnel: str = "exact"

    def __post_init__(self) -> None:
        object.__setattr__(self, "ior", checked_number("ior of Dielectric", self.ior, 0.0, 1e3, above=True))
        check_one_of("fresnel of Dielectric", self.fresnel, FRESNEL)


@dataclass(frozen=True)
class Emissive:
    """A lamp: its front sends out `colour`, radiance of any size, to all sides, its back nothing; it reflects none."""

    colour: Colour = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "colour", checked_colour("colour of Emissive", self.colour, 1e12))


Material = Lambertian | Metal | Dielectric | Emissive


def needs_uv(material: Material) -> bool:
    """Whether its colour hangs on uv."""
    return isinstance(getattr(material, "colour", None), Checker | Image)


def base_colour(material: Any, has_uv: bool) -> Lambertian:
    """Of a material of trimesh's its base colour alone; of none, grey. has_uv: whether its texture can be read."""
    if hasattr(material, "to_pbr"):
        material = material.to_pbr()
    if not hasattr(material, "baseColorFactor"):
        return Lambertian()
    factor = np.asarray((1.0, 1.0, 1.0) if material.baseColorFactor is None else material.baseColorFactor)
    red, green, blue = (factor[:3] / (255.0 if factor.dtype.kind in "iu" else 1.0)).tolist()
    texture = material.baseColorTexture
    if texture is None or not has_uv:
        return Lambertian((red, green, blue))
    coded = np.asarray(texture.convert("RGB"), np.float32) / np.float32(255.0)
    texels = np.where(coded <= 0.04045, coded / 12.92, ((coded + 0.055) / 1.055) ** 2.4)  # sRGB
    return Lambertian(Image(texels * np.array((red, green, blue))))


def _check_texture(material: Any, name: str) -> None:
    if not isinstance(material.colour, Checker | Image):
        object.__setattr__(material, "colour", checked_colour(f"colour of {name}", material.colour, 1.0))
