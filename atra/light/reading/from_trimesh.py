"""Triangles, uv and base colours of what trimesh has read."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.light.materials import Lambertian
from atra.light.textures import Image


def fields_of(loaded: Any) -> dict[str, Any]:
    """Fields of `atra.light.Scene`, as its `from_trimesh` says."""
    parts = loaded.dump() if hasattr(loaded, "dump") else [loaded]
    parts = [part for part in parts if len(getattr(part, "faces", ()))]
    if not parts:
        raise InputError(f"loaded is {loaded!r:.100}, expected a trimesh.Trimesh or trimesh.Scene with triangles")
    firsts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = np.concatenate([part.faces + first for part, first in zip(parts, firsts, strict=False)])
    numbers = np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.faces) for part in parts])
    known = [_uv_of(part) for part in parts]
    uv = [np.zeros((len(part.vertices), 2)) if one is None else one for part, one in zip(parts, known, strict=True)]
    materials = [
        _base_colour(getattr(part.visual, "material", None), one is not None)
        for part, one in zip(parts, known, strict=True)
    ]
    return {
        "mesh": Mesh(np.concatenate([part.vertices for part in parts]), faces),
        "materials": materials,
        "face_materials": numbers,
        "uv": np.concatenate(uv),
    }


def _uv_of(part: Any) -> NDArray[np.float64] | None:
    """(V, 2) of a `trimesh.Trimesh`, or None."""
    uv = getattr(part.visual, "uv", None)
    return None if uv is None or len(uv) != len(part.vertices) else np.asarray(uv)[:, :2]


def _base_colour(material: Any, has_uv: bool) -> Lambertian:
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
    return Lambertian(Image(np.asarray(texture.convert("RGB")), True, (red, green, blue, 1.0)))
