"""Scenes from glTF and GLB."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder
from atra.files.gltf.nodes import nodes_of, places_of
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.packed import DRACO, MESHOPT
from atra.files.gltf.poses import Pose, moved, poses_of
from atra.files.gltf.primitives import FAN, STRIP, TRIANGLES, decode_primitive, triangles_of_mode
from atra.files.gltf.tree import entry, gltf_tree, without
from atra.files.reading import Allowance, read_regular_file
from atra.geometry.mesh import Mesh
from atra.light.materials import Material
from atra.light.reading.gltf_materials import EXTENSIONS, Materials
from atra.light.reading.gltf_nodes import camera_of, light_of
from atra.light.reading.rows import sound_normals
from atra.light.scene import ScenePart

_KNOWN = EXTENSIONS | {
    DRACO, *MESHOPT, "KHR_lights_punctual", "KHR_mesh_quantization", "EXT_mesh_gpu_instancing",
    "KHR_materials_variants", "KHR_materials_sheen", "KHR_materials_iridescence", "KHR_materials_anisotropy",
    "KHR_materials_dispersion",
}  # fmt: skip
"""Extensions without which a file can be shown, though those of materials may be left out."""

_BYTES_PER_ROW = 200
"""Peak memory for a face or vertex, as a node places it."""


class Primitive(NamedTuple):
    """Rows of vertices and faces in the space of their mesh. normals: (V, 3), uv, second: (V, 2), colours: (V, 4), each
    float64 or None."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64]
    uv: NDArray[np.float64] | None
    second: NDArray[np.float64] | None
    colours: NDArray[np.float64] | None
    material: Material


def read_gltf(path: Path, memory_per_byte: float | None) -> dict[str, Any]:
    """Fields of `atra.light.Scene`, but for the sky. Raises InputError, and other errors for damage."""
    content, folder = read_regular_file(path), Folder(path)
    suffix = path.suffix.lower().lstrip(".")
    tree = gltf_tree(content, suffix)
    left_out: dict[str, None] = {}
    for name in tree.get("extensionsRequired", []):
        if name not in _KNOWN:
            raise InputError(f"it requires the extension {name!r:.60}, which is not read; {without(name)}")
    if tree.get("animations"):
        left_out["animations"] = None
    beside = sum(folder.size_of(one.get("uri")) for one in tree.get("buffers", []) + tree.get("images", []))
    allowance = Allowance(len(content) + beside, memory_per_byte)
    numbers = Numbers(tree, content, suffix, folder)
    materials = Materials(tree, numbers, folder, left_out)
    made: dict[tuple[int, int, int], Primitive | None] = {}
    poses = poses_of(tree, numbers)
    collected, cameras, lights = _Collected(allowance), {}, []
    for node in nodes_of(tree):
        for name in node.given.get("extensions", {}).keys() - _KNOWN:
            left_out[str(name)] = None
        found = camera_of(tree, node, left_out)
        if found is not None:
            cameras[found[0]] = found[1]
        light = light_of(tree, node, left_out)
        if light is not None:
            lights.append(light)
        if "mesh" not in node.given:
            continue
        mesh = node.given["mesh"]
        pose = poses[node.number]
        own = -1 if pose.is_plain else node.number
        for place in places_of(node, numbers, allowance) if pose.joints is None else [np.eye(4)]:
            for k, given in enumerate(entry(tree, "meshes", mesh)["primitives"]):
                if (mesh, k, own) not in made:
                    made[mesh, k, own] = _primitive(given, numbers, pose, materials, allowance, left_out)
                primitive = made[mesh, k, own]
                if primitive is not None:
                    name = str(node.given.get("name", f"node {node.number}"))
                    collected.add(primitive, place, (name, node.number, mesh, k))
    return collected.fields() | {"cameras": cameras, "lights": lights, "left_out": tuple(left_out)}


def _primitive(
    given: Any,
    numbers: Numbers,
    pose: Pose,
    materials: Materials,
    allowance: Allowance,
    left_out: dict[str, None],
) -> Primitive | None:
    """A primitive's triangles in a pose, None if it has none."""
    mode, attributes = given.get("mode", TRIANGLES), given["attributes"]
    for name in given.get("extensions", {}):
        if name not in _KNOWN:
            left_out[str(name)] = None
    if mode not in (TRIANGLES, STRIP, FAN):
        left_out["points and lines"] = None
        return None
    decode_primitive(given, numbers)
    vertices = numbers.floats(attributes["POSITION"], 3)
    corners = numbers.whole(given["indices"]) if "indices" in given else np.arange(len(vertices))
    allowance.check(f"{len(vertices) + len(corners):,} rows", (len(vertices) + len(corners)) * _BYTES_PER_ROW)
    if len(corners) and corners.max() >= len(vertices):
        raise InputError(f"an index is {corners.max()}, but there are {len(vertices)} vertices")
    faces = triangles_of_mode(mode, corners)
    if not len(faces):
        return None
    rows = {}
    for key, name, size in (("normals", "NORMAL", 3), ("uv", "TEXCOORD_0", 2), ("second", "TEXCOORD_1", 2)):
        rows[key] = _rows(numbers, attributes, name, size, len(vertices), left_out)
    vertices = moved(vertices, "POSITION", given, numbers, pose)
    if rows["normals"] is not None:
        rows["normals"] = moved(rows["normals"], "NORMAL", given, numbers, pose)
    colours = None
    if "COLOR_0" in attributes:
        if materials.is_unlit(given.get("material")):
            left_out["colours of vertices without light"] = None
        size = numbers.shape(attributes["COLOR_0"])[1]
        colours = _rows(numbers, attributes, "COLOR_0", size, len(vertices), left_out)
        if colours is not None:
            opaque = np.ones((len(vertices), 4 - size))
            colours = np.clip(np.concatenate([colours, opaque], axis=1), 0.0, 1.0)
    if rows["normals"] is None:  # flat, as the specification asks for: corners of their own
        order = faces.ravel()
        vertices, faces = vertices[order], np.arange(len(order)).reshape(-1, 3)
        rows = {key: None if one is None else one[order] for key, one in rows.items()}
        colours = None if colours is None else colours[order]
    normals = sound_normals(rows["normals"], vertices, faces)
    uv, second = (
        None if one is None else np.column_stack([one[:, 0], 1.0 - one[:, 1]]) for one in (rows["uv"], rows["second"])
    )
    material = materials.get(given.get("material"), uv is not None, second is not None)
    return Primitive(vertices, faces, normals, uv, second, colours, material)


def triangles_of(given: Any, numbers: Numbers) -> tuple[NDArray[np.int64], bool]:
    """(F, 3) int64, vertices of a primitive's triangles; and whether it has no normals, so that each corner of the
    scene has a vertex of its own."""
    decode_primitive(given, numbers)
    count = len(numbers.floats(given["attributes"]["POSITION"], 3))
    corners = numbers.whole(given["indices"]) if "indices" in given else np.arange(count)
    return triangles_of_mode(given.get("mode", TRIANGLES), corners), "NORMAL" not in given["attributes"]


def _rows(
    numbers: Numbers, attributes: Any, name: str, size: int, count: int, left_out: dict[str, None]
) -> NDArray[np.float64] | None:
    """An attribute of all vertices; what is not finite becomes 0, and is named."""
    if name not in attributes:
        return None
    rows = numbers.floats(attributes[name], size)
    if len(rows) != count:
        raise InputError(f"{name} has {len(rows)} rows, but there are {count} vertices")
    good = np.abs(rows) <= 1e6
    if not good.all():
        left_out[f"{name} that is not finite"] = None
        rows = np.where(good, rows, 0.0)
    return rows


class _Collected:
    """Primitives put into the world, one behind the other."""

    def __init__(self, allowance: Allowance) -> None:
        self._allowance, self._rows = allowance, 0
        self._parts: list[ScenePart] = []
        self._vertices: list[NDArray[np.float64]] = []
        self._faces: list[NDArray[np.int64]] = []
        self._normals: list[NDArray[np.float64]] = []
        self._primitives: list[Primitive] = []

    def add(self, primitive: Primitive, place: NDArray[np.float64], source: tuple[str, int, int, int]) -> None:
        """Put a primitive where `place`, (4, 4), says. source: the first four fields of its `ScenePart`."""
        self._rows += len(primitive.vertices) + len(primitive.faces)
        self._allowance.check(f"{self._rows:,} faces and vertices", self._rows * _BYTES_PER_ROW)
        turn = place[:3, :3]
        faces = primitive.faces
        last = self._parts[-1] if self._parts else ScenePart("", 0, 0, 0, 0, 0, 0, 0)
        first = last.first_vertex + last.vertices
        if np.linalg.det(turn) < 0.0:
            faces = faces[:, ::-1]
        cofactors = np.column_stack([np.cross(turn[:, (k + 1) % 3], turn[:, (k + 2) % 3]) for k in range(3)])
        normals = primitive.normals @ cofactors.T * np.sign(np.linalg.det(turn) or 1.0)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        self._normals.append(np.where(length > 0.0, normals / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0)))
        self._vertices.append(primitive.vertices @ turn.T + place[:3, 3])
        self._faces.append(faces + first)
        at = last.first_face + last.faces
        self._parts.append(ScenePart(*source, at, len(faces), first, len(primitive.vertices)))
        self._primitives.append(primitive)

    def fields(self) -> dict[str, Any]:
        if not self._parts:
            raise InputError("its scene has no triangles")
        all_of = self._primitives
        materials: dict[int, Material] = {id(one.material): one.material for one in all_of}
        number = {key: k for k, key in enumerate(materials)}
        normals = np.concatenate(self._normals)
        made: dict[str, Any] = {
            "mesh": Mesh(np.concatenate(self._vertices), np.concatenate(self._faces)),
            "materials": tuple(materials.values()),
            "face_materials": np.concatenate([np.full(len(one.faces), number[id(one.material)]) for one in all_of]),
            "normals": normals,
            "parts": tuple(self._parts),
        }
        for name, key, default in (("uv", "uv", 0.0), ("second_uv", "second", 0.0), ("colours", "colours", 1.0)):
            rows = [getattr(one, key) for one in all_of]
            if any(one is not None for one in rows):
                size = 4 if key == "colours" else 2
                full = [
                    np.full((len(one.vertices), size), default) if row is None else row
                    for row, one in zip(rows, all_of, strict=True)
                ]
                made[name] = np.concatenate(full)
        return made
