"""Materials and images of a glTF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import cos, log, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder, OutsideError
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.packed import BASIS
from atra.files.gltf.tree import entry
from atra.files.saving import check_package
from atra.light.materials import MetallicRoughness, without_images
from atra.light.reading.images import read_image
from atra.light.textures import Image

EXTENSIONS = {
    "KHR_materials_emissive_strength", "KHR_materials_ior", "KHR_materials_transmission", "KHR_texture_transform",
    "EXT_texture_webp", BASIS, "KHR_materials_unlit", "KHR_materials_volume", "KHR_materials_specular",
    "KHR_materials_clearcoat",
}  # fmt: skip
"""Those of materials that are used, but for textures that are named."""

_WRAPS = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_NEAREST = 9728
_LEAST_COLOUR = 1e-6
"""Least share of light that is left after the attenuation distance, which may be stated as 0."""


class Materials:
    """The materials of a glTF, each made once. left_out: what they have beyond `MetallicRoughness`, by name."""

    def __init__(self, tree: Any, numbers: Numbers, folder: Folder, left_out: dict[str, None]) -> None:
        self._tree, self._numbers, self._folder, self._left_out = tree, numbers, folder, left_out
        if tree.get("images"):
            check_package(".png")
        self.texels = cache(self._read)
        self.get = cache(self._get)

    def _get(self, number: int | None, has_uv: bool, has_second: bool) -> MetallicRoughness:
        """A material, None: the default one, of a primitive with such texture coordinates."""
        if number is None:
            return MetallicRoughness(metallic=1.0, is_double=False)
        made = self._whole(number)
        images = made.images
        lost = [one is not None and not (has_second if one.second_uv else has_uv) for one in images]
        if any(lost):
            self._left_out["textures without texture coordinates"] = None
            made = without_images(made, lost)
        return made

    def _whole(self, number: int) -> MetallicRoughness:
        given = entry(self._tree, "materials", number)
        more = given.get("extensions", {})
        self._left_out |= dict.fromkeys(name for name in more if name not in EXTENSIONS)
        for name in ("KHR_materials_specular", "KHR_materials_clearcoat"):
            if any(key.endswith("Texture") for key in more.get(name, {})):
                self._left_out[f"textures of {name}"] = None
        pbr = given.get("pbrMetallicRoughness", {})
        red, green, blue, opacity = _clipped(pbr.get("baseColorFactor", (1, 1, 1, 1)), 4)
        colour = self._image(pbr.get("baseColorTexture"), True)
        if colour is not None:
            colour = replace(colour, factor=(red, green, blue, 1.0))
        common: dict[str, Any] = {
            "opacity": opacity,
            "alpha": {"MASK": "mask", "BLEND": "blend"}.get(given.get("alphaMode", "OPAQUE"), "opaque"),
            "cutoff": _clipped([given.get("alphaCutoff", 0.5)], 1)[0],
            "is_double": bool(given.get("doubleSided", False)),
            "name": str(given.get("name", "")),
        }
        if "KHR_materials_unlit" in more:
            return MetallicRoughness(
                (0.0, 0.0, 0.0) if colour is None else replace(colour, factor=(0.0, 0.0, 0.0, 1.0)),
                emission=(red, green, blue),
                emission_image=None if colour is None else replace(colour, factor=(1.0, 1.0, 1.0, 1.0)),
                specular=0.0,
                is_unlit=True,
                **common,
            )
        strength = more.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
        strength = float(np.clip(np.nan_to_num(strength), 0.0, 1e12))
        emission = tuple(strength * one for one in _clipped(given.get("emissiveFactor", (0, 0, 0)), 3))
        bumps = given.get("normalTexture")
        transmission = more.get("KHR_materials_transmission", {})
        volume = more.get("KHR_materials_volume", {})
        specular, coat = more.get("KHR_materials_specular", {}), more.get("KHR_materials_clearcoat", {})
        tint = np.nan_to_num(np.asarray(specular.get("specularColorFactor", (1, 1, 1)), np.float64).reshape(3))
        return MetallicRoughness(
            colour=(red, green, blue) if colour is None else colour,
            metallic=_clipped([pbr.get("metallicFactor", 1.0)], 1)[0],
            roughness=_clipped([pbr.get("roughnessFactor", 1.0)], 1)[0],
            metallic_roughness=self._image(pbr.get("metallicRoughnessTexture"), False),
            emission=emission,  # type: ignore[arg-type]
            emission_image=self._image(given.get("emissiveTexture"), True),
            normals=self._image(bumps, False),
            normal_scale=float(np.clip(np.nan_to_num((bumps or {}).get("scale", 1.0)), -1e3, 1e3)),
            transmission=_clipped([transmission.get("transmissionFactor", 0.0)], 1)[0],
            transmission_image=self._image(transmission.get("transmissionTexture"), False),
            ior=max(1.0, min(1e3, float(more.get("KHR_materials_ior", {}).get("ior", 1.5)))),
            is_thin=not volume.get("thicknessFactor", 0.0) > 0.0,
            specular=_clipped([specular.get("specularFactor", 1.0)], 1)[0],
            specular_colour=tuple(np.clip(tint, 0.0, 1e6).tolist()),  # type: ignore[arg-type]
            coat=_clipped([coat.get("clearcoatFactor", 0.0)], 1)[0],
            coat_roughness=_clipped([coat.get("clearcoatRoughnessFactor", 0.0)], 1)[0],
            absorption=_absorption(volume),
            **common,
        )

    def _image(self, info: Mapping[str, Any] | None, is_coded: bool) -> Image | None:
        if info is None:
            return None
        texture = entry(self._tree, "textures", info["index"])
        more = texture.get("extensions", {})
        sources = [more[name].get("source") for name in ("EXT_texture_webp", BASIS) if name in more]
        source = next((one for one in sources if one is not None), texture.get("source"))
        moved = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv = moved.get("texCoord", info.get("texCoord", 0))
        if source is None or uv not in (0, 1):
            self._left_out["textures of formats or coordinates that are not read"] = None
            return None
        try:
            texels = self.texels(source, is_coded)
        except OutsideError:
            raise
        except InputError as error:
            self._left_out[f"image {source}, because {error}"] = None
            return None
        sampler = entry(self._tree, "samplers", texture["sampler"]) if "sampler" in texture else {}
        return Image(
            texels,
            is_coded,
            second_uv=uv == 1,
            placement=placement_of(moved),
            wrap=(_WRAPS.get(sampler.get("wrapS", 0), "repeat"), _WRAPS.get(sampler.get("wrapT", 0), "repeat")),
            is_nearest=sampler.get("magFilter") == _NEAREST,
        )

    def _read(self, number: Any, is_coded: bool) -> NDArray[np.uint8]:
        image = entry(self._tree, "images", number)
        content = self._numbers.view(image["bufferView"]) if "bufferView" in image else self._folder.read(image["uri"])
        return read_image(content, is_coded)


def placement_of(moved: Mapping[str, Any]) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """`placement` of `Image` by a KHR_texture_transform, whose v grows downwards."""
    (x, y), (across, down) = moved.get("offset", (0.0, 0.0)), moved.get("scale", (1.0, 1.0))
    turn = moved.get("rotation", 0.0)
    a, b, d, e = cos(turn) * across, sin(turn) * down, -sin(turn) * across, cos(turn) * down
    return (a, -b, b + x), (-d, e, 1.0 - e - y)


def _absorption(volume: Mapping[str, Any]) -> tuple[float, float, float]:
    """Absorption per unit of length, from the colour that white light has after a distance."""
    distance = float(volume.get("attenuationDistance", 0.0))
    if not 0.0 < distance < np.inf:
        return 0.0, 0.0, 0.0
    red, green, blue = _clipped(volume.get("attenuationColor", (1, 1, 1)), 3)
    return tuple(min(1e12, -log(max(one, _LEAST_COLOUR)) / distance) for one in (red, green, blue))  # type: ignore


def _clipped(given: Any, size: int) -> tuple[float, ...]:
    """Factors that the specification keeps within [0, 1]."""
    numbers = np.nan_to_num(np.asarray(given, np.float64).reshape(size))
    return tuple(np.clip(numbers, 0.0, 1.0).tolist())
