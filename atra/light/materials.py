"""Materials: how triangles scatter light, and their colours."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import Vector, checked_vector
from atra.light.checks import Colour, check_one_of, checked_colour, checked_image, checked_number, set_fields
from atra.light.scattering_kernels import DIELECTRIC, EMISSIVE, LAMBERTIAN, METAL, PHYSICAL

MOST_TEXELS = 1 << 26
"""Most texels of an image; they take 768 MiB."""

FRESNEL = ("exact", "schlick")
DIRECTIONS = ("cosine", "uniform")
BELOW = ("absorbed", "passes")
WRAPS = ("repeat", "mirror", "clamp")
ALPHA = ("opaque", "mask", "blend")

_STEPS = np.arange(256) / 255.0
CURVES = np.array([_STEPS, np.where(_STEPS <= 0.04045, _STEPS / 12.92, ((_STEPS + 0.055) / 1.055) ** 2.4)], np.float32)
"""What bytes stand for: as they are, and as sRGB codes."""


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
    """An image over uv, with bilinear filtering in linear light.

    texels: (H, W, 3) or (H, W, 4), copied; float32 in [0, 1], or uint8 (0 to 255 stand for 0 to 1). The fourth channel
    is opacity. Row 0 is at v = 1, column 0 at u = 0. is_coded: whether the first three channels of uint8 are sRGB
    codes. factor: linear RGB and opacity that multiply the texels. second_uv: whether the scene's `second_uv` is used.
    placement: ((a, b, c), (d, e, f)): u, v of the image are a u + b v + c and d u + e v + f of the vertices'. wrap:
    what lies outside [0, 1] in u and in v, "repeat", "mirror" or "clamp". is_nearest: without filtering.
    """

    texels: NDArray[Any]
    is_coded: bool = False
    factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    second_uv: bool = False
    placement: tuple[Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    wrap: tuple[str, str] = ("repeat", "repeat")
    is_nearest: bool = False

    def __post_init__(self) -> None:
        texels = checked_image("texels of an image", self.texels)
        if texels.shape[0] * texels.shape[1] > MOST_TEXELS:
            raise InputError(f"an image has {texels.shape[:2]} texels, expected at most {MOST_TEXELS}; make it smaller")
        red, green, blue, opacity = self.factor
        factor = (*checked_colour("factor of an image", (red, green, blue), 1e12), opacity)
        first, second = (checked_vector("placement of an image", row) for row in self.placement)
        for wrap in self.wrap:
            check_one_of("wrap of an image", wrap, WRAPS)
        set_fields(self, texels=texels, factor=factor, placement=(first, second))

    def at(self, uv: NDArray[np.floating]) -> NDArray[np.float32]:
        """(N, 4) float32, linear RGB and opacity at (N, 2) uv of vertices, of the nearest texels."""
        one = np.column_stack([uv, np.ones(len(uv))]).astype(np.float64) @ np.array(self.placement).T
        rows, columns, channels = self.texels.shape
        x = _numbers_of(one[:, 0], columns, self.wrap[0])
        y = _numbers_of(1.0 - one[:, 1], rows, self.wrap[1])
        found = np.ones((len(uv), 4), np.float32)
        found[:, :channels] = linear(self.texels[y, x], self.is_coded)
        return found * np.array(self.factor, np.float32)


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


@dataclass(frozen=True, eq=False)
class MetallicRoughness(Material):
    """The material of glTF: metal, or a diffuse surface beneath a rough dielectric that may let light through.

    colour: base colour in [0, 1]. opacity: in [0, 1], times that of the colour's image and of the vertices. alpha:
    "opaque" ignores opacity; "mask" makes holes where it is below `cutoff`; with "blend" it is the share of light that
    meets the surface. metallic, roughness: in [0, 1], times the blue and green of `metallic_roughness`. emission:
    radiance of the front, times `emission_image`. normals: an image of normals, x and y times `normal_scale`.
    transmission: share of light that is not reflected and passes, times the red of `transmission_image`. ior: index of
    refraction. is_thin: a wall without thickness, which does not bend light; otherwise a surface of a solid. is_double:
    whether backs are seen; the eye looks through backs of others.
    Source: glTF 2.0, appendix B, and the extensions KHR_materials_emissive_strength, _ior, _transmission and _volume.
    """

    kind = PHYSICAL
    colour: Texture = (1.0, 1.0, 1.0)
    opacity: float = 1.0
    alpha: str = "opaque"
    cutoff: float = 0.5
    metallic: float = 0.0
    roughness: float = 1.0
    metallic_roughness: Image | None = None
    emission: Colour = (0.0, 0.0, 0.0)
    emission_image: Image | None = None
    normals: Image | None = None
    normal_scale: float = 1.0
    transmission: float = 0.0
    transmission_image: Image | None = None
    ior: float = 1.5
    is_thin: bool = True
    is_double: bool = True
    name: str = ""

    def __post_init__(self) -> None:
        _check_texture(self, "MetallicRoughness")
        check_one_of("alpha of MetallicRoughness", self.alpha, ALPHA)
        for name in ("opacity", "cutoff", "metallic", "roughness", "transmission"):
            number = checked_number(f"{name} of MetallicRoughness", getattr(self, name), 0.0, 1.0)
            object.__setattr__(self, name, number)
        scale = checked_number("normal_scale of MetallicRoughness", self.normal_scale, -1e3, 1e3)
        ior = checked_number("ior of MetallicRoughness", self.ior, 1.0, 1e3)
        emission = checked_colour("emission of MetallicRoughness", self.emission, 1e12)
        set_fields(self, normal_scale=scale, ior=ior, emission=emission)

    @property
    def plain(self) -> Texture:
        return self.colour

    @property
    def numbers(self) -> tuple[float, bool]:
        return self.ior, self.is_thin

    @property
    def images(self) -> tuple[Image | None, ...]:
        """Of colour, metal and roughness, normals, emission, transmission."""
        colour = self.colour if isinstance(self.colour, Image) else None
        return colour, self.metallic_roughness, self.normals, self.emission_image, self.transmission_image


def linear(texels: NDArray[Any], is_coded: bool) -> NDArray[np.float32]:
    """Texels (..., channels) of an `Image` as float32 in linear light."""
    if texels.dtype != np.uint8:
        return texels
    found = CURVES[0][texels]
    if is_coded:
        found[..., :3] = CURVES[1][texels[..., :3]]
    return found


def _numbers_of(places: NDArray[np.float64], count: int, wrap: str) -> NDArray[np.int64]:
    """Numbers of the texels of an axis at places in [0, 1] and beyond."""
    if wrap == "clamp":
        places = np.clip(places, 0.0, 1.0)
    elif wrap == "mirror":
        places = 1.0 - np.abs(places % 2.0 - 1.0)
    else:
        places = places % 1.0
    return np.minimum((places * count).astype(np.int64), count - 1)


def images_of(material: Material) -> tuple[Image | None, ...]:
    """As `MetallicRoughness.images`, of any material."""
    if isinstance(material, MetallicRoughness):
        return material.images
    colour = getattr(material, "colour", None)
    return (colour if isinstance(colour, Image) else None, None, None, None, None)


def needs_uv(material: Material) -> bool:
    """Whether it has a texture over uv."""
    return isinstance(getattr(material, "colour", None), Checker) or any(images_of(material))


def _check_texture(material: Any, name: str) -> None:
    if not isinstance(material.colour, Checker | Image):
        object.__setattr__(material, "colour", checked_colour(f"colour of {name}", material.colour, 1.0))
