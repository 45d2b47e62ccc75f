"""Scenes from OBJ with MTL."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.folder import Folder, OutsideError
from atra.files.formats.obj import read_obj_surface
from atra.files.reading import Allowance, read_regular_file
from atra.geometry.mesh import Mesh
from atra.light.materials import MetallicRoughness, without_images
from atra.light.reading.images import read_image
from atra.light.tables import sound_normals
from atra.light.textures import Image, linear_of_srgb

_NORMALS = ("norm", "map_bump", "bump")
"""Statements that name an image of normals; exporters write it as one of bumps, too."""

_USED = {
    "kd", "ke", "ns", "ni", "d", "tr", "pr", "pm", "illum", "map_kd", "map_ke", "map_d", *_NORMALS, "newmtl",
}  # fmt: skip
_UNUSED = {"Ka": 0.0, "Ks": 0.0, "Tf": 1.0}
"""Statements that are left out, unless they name these numbers, which change nothing. Tf is the colour of glass."""

_MOST_MATERIALS = 100_000


def read_obj(path: Path, memory_per_byte: float | None) -> dict[str, Any]:
    """Fields of `atra.light.Scene`. Raises InputError, and other errors for damage."""
    content, folder = read_regular_file(path), Folder(path)
    found = read_obj_surface(content, Allowance(len(content), memory_per_byte))
    part, left_out = found.part, dict[str, None]()
    if not len(part.faces):
        raise InputError("it has no triangles")
    names = [" ".join(name.split()) for name in found.materials]
    known = materials_of("\n".join(_libraries(found.libraries, folder, left_out)), set(names), folder, left_out)
    uv = found.uv
    is_mapped = np.zeros(len(part.faces), np.bool_)
    if uv is not None:
        is_known: NDArray[np.bool_] = np.all(np.abs(uv) <= 1e6, axis=1)
        uv, is_mapped = np.where(is_known[:, None], uv, 0.0), is_known[part.faces].all(axis=1)
    kinds, numbers = np.unique(2 * np.asarray(part.material) + is_mapped, return_inverse=True)
    colours = None if found.colours is None else _linear_colours(found.colours)
    grey = (0.7, 0.7, 0.7) if colours is None else (1.0, 1.0, 1.0)  # of what no MTL describes
    materials = []
    for kind in kinds.tolist():
        name = names[kind // 2] if kind >= 0 else ""
        made = known.get(name, MetallicRoughness(grey, name=name))
        if name not in known and name:
            left_out[f"material {name!r:.60}, which no MTL describes"] = None
        if kind % 2 == 0 and any(made.images):
            left_out["textures without texture coordinates"] = None
        materials.append(made if kind % 2 else without_images(made))
    return {
        "mesh": Mesh(part.vertices, part.faces, notes=found.notes),
        "materials": tuple(materials),
        "face_materials": np.broadcast_to(numbers, len(part.faces)),
        "uv": uv,
        "normals": None if found.normals is None else sound_normals(found.normals, part.vertices, part.faces),
        "colours": colours,
        "left_out": tuple(left_out),
    }


def _linear_colours(codes: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 4), linear RGB and opacity, of sRGB numbers from 0 to 1 or, where one is above 1, to 255."""
    codes = np.nan_to_num(codes)
    shares = np.clip(codes / (255.0 if codes.max() > 1.0 else 1.0), 0.0, 1.0)
    return np.pad(linear_of_srgb(shares), ((0, 0), (0, 1)), constant_values=1.0)


def _libraries(names: tuple[str, ...], folder: Folder, left_out: dict[str, None]) -> list[str]:
    """The texts of MTL files. A line names one, whose name may have blanks, or several."""
    texts = []
    for line in names:
        for name in line.split() if ".mtl " in line.lower() else [line]:
            try:
                texts.append(_content(name, folder).decode(errors="replace"))
            except InputError as error:
                left_out[f"material file {name!r:.60}, because {error}"] = None
    return texts


def _content(name: str, folder: Folder) -> bytes:
    """The bytes of a file that is named; of the one beside the OBJ if the name leads out of its folder, as paths on the
    author's machine do."""
    try:
        return folder.read(name)
    except OutsideError:
        return folder.read(name.replace("\\", "/").rsplit("/", 1)[-1])


def materials_of(text: str, names: set[str], folder: Folder, left_out: dict[str, None]) -> dict[str, MetallicRoughness]:
    """The materials of an MTL that have one of these names. left_out: gets what of them is not used."""
    found: dict[str, dict[str, list[str]]] = {}
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        key = words[0].lower()
        if key == "newmtl":
            found[printable(" ".join(words[1:]))] = {}
        elif found:
            found[next(reversed(found))][key] = words[1:]
        if key not in _USED and key.capitalize() not in _UNUSED:
            left_out[f"{words[0]:.40} of MTL"] = None
        if len(found) > _MOST_MATERIALS:
            raise InputError(f"it has more than {_MOST_MATERIALS:,} materials")
    return {name: _material(name, given, folder, left_out) for name, given in found.items() if name in names}


def _material(name: str, given: dict[str, list[str]], folder: Folder, left_out: dict[str, None]) -> MetallicRoughness:
    illum = int(_numbers(given, "illum", 1, 2.0)[0])
    is_glass = illum in (4, 6, 7, 9)
    colour = np.clip(_numbers(given, "tf" if is_glass and "tf" in given else "kd", 3, 0.7), 0.0, 1.0).tolist()
    for key, plain in _UNUSED.items():
        if (_numbers(given, key.lower(), 3, plain) != plain).any() and not (key == "Tf" and is_glass):
            left_out[f"{key} of MTL"] = None
    opacity = float(np.clip(_numbers(given, "d", 1, 1.0 - _numbers(given, "tr", 1, 0.0)[0])[0], 0.0, 1.0))
    shininess = max(0.0, float(_numbers(given, "ns", 1, 0.0)[0]))
    roughness = float(_numbers(given, "pr", 1, np.sqrt(2.0 / (shininess + 2.0)) ** 0.5)[0])
    image = _image(given.get("map_kd"), True, folder, left_out)
    mask = _image(given.get("map_d"), False, folder, left_out)
    if mask is not None:
        image = _with_opacity(image, mask, left_out)
    emission = np.clip(_numbers(given, "ke", 3, 0.0), 0.0, 1e12)
    glow = _image(given.get("map_ke"), True, folder, left_out)
    has_holes = image is not None and image.texels.shape[2] == 4
    if image is not None:
        image = Image(image.texels, True, (*colour, 1.0))
    return MetallicRoughness(
        tuple(colour) if image is None else image,
        1.0 if is_glass else opacity,
        "mask" if has_holes and opacity == 1.0 else "blend" if opacity < 1.0 and not is_glass else "opaque",
        metallic=float(np.clip(_numbers(given, "pm", 1, 0.0)[0], 0.0, 1.0)),
        roughness=0.0 if is_glass else min(1.0, max(0.0, roughness)),
        emission=tuple((emission if glow is None or emission.any() else np.ones(3)).tolist()),  # type: ignore[arg-type]
        emission_image=glow,
        normals=_normals(given, folder, left_out),
        transmission=1.0 if is_glass else 0.0,
        ior=float(np.clip(_numbers(given, "ni", 1, 1.5)[0], 1.0, 1e3)),
        is_thin=not is_glass,
        name=name,
    )


def _numbers(given: dict[str, list[str]], key: str, count: int, default: float) -> NDArray[np.float64]:
    """(count,) finite numbers of a statement; one number stands for all."""
    try:
        found = np.array([float(word) for word in given[key][:count]])
    except (KeyError, ValueError):
        return np.full(count, default)
    return np.nan_to_num(np.resize(found, count)) if len(found) else np.full(count, default)


def _image(words: list[str] | None, is_coded: bool, folder: Folder, left_out: dict[str, None]) -> Image | None:
    if not words:
        return None
    name = words[-1] if words[0].startswith("-") else " ".join(words)
    if words[0].startswith("-"):
        left_out["options of textures of MTL"] = None
    try:
        return Image(read_image(_content(name, folder), is_coded), is_coded)
    except InputError as error:
        left_out[f"image {name!r:.60}, because {error}"] = None
        return None


def _normals(given: dict[str, list[str]], folder: Folder, left_out: dict[str, None]) -> Image | None:
    """The image of normals: of those of bumps, one that is blue on average, as heights are not."""
    key = next((key for key in _NORMALS if key in given), None)
    image = None if key is None else _image(given[key], False, folder, left_out)
    if image is None or key == "norm":
        return image
    red, green, blue = image.texels[..., :3].reshape(-1, 3).mean(axis=0)
    if blue > 1.2 * max(red, green):
        return image
    left_out["heights of bumps of MTL"] = None
    return None


def _with_opacity(image: Image | None, mask: Image, left_out: dict[str, None]) -> Image | None:
    """The image with the red of `mask`, of the same size, as its opacity."""
    size = mask.texels.shape[:2]
    colours = np.full((*size, 3), 255, np.uint8) if image is None else image.texels[..., :3]
    if colours.shape[:2] != size:
        left_out["map_d whose size is not that of map_Kd"] = None
        return image
    texels = np.concatenate([colours, mask.texels[..., :1]], axis=2)
    texels.setflags(write=False)
    return Image(texels, True)
