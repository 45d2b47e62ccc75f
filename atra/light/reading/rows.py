"""What readers of scenes do where a file leaves out normals, or texture coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light.materials import IMAGE_FIELDS, MetallicRoughness
from atra.light.textures import Image


def sound_normals(
    normals: NDArray[np.float64] | None, vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """(V, 3) without zeros and NaN: a mean of the triangles around where there is none."""
    known = np.zeros((len(vertices), 3)) if normals is None else normals
    missing = ~(np.linalg.norm(known, axis=1) > 1e-3)
    if not missing.any():
        return known
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    of_faces = np.cross(b - a, c - a)
    around = np.zeros_like(known)
    for corner in range(3):
        np.add.at(around, faces[:, corner], of_faces)
    length = np.linalg.norm(around, axis=1, keepdims=True)
    around = np.where(length > 0.0, around / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    return np.where(missing[:, None], around, known)


def without_images(
    material: MetallicRoughness, lost: Sequence[bool] = (True,) * len(IMAGE_FIELDS)
) -> MetallicRoughness:
    """A material without some of its `images`, its factors kept."""
    colour = material.colour
    plain = {"colour": colour.factor[:3] if isinstance(colour, Image) else colour}
    fields: Any = {name: plain.get(name) for name, is_lost in zip(IMAGE_FIELDS, lost, strict=True) if is_lost}
    return replace(material, **fields)
