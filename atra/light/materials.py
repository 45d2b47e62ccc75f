"""Materials: how triangles scatter light, and their colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from atra.choices import check_choice
from atra.light.checks import Colour, check_fields
from atra.light.scattering.seen_kernels import LEAST_BEND, SMOOTH
from atra.light.scattering.spots_kernels import DIELECTRIC, EMISSIVE, LAMBERTIAN, METAL, PHYSICAL
from atra.light.textures import Checker, Image, Texture

FRESNEL = ("exact", "schlick")
ALPHA = ("opaque", "mask", "blend")
IMAGE_FIELDS = ("colour", "metallic_roughness", "normals", "emission_image", "transmission_image")
"""Fields of `MetallicRoughness` that may be images."""


class Material:
    """Base of materials. A new kind needs a subclass and a branch in `atra.light.scattering.spots_kernels.scatter`.

    kind: its number in `atra.light.scattering.spots_kernels`. colour: see the subclasses. emission: radiance of its
    front.
    """

    kind: ClassVar[int]
    colour: Any = (1.0, 1.0, 1.0)
    emission: Any = (0.0, 0.0, 0.0)

    @property
    def plain(self) -> Texture:
        """The diffuse colour that stands for it in hybrid pictures and lightmaps."""
        return self.colour  # type: ignore[no-any-return]

    @property
    def clear_share(self) -> float:
        """The share of light that clear glass lets straight on at a right angle, colour left out; 0 of others."""
        return 0.0

    @property
    def images(self) -> tuple[Image | None, ...]:
        """Those of IMAGE_FIELDS that are images; None where there is none."""
        found = (getattr(self, name, None) for name in IMAGE_FIELDS)
        return tuple(one if isinstance(one, Image) else None for one in found)


@dataclass(frozen=True)
class Lambertian(Material):
    """A diffuse surface. colour: albedo in [0, 1]."""

    kind = LAMBERTIAN
    colour: Texture = (0.5, 0.5, 0.5)

    def __post_init__(self) -> None:
        _check_texture(self)


@dataclass(frozen=True)
class Metal(Material):
    """A mirror, blurred by `fuzz`.

    colour: reflectance in [0, 1]. fuzz: in [0, 1], radius of a sphere around the tip of the mirrored unit vector, on
    which the new direction ends; what ends below the surface is absorbed.
    """

    kind = METAL
    colour: Texture = (0.8, 0.8, 0.8)
    fuzz: float = 0.0

    def __post_init__(self) -> None:
        _check_texture(self)
        check_fields(self, fuzz=(0.0, 1.0))


@dataclass(frozen=True)
class Dielectric(Material):
    """Clear glass that reflects and refracts; triangles are counterclockwise seen from outside.

    ior: index of refraction, inside over outside. fresnel: "exact", or "schlick" for Schlick's approximation.
    """

    kind = DIELECTRIC
    ior: float = 1.5
    fresnel: str = "exact"

    def __post_init__(self) -> None:
        check_fields(self, ior=(0.0, 1e3, True))
        check_choice("fresnel of Dielectric", self.fresnel, FRESNEL)

    @property
    def clear_share(self) -> float:
        return 1.0 - ((self.ior - 1.0) / (self.ior + 1.0)) ** 2


@dataclass(frozen=True)
class Emissive(Material):
    """An emitter without reflection: its front emits in all directions, its back is black.

    colour: emitted radiance, linear RGB.
    """

    kind = EMISSIVE
    colour: Colour = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        check_fields(self, colour=1e12)

    @property
    def plain(self) -> Texture:
        red, green, blue = self.colour
        return min(red, 1.0), min(green, 1.0), min(blue, 1.0)

    @property
    def emission(self) -> Colour:  # type: ignore[override]
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
    whether backs are seen; the eye looks through backs of others. specular, specular_colour: factors of what plastic
    and panes reflect, the latter at a right angle. coat: share with a clear coat of `coat_roughness`. absorption:
    per unit of length, of light within a closed solid. is_unlit: whether
    colours of vertices multiply emission, too, as of a material that shows its colour without light.
    Light that meets several microfacets is kept, and the base gets what its surface lets through: in a furnace
    everything white keeps 0.98 to 1 of the light, and adds none.
    Source: glTF 2.0, appendix B, and the extensions KHR_materials_emissive_strength, _ior, _transmission, _volume,
    _specular, _clearcoat and _unlit.
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
    specular: float = 1.0
    specular_colour: Colour = (1.0, 1.0, 1.0)
    coat: float = 0.0
    coat_roughness: float = 0.0
    absorption: Colour = (0.0, 0.0, 0.0)
    is_unlit: bool = False

    def __post_init__(self) -> None:
        _check_texture(self)
        check_choice("alpha of MetallicRoughness", self.alpha, ALPHA)
        check_fields(self, **_BOUNDS)

    @property
    def clear_share(self) -> float:
        bends = self.is_thin or self.ior - 1.0 >= LEAST_BEND
        if bends and self.roughness**2 >= SMOOTH:
            return 0.0
        return self.transmission * (1.0 - self.metallic) * (1.0 - ((self.ior - 1.0) / (self.ior + 1.0)) ** 2)


_SHARES = ("opacity", "cutoff", "metallic", "roughness", "transmission", "specular", "coat", "coat_roughness")
_BOUNDS: dict[str, Any] = {
    **dict.fromkeys(_SHARES, (0.0, 1.0)), **dict.fromkeys(("emission", "specular_colour", "absorption"), 1e12),
    "normal_scale": (-1e3, 1e3), "ior": (1.0, 1e3),
}  # fmt: skip
"""Bounds of the fields of `MetallicRoughness`, as for `check_fields`."""


def _check_texture(material: Any) -> None:
    if not isinstance(material.colour, Checker | Image):
        check_fields(material, colour=1.0)


def plain_of(material: Material) -> Lambertian | MetallicRoughness:
    """The diffuse material that stands for another in layers of pictures: its plain colour, and its holes."""
    if not isinstance(material, MetallicRoughness):
        return Lambertian(material.plain)
    return MetallicRoughness(
        material.plain, material.opacity, material.alpha, material.cutoff, is_double=material.is_double
    )


def shown_of(material: Material) -> Material:
    """`plain_of` with what it emits, for hybrid pictures; clear glass is a pane that lets most light straight on."""
    if isinstance(material, Emissive):
        return MetallicRoughness((0.0, 0.0, 0.0), emission=material.emission, is_double=True)
    plain = _as_pane(plain_of(material), material.clear_share)
    if not isinstance(material, MetallicRoughness) or not isinstance(plain, MetallicRoughness):
        return plain
    return replace(plain, emission=material.emission, emission_image=material.emission_image)


def _as_pane(plain: Material, clear: float) -> Material:
    """A plain material that also lets a share of light straight on. A mask stays as it is."""
    if not clear or (isinstance(plain, MetallicRoughness) and plain.alpha == "mask"):
        return plain
    if isinstance(plain, MetallicRoughness) and plain.alpha == "blend":
        return replace(plain, opacity=(1.0 - clear) * plain.opacity)
    colour = plain.plain
    if isinstance(colour, Image):  # whose opacity counts for nothing so far
        colour = replace(colour, texels=colour.texels[..., :3], factor=(*colour.factor[:3], 1.0))
    is_double = getattr(plain, "is_double", True)
    return MetallicRoughness(colour, 1.0 - clear, "blend", is_double=is_double)


def without_images(
    material: MetallicRoughness, lost: Sequence[bool] = (True,) * len(IMAGE_FIELDS)
) -> MetallicRoughness:
    """A material without some of its `images`, its factors kept."""
    colour = material.colour
    plain = {"colour": colour.factor[:3] if isinstance(colour, Image) else colour}
    fields: Any = {name: plain.get(name) for name, is_lost in zip(IMAGE_FIELDS, lost, strict=True) if is_lost}
    return replace(material, **fields)
