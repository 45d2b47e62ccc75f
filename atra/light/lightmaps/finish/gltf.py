"""A glTF that grows, from nothing or from the file of a scene, whose meshes get places on a lightmap."""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder
from atra.files.gltf.nodes import instances_of
from atra.files.gltf.numbers import COMPONENT_TYPES, Numbers
from atra.files.gltf.packed import DRACO
from atra.files.gltf.primitives import read_primitive
from atra.files.gltf.tree import gltf_tree
from atra.files.reading import read_regular_file
from atra.light.lightmaps.maps import Lightmap
from atra.light.scene import Scene, ScenePart

_ARRAY, _ELEMENTS = 34962, 34963
"""Targets of buffer views of vertices and of indices."""

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_LINEAR, _CLAMP = 9729, 33071
_KINDS = {np.dtype(name).str: kind for kind, name in COMPONENT_TYPES.items()}

_NAMED = "meshes", "accessors", "bufferViews", "buffers", "materials", "textures", "images", "samplers"
"""Lists of a file whose entries are copied when another entry names them."""

_NAMES = {
    "materials": {"index": "textures"},
    "textures": {"source": "images", "sampler": "samplers"},
    "images": {"bufferView": "bufferViews"},
}
"""In the entries of a list, the keys that name entries of others."""

_QUANTIZED = "KHR_mesh_quantization"
"""An extension that is used without being named again."""

_MIME = {b"\x89": "image/png", b"\xff": "image/jpeg", b"R": "image/webp", b"\xab": "image/ktx2"}
"""Kinds of images, by their first byte."""

_SHAPE = "POSITI", "JOINTS", "WEIGHT"
"""First letters of the attributes that say where vertices are."""

MaterialOf = Callable[[ScenePart, int | None, int], Any]
"""The material of a part of a scene, whose material has a number in the file, on a map of an atlas."""


class Glb:
    """A glTF in the making. tree: its JSON, which grows. views: fields and content of its buffer views."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.views: list[tuple[Any, bytes]] = []

    def add(self, kind: str, entry: Any) -> int:
        """Add an entry of a kind, such as "meshes"; returns its number."""
        self.tree.setdefault(kind, []).append(entry)
        return len(self.tree[kind]) - 1

    def add_view(self, content: bytes, **fields: Any) -> int:
        """A buffer view; returns its number."""
        self.views.append((fields, content))
        return len(self.views) - 1

    def add_texture(self, png: bytes, name: str, **fields: Any) -> int:
        """A texture of a map; returns its number."""
        image = self.add("images", {"name": name, "mimeType": "image/png", "bufferView": self.add_view(png)})
        sampler = {"magFilter": _LINEAR, "minFilter": _LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP}
        return self.add("textures", {"name": name, "source": image, "sampler": self.add("samplers", sampler), **fields})

    def add_rows(self, rows: NDArray[Any], target: int | None = _ARRAY, **fields: Any) -> int:
        """An accessor of (N, K) rows; returns its number. target: None = of no vertices. fields: its others, such as
        `normalized`."""
        rows = np.ascontiguousarray(rows)
        size, item = rows.shape[1], rows.dtype.itemsize
        kind = "SCALAR" if size == 1 else "MAT4" if size == 16 else f"VEC{size}"
        made = fields | {"count": len(rows), "type": kind, "componentType": _KINDS[rows.dtype.str]}
        if target != _ELEMENTS:
            made |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        padded = np.zeros((len(rows), size * item if target is None else -(-size * item // 4) * 4), np.uint8)
        padded[:, : size * item] = rows.view(np.uint8).reshape(len(rows), -1)
        of_view = {} if target is None else {"target": target}
        if target == _ARRAY:
            of_view["byteStride"] = padded.shape[1]
        return self.add("accessors", made | {"bufferView": self.add_view(padded.tobytes(), **of_view)})

    def encoded(self, *used: str) -> bytes:
        """The binary file. used: extensions that it uses beside those of the tree, which stay where they are named."""
        lists = {"extensionsUsed": set(used), "extensionsRequired": set()}
        tree = {kind: held for kind, held in self.tree.items() if kind not in lists}
        text = json.dumps(tree)
        for kind, names in lists.items():
            names |= {name for name in self.tree.get(kind, ()) if name == _QUANTIZED or f'"{name}": ' in text}
            tree |= {kind: sorted(names)} if names else {}
        content, entries = bytearray(), []
        for fields, part in self.views:
            content += b"\0" * (-len(content) % 4)
            entries.append({"buffer": 0, "byteOffset": len(content), "byteLength": len(part), **fields})
            content += part
        tree |= {"bufferViews": entries, "buffers": [{"byteLength": len(content)}]}
        chunks, text = b"", json.dumps(tree, separators=(",", ":"))
        for number, part, blank in ((_JSON, text.encode(), b" "), (_BINARY, bytes(content), b"\0")):
            part += blank * (-len(part) % 4)
            chunks += len(part).to_bytes(4, "little") + number.to_bytes(4, "little") + part
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


class SourceModel(Glb):
    """The glTF that a scene was read from; of its lists in `_NAMED` only what is named. Raises InputError for another
    scene or mesh than that of the map."""

    def __init__(self, source: Path | str, lightmap: Lightmap, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"scene is a {type(scene).__name__}, expected the Scene that load_scene read from a glTF")
        if lightmap.texels.mesh is not scene.mesh or not scene.parts:
            raise InputError(
                "the lightmap is of another mesh, expected that of a scene which load_scene read from a glTF"
            )
        source = Path(source)
        content, suffix = read_regular_file(source), source.suffix.lower().lstrip(".")
        self.given, self._folder = gltf_tree(content, suffix), Folder(source)
        self._scene, self._atlas = scene, lightmap.texels.atlas
        self._numbers = Numbers(self.given, content, suffix, self._folder)
        self._copies: dict[tuple[str, int], int] = {}
        super().__init__(deepcopy({kind: held for kind, held in self.given.items() if kind not in _NAMED}))
        for animation in self.tree.get("animations", ()):
            for key in ("input", "output"):
                self._name(animation["samplers"], key, "accessors")
        self._name(self.tree.get("skins", []), "inverseBindMatrices", "accessors")
        for name in [name for name in self.tree.get("extensions", ()) if not name.startswith("KHR_")]:
            del self.tree["extensions"][name]  # its numbers may be of what is not kept
            warnings.warn(f"{name} of {source.name} is left out", stacklevel=3)

    def _name(self, tree: Any, key: str, kind: str) -> None:
        """Let the tree's whole numbers at a key, which are of the given file, be those of copies."""
        for entry in _naming(tree, key):
            entry[key] = self.copied(kind, entry[key])

    def copied(self, kind: str, number: int) -> int:
        """The number of the copy of an entry, with all that it names; made once."""
        if (kind, number) not in self._copies:
            entry = deepcopy(self.given[kind][number])
            if kind == "bufferViews":
                made = self.add_view(self._numbers.view(number))
            elif kind == "accessors":
                fields = {key: entry[key] for key in ("normalized", "name") if key in entry}
                made = self.add_rows(self._numbers.rows(number)[1], None, **fields)
            else:
                for key, of in _NAMES.get(kind, {}).items():
                    self._name(entry, key, of)
                if "uri" in entry:
                    content = self._folder.read(entry.pop("uri"))
                    entry |= {"bufferView": self.add_view(content), "mimeType": _MIME.get(content[:1], "image/png")}
                made = self.add(kind, entry)
            self._copies[kind, number] = made
        return self._copies[kind, number]

    def material(self, number: int | None) -> Any:
        """A copy of a material, with the textures that it names; empty for None."""
        made: Any = {} if number is None else deepcopy(self.given["materials"][number])
        self._name(made, "index", "textures")
        return made

    def place(self, channel: int, material_of: MaterialOf, is_bare: bool = False) -> None:
        """Give each placed mesh coordinates on the map and materials.

        channel: set of the coordinates. material_of: the material of a part, by its number in the file, on a map of the
        atlas. is_bare: whether primitives lose all but their shape, joints and morphs.
        """
        placed: dict[int, list[Any]] = {}
        turns: Counter[tuple[int, int]] = Counter()
        materials: dict[str, int] = {}
        nodes = self.tree["nodes"]
        instances = {number: self._instances(node) for number, node in enumerate(list(nodes))}
        source = {one: number for number, own in instances.items() for one in own or [number]}
        for part in self._scene.parts:
            turn = turns[part.node, part.primitive]
            of_part = placed.setdefault((instances[part.node] or [part.node])[turn], [])
            turns[part.node, part.primitive] += 1
            for on_map in range(self._atlas.maps):
                primitive = self._lit(part, on_map, channel, is_bare)
                if primitive is None:
                    continue
                material = material_of(part, primitive.get("material"), on_map)
                key = json.dumps(material)
                if key not in materials:
                    materials[key] = self.add("materials", material)
                primitive["material"] = materials[key]
                of_part.append(primitive)
        for number, node in enumerate(nodes):
            if "mesh" not in node:
                continue
            old = self.given["meshes"][node["mesh"]]
            rest = [one for k, one in enumerate(old["primitives"]) if (source.get(number), k) not in turns]
            primitives = placed.get(number, []) + [self._unplaced(one) for one in rest]
            node["mesh"] = self.add("meshes", {**old, "primitives": primitives})

    def _unplaced(self, given: Any) -> Any:
        """A copy of points, of lines, or of triangles outside of the scene."""
        given = deepcopy(given)
        if DRACO in given.get("extensions", {}):
            read_primitive(given, self._numbers)
            del given["extensions"][DRACO]
        for attributes in (given["attributes"], *given.get("targets", ())):
            for name, number in attributes.items():
                attributes[name] = self.copied("accessors", number)
        self._name(given, "indices", "accessors")
        self._name(given, "material", "materials")
        return given

    def _instances(self, node: Any) -> list[int]:
        """Nodes, one for each instance of a node's mesh, in place of EXT_mesh_gpu_instancing; none without that."""
        found = instances_of(node, self._numbers)
        if found is None:
            return []
        del node["extensions"]["EXT_mesh_gpu_instancing"]
        if not node["extensions"]:
            del node["extensions"]
        if "rotation" in found:
            length = np.linalg.norm(found["rotation"], axis=1, keepdims=True)
            found["rotation"] = np.where(length > 0.0, found["rotation"] / np.maximum(length, 1e-30), (0, 0, 0, 1))
        same = {"mesh": node.pop("mesh")}
        made = [
            self.add(
                "nodes", same | {"name": f"{node.get('name', 'instance')} {k}"} | dict(zip(found, rows, strict=True))
            )
            for k, rows in enumerate(zip(*(rows.tolist() for rows in found.values()), strict=False))
        ]
        node["children"] = node.get("children", []) + made
        return made

    def _lit(self, part: ScenePart, number: int, channel: int, is_bare: bool) -> Any:
        """The primitive's triangles that lie on a map; None without any. Triangles without a place are on the first."""
        scene, atlas = self._scene, self._atlas
        own = slice(part.first_face, part.first_face + part.faces)
        given = deepcopy(self.given["meshes"][part.mesh]["primitives"][part.primitive])
        _, faces = read_primitive(given, self._numbers)
        is_flat = "NORMAL" not in given["attributes"]  # each corner of the scene then has a vertex of its own
        given.get("extensions", {}).pop(DRACO, None)
        if is_bare:
            given = {name: given[name] for name in ("attributes", "targets", "material") if name in given}
            given["attributes"] = {name: number for name, number in given["attributes"].items() if name[:6] in _SHAPE}
        local = scene.mesh.faces[own].astype(np.int64) - part.first_vertex
        uv = atlas.uv[own] / (atlas.width, atlas.map_height)
        uv[..., 1] -= number
        expected = np.arange(faces.size).reshape(-1, 3) if is_flat else faces
        if not np.array_equal(local, expected):  # a mirrored node turns the triangles of the scene
            uv = uv[:, ::-1]
        here = np.where(np.isfinite(uv).all(axis=(1, 2)), atlas.map_of[own], 0) == number
        if not here.any():
            return None
        places = np.clip(np.nan_to_num(uv[here].reshape(-1, 2)), 0.0, 1.0).astype(np.float32)
        corners = faces[here].ravel()
        keys = np.column_stack([corners, places.view(np.int32)])
        _, first, corner = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        for attributes in (given["attributes"], *given.get("targets", ())):
            for name, accessor in attributes.items():
                given_accessor, rows = self._numbers.rows(accessor)
                fields = {key: given_accessor[key] for key in ("normalized", "name") if key in given_accessor}
                attributes[name] = self.add_rows(rows[corners[first]], **fields)
        on_map = self.add_rows(places[first])
        for lower in range(channel):  # sets must be consecutive
            given["attributes"].setdefault(f"TEXCOORD_{lower}", on_map)
        given["attributes"][f"TEXCOORD_{channel}"] = on_map
        given["indices"] = self.add_rows(corner.reshape(-1, 1).astype(np.uint32), _ELEMENTS)
        given["mode"] = 4
        self._name(given.get("extensions", {}), "material", "materials")  # of variants
        return given


def _naming(tree: Any, key: str) -> Iterator[Any]:
    """The objects in which a key stands with a whole number."""
    if isinstance(tree, dict) and isinstance(tree.get(key), int):
        yield tree
    for name, entry in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(entry, dict | list) and name != "extras":
            yield from _naming(entry, key)
