"""Scenes from OBJ with MTL: trimesh reads the triangles, the materials are read here."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder, OutsideError
from atra.files.reading import Allowance, read_regular_file
from atra.geometry.mesh import Mesh
from atra.light.materials import MetallicRoughness
from atra.light.reading.images import read_image
from atra.light.scene import ScenePart
from atra.light.textures import Image

_BYTES_PER_LINE = 1000
"""Peak memory for a line, as trimesh reads it."""

_USED = {"kd", "ke", "ns", "ni", "d", "tr", "pr", "pm", "tf", "illum", "map_kd", "map_ke", "map_d", "norm", "newmtl"}
_MOST_MATERIALS = 100_000


def read_obj(path: Path, memory_per_byte: float | None) -> dict[str, Any]:
    """Fields of `atra.light.Scene`. Raises InputError, and other errors for damage."""
    from trimesh.exchange.obj import load_obj

    content, folder = read_regular_file(path), Folder(path)
    left_out: dict[str, None] = {}
    lines = content.count(b"\n") + content.count(b"\r")
    Allowance(len(content), memory_per_byte).check(f"{lines:,} lines", lines * _BYTES_PER_LINE)
    texts = {}
    for line in content.splitlines():
        if line.startswith(b"mtllib"):
            name = line[6:].strip().decode(errors="replace")
            try:
                texts[name] = folder.read(name).decode(errors="replace")
            except OutsideError:
                raise
            except InputError as error:
                left_out[f"material file {name!r:.60}, because {error}"] = None
    known = materials_of("\n".join(texts.values()), folder, left_out)
    loaded = load_obj(io.BytesIO(content), resolver=_Texts(texts), maintain_order=True)["geometry"]
    parts = [part for part in loaded.values() if len(part.get("faces", ()))]
    if not parts:
        raise InputError("it has no triangles")
    return _joined(parts, known) | {"left_out": tuple(left_out)}


class _Texts:
    """The MTL files alone, as trimesh asks for what an OBJ names: it reads no image."""

    def __init__(self, texts: dict[str, str]) -> None:
        # Only names matter, which tell its parts apart.
        self._texts = {
            name: "\n".join(line for line in text.splitlines() if line.strip().lower().startswith("newmtl"))
            for name, text in texts.items()
        }

    def get(self, name: str) -> bytes:
        return self._texts.get(name.strip(), "").encode()

    def __getitem__(self, name: str) -> bytes:
        return self.get(name)


def _joined(parts: list[dict[str, Any]], known: dict[str, MetallicRoughness]) -> dict[str, Any]:
    vertices, faces, uv, normals, numbers, named = [], [], [], [], [], []
    materials: dict[str, MetallicRoughness] = {}
    first = at = 0
    for part in parts:
        visual, corners, triangles = part.get("visual"), np.asarray(part["vertices"]), np.asarray(part["faces"])
        name = str(getattr(getattr(visual, "material", None), "name", ""))
        found = getattr(visual, "uv", None)
        has_uv = found is not None and len(found) == len(corners)
        made = known.get(name, MetallicRoughness((0.7, 0.7, 0.7)))
        materials.setdefault(f"{name}{has_uv}", made if has_uv else _without_images(made))
        numbers.append(np.full(len(triangles), list(materials).index(f"{name}{has_uv}")))
        vertices.append(corners)
        faces.append(triangles + first)
        rows = np.asarray(found)[:, :2] if has_uv else np.zeros((len(corners), 2))
        uv.append(np.where(np.abs(rows) <= 1e6, rows, 0.0))
        normals.append(_normals(part))
        named.append(ScenePart(name, -1, -1, -1, at, len(triangles), first, len(corners)))
        first, at = first + len(corners), at + len(triangles)
    smooth = [one for one in normals if one is not None]
    return {
        "mesh": Mesh(np.concatenate(vertices), np.concatenate(faces)),
        "materials": tuple(materials.values()),
        "face_materials": np.concatenate(numbers),
        "uv": np.concatenate(uv),
        "normals": np.concatenate(smooth) if len(smooth) == len(parts) else None,
        "parts": tuple(named),
    }


def _normals(part: dict[str, Any]) -> NDArray[np.float64] | None:
    """(V, 3) that the file states, None where it does not."""
    if "vertex_normals" not in part:
        return None
    normals = np.asarray(part["vertex_normals"], np.float64)
    return normals if (np.linalg.norm(normals, axis=1) > 1e-3).all() else None


def _without_images(material: MetallicRoughness) -> MetallicRoughness:
    colour = material.colour
    return MetallicRoughness(
        colour.factor[:3] if isinstance(colour, Image) else colour, material.opacity, material.alpha, material.cutoff,
        material.metallic, material.roughness, emission=material.emission, transmission=material.transmission,
        ior=material.ior, is_thin=material.is_thin, name=material.name,
    )  # fmt: skip


def materials_of(text: str, folder: Folder, left_out: dict[str, None]) -> dict[str, MetallicRoughness]:
    """The materials of an MTL by name. left_out: gets the names of statements that are not used."""
    found: dict[str, dict[str, list[str]]] = {}
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        key = words[0].lower()
        if key == "newmtl":
            found[" ".join(words[1:])] = {}
        elif found:
            found[next(reversed(found))][key] = words[1:]
        if key not in _USED and key not in ("ka", "ks", "map_ka", "map_ks"):
            left_out[f"{words[0]:.40} of MTL"] = None
        if len(found) > _MOST_MATERIALS:
            raise InputError(f"it has more than {_MOST_MATERIALS:,} materials")
    return {name: _material(name, given, folder, left_out) for name, given in found.items()}


def _material(name: str, given: dict[str, list[str]], folder: Folder, left_out: dict[str, None]) -> MetallicRoughness:
    colour = tuple(np.clip(_numbers(given, "kd", 3, 0.7), 0.0, 1.0).tolist())
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
    illum = int(_numbers(given, "illum", 1, 2.0)[0])
    is_glass = illum in (4, 6, 7, 9)
    if image is not None:
        image = Image(image.texels, True, (*colour, 1.0))
    return MetallicRoughness(
        colour if image is None else image,  # type: ignore[arg-type]
        1.0 if is_glass else opacity,
        "mask" if has_holes and opacity == 1.0 else "blend" if opacity < 1.0 and not is_glass else "opaque",
        metallic=float(np.clip(_numbers(given, "pm", 1, 0.0)[0], 0.0, 1.0)),
        roughness=0.0 if is_glass else min(1.0, max(0.0, roughness)),
        emission=tuple((emission if glow is None or emission.any() else np.ones(3)).tolist()),  # type: ignore[arg-type]
        emission_image=glow,
        normals=_image(given.get("norm"), False, folder, left_out),
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
        return Image(read_image(folder.read(name), is_coded), is_coded)
    except OutsideError:
        raise
    except InputError as error:
        left_out[f"image {name!r:.60}, because {error}"] = None
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
