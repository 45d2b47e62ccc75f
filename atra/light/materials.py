"""Materials: how triangles scatter light, and their colours."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.light.checks import Colour, check_one_of, checked_colour, checked_number, checked_texels
from atra.light.scattering_kernels import DIELECTRIC, EMISSIVE, LAMBERTIAN, METAL

MOST_TEXELS = 1 << 26
"""Most texels of an image; they take 768 MiB."""

FRESNEL = ("exact", "schlick")
DIRECTIONS = ("cosine", "uniform")
BELOW = ("absorbed", "passes")


@dataclass(frozen=True)
class Checker:
    """A checkerboard over uv.

    first: colour of the square just above u = v = 0. second: the other colour. scale: squares per unit of uv.
    """

    first: Colour
    second: Colour
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("first", "second"):
            object.__setattr__(self, name, checked_colour(f"{name} of a checker", getattr(self, name), 1.0))
        object.__setattr__(self, "scale", checked_number("scale of a checker", self.scale, 0.0, above=True))


@dataclass(frozen=True, eq=False)
class Image:
    """An image over uv in [0, 1], repeated outside, with bilinear filtering.

    texels: (H, W, 3), linear RGB in [0, 1], copied as float32; row 0 is at v = 1, column 0 at u = 0.
    """

    texels: NDArray[np.float32]

    def __post_init__(self) -> None:
        texels = checked_texels("texels of an image", self.texels, 1.0)
        if texels.shape[0] * texels.shape[1] > MOST_TEXELS:
            raise InputError(f"an image has {texels.shape[:2]} texels, expected at most {MOST_TEXELS}; make it smaller")
        object.__setattr__(self, "texels", texels)


Texture = Colour | Checker | Image
"""A colour is linear RGB, or one number for a grey."""


class Material(ABC):
    """Base of materials. A new kind needs a subclass and a branch in `atra.light.scattering_kernels.scatter`.

    kind: its number in `atra.light.scattering_kernels`.
    """

    kind: ClassVar[int]

    @property
    @abstractmethod
    def plain(self) -> Texture:
        """The diffuse colour that stands for it in hybrid pictures and lightmaps."""

    @property
    def emission(self) -> Colour:
        """Radiance that its front emits."""
        return (0.0, 0.0, 0.0)

    @property
    def numbers(self) -> tuple[float, bool]:
        """PARAMETER and VARIANT of its row."""
        return 0.0, False


@dataclass(frozen=True)
class Lambertian(Material):
    """A diffuse surface.

    colour: albedo in [0, 1]. directions: how path tracing samples the hemisphere, "cosine" or "uniform"; both converge
    to the same picture.
    """

    kind = LAMBERTIAN
    colour: Texture = (0.5, 0.5, 0.5)
    directions: str = "cosine"

    def __post_init__(self) -> None:
        _check_texture(self, "Lambertian")
        check_one_of("directions of Lambertian", self.directions, DIRECTIONS)

    @property
    def plain(self) -> Texture:
        return self.colour

    @property
    def numbers(self) -> tuple[float, bool]:
        return 0.0, self.directions == "uniform"


@dataclass(frozen=True)
class Metal(Material):
    """A mirror, blurred by `fuzz`.

    colour: reflectance in [0, 1]. fuzz: in [0, 1], radius of a sphere around the tip of the mirrored unit vector, on
    which the new direction ends. below: directions below the surface are "absorbed", or the ray "passes" through the
    triangle, as in renderers that do not check.
    """

    kind = METAL
    colour: Texture = (0.8, 0.8, 0.8)
    fuzz: float = 0.0
    below: str = "absorbed"

    def __post_init__(self) -> None:
        _check_texture(self, "Metal")
        object.__setattr__(self, "fuzz", checked_number("fuzz of Metal", self.fuzz, 0.0, 1.0))
        check_one_of("below of Metal", self.below, BELOW)

    @property
    def plain(self) -> Texture:
        return self.colour

    @property
    def numbers(self) -> tuple[float, bool]:
        return self.fuzz, self.below == "passes"


@dataclass(frozen=True)
class Dielectric(Material):
    """Clear glass that reflects and refracts; triangles are counterclockwise seen from outside.

    ior: index of refraction, inside over outside. fresnel: "exact", or "schlick" for Schlick's approximation.
    """

    kind = DIELECTRIC
    ior: float = 1.5
    fresnel: str = "exact"

    def __post_init__(self) -> None:
        object.__setattr__(self, "ior", checked_number("ior of Dielectric", self.ior, 0.0, 1e3, above=True))
        check_one_of("fresnel of Dielectric", self.fresnel, FRESNEL)

    @property
    def plain(self) -> Texture:
        return (1.0, 1.0, 1.0)

    @property
    def numbers(self) -> tuple[float, bool]:
        return self.ior, self.fresnel == "schlick"


@dataclass(frozen=True)
class Emissive(Material):
    """An emitter without reflection: its front emits in all directions, its back is black.

    colour: emitted radiance, linear RGB.
    """

    kind = EMISSIVE
    colour: Colour = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "colour", checked_colour("colour of Emissive", self.colour, 1e12))

    @property
    def plain(self) -> Texture:
        red, green, blue = self.colour
        return min(red, 1.0), min(green, 1.0), min(blue, 1.0)

    @property
    def emission(self) -> Colour:
        return self.colour


def needs_uv(material: Material) -> bool:
    """Whether its colour is a texture over uv."""
    return isinstance(getattr(material, "colour", None), Checker | Image)


def base_colour(material: Any, has_uv: bool) -> Lambertian:
    """A `Lambertian` of a trimesh material's base colour; grey without a material. has_uv: whether its texture can be
    used."""
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
