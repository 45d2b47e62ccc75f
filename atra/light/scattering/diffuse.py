"""The diffuse material that stands for another: its plain colour, holes and emission; clear glass as a pane."""

from __future__ import annotations

from dataclasses import replace

from atra.light.materials import Emissive, Lambertian, Material, MetallicRoughness
from atra.light.textures import Image


def plain_of(material: Material) -> Lambertian | MetallicRoughness:
    """What is shown of a material: its plain colour, and its holes."""
    if not isinstance(material, MetallicRoughness):
        return Lambertian(material.plain)
    return MetallicRoughness(
        material.plain, material.opacity, material.alpha, material.cutoff, is_double=material.is_double
    )


def shown_of(material: Material) -> Material:
    """`plain_of` with what it emits; clear glass is a surface that lets most light straight on."""
    if isinstance(material, Emissive):
        return MetallicRoughness((0.0, 0.0, 0.0), emission=material.emission, is_double=True)
    plain = as_pane(plain_of(material), material.clear_share)
    if not isinstance(material, MetallicRoughness) or not isinstance(plain, MetallicRoughness):
        return plain
    return replace(plain, emission=material.emission, emission_image=material.emission_image)


def as_pane(plain: Material, clear: float) -> Material:
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
