"""Scenes from glTF and GLB."""

from __future__ import annotations

from math import degrees, pi
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.model import Gltf
from atra.files.gltf.nodes import Node
from atra.files.gltf.packed import DRACO, MESHOPT
from atra.files.gltf.poses import Pose, moved
from atra.files.gltf.primitives import read_primitive
from atra.files.gltf.tree import entry
from atra.files.meshes.parts import joined, placed_part
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import as_vector
from atra.geometry.view import View
from atra.light.lights import Light, PointLight, SpotLight, Sun
from atra.light.materials import Material
from atra.light.reading.gltf_materials import EXTENSIONS, Materials
from atra.light.scene import ScenePart
from atra.light.tables import sound_normals

_KNOWN = EXTENSIONS | {
    DRACO, *MESHOPT, "KHR_lights_punctual", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
    "KHR_materials_variants", "KHR_materials_sheen", "KHR_materials_iridescence", "KHR_materials_anisotropy",
    "KHR_materials_dispersion",
}  # fmt: skip
"""Extensions without which a file can be shown, though those of materials may be left out."""

_BYTES_PER_ROW, _BYTES_PER_PART = 200, 2_000
"""Peak memory for a face or vertex, as a node places it, and for the placed primitive itself."""

_HEIGHT = 720
"""Rows of a camera's image; files do not tell."""

_DEFAULTS = {"uv": 0.0, "second_uv": 0.0, "colours": 1.0}
"""Rows of vertices that a primitive may lack, and the number that then stands for them."""


class Primitive(NamedTuple):
    """Rows of vertices, and faces, in the space of their mesh. rows: (V, size) float64, by their names in `Scene`."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64]
    rows: dict[str, NDArray[np.float64]]
    material: Material


def read_gltf(path: Path, memory_per_byte: float | None) -> dict[str, Any]:
    """Fields of `atra.light.Scene`, but for the sky. Raises InputError, and other errors for damage."""
    model = Gltf(path, memory_per_byte, _KNOWN.__contains__, _BYTES_PER_ROW, _BYTES_PER_PART, ("buffers", "images"))
    tree, left_out = model.tree, model.left_out
    materials = Materials(tree, model.numbers, model.folder, left_out)
    cameras, lights = {}, []
    for node in model.nodes:
        left_out |= dict.fromkeys(str(name) for name in node.given.get("extensions", {}) if name not in _KNOWN)
        found = _camera_of(tree, node, left_out)
        if found is not None:
            cameras[found[0]] = found[1]
        light = _light_of(tree, node, left_out)
        if light is not None:
            lights.append(light)
    every = model.primitives(lambda given, pose: _primitive(given, pose, model, materials))
    placed = [(source, made) for source, made in every if len(made.faces)]
    if not placed:
        raise InputError("its scene has no triangles")
    vertices, faces = joined([placed_part(made.vertices, made.faces, source.place) for source, made in placed])
    counts = np.array([(len(made.faces), len(made.vertices)) for _, made in placed])
    used = {id(made.material): made.material for _, made in placed}
    number = {key: k for k, key in enumerate(used)}
    return {
        "mesh": Mesh(vertices, faces),
        "materials": tuple(used.values()),
        "face_materials": np.repeat([number[id(made.material)] for _, made in placed], counts[:, 0]),
        "normals": np.concatenate([_turned(made.normals, source.place) for source, made in placed]),
        "parts": tuple(
            ScenePart(name, source.node.number, source.mesh, source.primitive, face, count[0], vertex, count[1])
            for (source, _), count, (face, vertex) in zip(
                placed, counts.tolist(), (np.cumsum(counts, axis=0) - counts).tolist(), strict=True
            )
            for name in [str(source.node.given.get("name", f"node {source.node.number}"))]
        ),
        "cameras": cameras,
        "lights": lights,
        "left_out": tuple(left_out),
        **_joined_rows([made for _, made in placed]),
    }


def _primitive(given: Any, pose: Pose, model: Gltf, materials: Materials) -> Primitive:
    """A primitive's triangles in a pose."""
    numbers, attributes, left_out = model.numbers, given["attributes"], model.left_out
    left_out |= dict.fromkeys(str(name) for name in given.get("extensions", {}) if name not in _KNOWN)
    vertices, faces = read_primitive(given, numbers, pose)
    normals = _rows(model, attributes, "NORMAL", len(vertices))
    rows = {}
    for name, key in (("uv", "TEXCOORD_0"), ("second_uv", "TEXCOORD_1"), ("colours", "COLOR_0")):
        found = _rows(model, attributes, key, len(vertices))
        if found is None:
            continue
        if name == "colours":
            found = np.clip(np.pad(found, ((0, 0), (0, 4 - found.shape[1])), constant_values=1.0), 0.0, 1.0)
        else:
            found = np.column_stack([found[:, 0], 1.0 - found[:, 1]])
        rows[name] = found
    if normals is None:  # flat, as the specification asks for: corners of their own
        order = faces.ravel()
        vertices, faces = vertices[order], np.arange(len(order)).reshape(-1, 3)
        rows = {name: found[order] for name, found in rows.items()}
    else:
        normals = moved(normals, "NORMAL", given, numbers, pose)
    material = materials.get(given.get("material"), "uv" in rows, "second_uv" in rows)
    return Primitive(vertices, faces, sound_normals(normals, vertices, faces), rows, material)


def _rows(model: Gltf, attributes: Any, name: str, count: int) -> NDArray[np.float64] | None:
    """An attribute of all vertices; what is not finite becomes 0, and is named."""
    if name not in attributes:
        return None
    sizes = {"NORMAL": 3, "COLOR_0": model.numbers.shape(attributes[name])[1]}
    rows = model.numbers.floats(attributes[name], sizes.get(name, 2))
    if len(rows) != count:
        raise InputError(f"{name} has {len(rows)} rows, but there are {count} vertices")
    good = np.abs(rows) <= 1e6
    if not good.all():
        model.left_out[f"{name} that is not finite"] = None
        rows = np.where(good, rows, 0.0)
    return rows


def _turned(normals: NDArray[np.float64], place: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3) normals of unit length in the world."""
    turn = place[:3, :3]
    cofactors = np.column_stack([np.cross(turn[:, (k + 1) % 3], turn[:, (k + 2) % 3]) for k in range(3)])
    normals = normals @ cofactors.T * np.sign(np.linalg.det(turn) or 1.0)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))


def _joined_rows(primitives: list[Primitive]) -> dict[str, NDArray[np.float64]]:
    """Rows that any primitive has, of the vertices of all."""
    names = {name: made.rows[name].shape[1] for made in primitives for name in made.rows}
    return {
        name: np.concatenate(
            [made.rows.get(name, np.full((len(made.vertices), size), _DEFAULTS[name])) for made in primitives]
        )
        for name, size in names.items()
    }


def _camera_of(tree: Any, node: Node, left_out: dict[str, None]) -> tuple[str, View] | None:
    """The name and camera of a node, None if it has none that is read."""
    if "camera" not in node.given:
        return None
    given = entry(tree, "cameras", node.given["camera"])
    perspective = given.get("perspective")
    if given.get("type") != "perspective" or perspective is None:
        left_out["orthographic cameras"] = None
        return None
    name = str(node.given.get("name") or given.get("name") or f"camera {node.number}")
    eye, ahead, up = node.to_world[:3, 3], -node.to_world[:3, 2], node.to_world[:3, 1]
    width = max(1, min(1 << 14, round(_HEIGHT * float(perspective.get("aspectRatio", 16 / 9)))))
    target = eye + ahead / (np.linalg.norm(ahead) or 1.0)
    fov = degrees(float(perspective["yfov"]))
    return name, Camera(as_vector(eye), as_vector(target), as_vector(up), fov, width, _HEIGHT)


def _light_of(tree: Any, node: Node, left_out: dict[str, None]) -> Light | None:
    """The light of a node by KHR_lights_punctual, None if it has none, or one that does not shine."""
    number = node.given.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
    if number is None:
        return None
    given = entry(tree.get("extensions", {}).get("KHR_lights_punctual", {}), "lights", number)
    colour = np.nan_to_num(np.asarray(given.get("color", (1, 1, 1)), np.float64).reshape(3)).clip(0.0, 1e6)
    power = float(given.get("intensity", 1.0)) / pi  # the file's candela and lux are of light before reflection
    if not 0.0 < power < 1e12 or not colour.any():
        left_out["lights whose intensity is not above 0"] = None
        return None
    if "range" in given:
        left_out["range of lights"] = None
    position, direction = as_vector(node.to_world[:3, 3]), as_vector(-node.to_world[:3, 2])
    tint = as_vector(colour)
    match given.get("type"):
        case "directional":
            return Sun(direction, 0.0, tint, power)
        case "point":
            return PointLight(position, tint, power)
        case "spot":
            cone = given.get("spot", {})
            outer = min(90.0, max(1e-3, degrees(float(cone.get("outerConeAngle", pi / 4)))))
            inner = min(outer, max(0.0, degrees(float(cone.get("innerConeAngle", 0.0)))))
            return SpotLight(position, direction, inner, outer, tint, power)
    left_out[f"lights of type {given.get('type')!r:.40}"] = None
    return None
