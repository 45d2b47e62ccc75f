"""What varies within the triangles of a bake, as tables for kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.hits import read_only
from atra.light.lightmaps.paint_kernels import COLOUR, EMISSION, LARGEST_ALBEDO, OPACITY, Paint, take_means
from atra.light.materials import Emissive, Material, MetallicRoughness, images_of
from atra.light.scene import Scene
from atra.light.sky import constant_sky
from atra.light.tables import surfaces_of
from atra.light.textures import Checker, Image
from atra.views.sampling import sub_pixel_offsets

_LOOKUPS, _FEWEST, _MOST = 1 << 18, 16, 1024
"""Places that are looked up for the means of all triangles; least and most of them for a triangle."""


def by_place(scene: Scene) -> NDArray[np.uint8]:
    """(F,) uint8, bits COLOUR, OPACITY and EMISSION: what varies within each triangle."""
    bits = [_bits(one, scene.colours is not None) for one in scene.materials]
    return np.array(bits, np.uint8)[np.asarray(scene.face_materials)]


def plain_opacity(material: Material) -> float:
    """The share of light that a material stops, textures and colours of vertices left out; what shines is opaque."""
    if not isinstance(material, MetallicRoughness) or material.alpha == "opaque" or any(material.emission):
        return 1.0
    image = images_of(material)[0]
    opacity = min(1.0, material.opacity * (1.0 if image is None else max(0.0, image.factor[3])))
    return opacity if material.alpha == "blend" else float(opacity >= material.cutoff)


def paint_of(scene: Scene, mesh: Mesh) -> Paint:
    """The tables of a scene's materials on a mesh of the same faces, around its origin. Raises InputError for other
    numbers of vertices or faces."""
    dark = replace(scene, mesh=mesh.local, lights=(), sky=constant_sky(0.0), normals=None)
    return Paint(surfaces_of(dark, 0.0, None), read_only(by_place(scene)))


def means_of(
    scene: Scene, albedo: NDArray[np.float32], emission: NDArray[np.float32], opacity: NDArray[np.float32]
) -> None:
    """Put means over triangles into the rows, (F, 3), (F, 3) and (F,), of those within which these vary."""
    paint = paint_of(scene, scene.mesh)
    count = int(np.clip(_LOOKUPS // max(int(np.count_nonzero(paint.by_place)), 1), _FEWEST, _MOST))
    places = np.asarray(sub_pixel_offsets(count), np.float64)
    weights = np.where(places.sum(axis=1, keepdims=True) <= 1.0, places, 1.0 - places)
    corners = scene.mesh.local_vertices[scene.mesh.faces].astype(np.float64)
    take_means(paint, corners, weights, albedo, emission, opacity)
    np.minimum(albedo, np.float32(LARGEST_ALBEDO), out=albedo)  # sums of rounded parts may be larger


def _bits(material: Material, has_colours: bool) -> int:
    if isinstance(material, Emissive):
        return 0
    physical = material if isinstance(material, MetallicRoughness) else None
    has_colours = has_colours and physical is not None
    bits = COLOUR if has_colours or isinstance(material.plain, Checker | Image) else 0
    if any(material.emission):
        return bits | (EMISSION if images_of(material)[3] is not None else 0)
    if physical is not None and physical.alpha != "opaque" and (has_colours or _has_holes(images_of(material)[0])):
        bits |= OPACITY
    return bits


def _has_holes(image: Image | None) -> bool:
    """Whether an image's opacity varies."""
    if image is None or image.texels.shape[2] < 4:
        return False
    opacity = image.texels[..., 3]
    return bool((opacity != (255 if opacity.dtype == np.uint8 else 1)).any())
