"""A lightmap put into the glTF that was baked: everything in the file stays, and each material gets the map."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from copy import deepcopy
from html import escape
from math import log2
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.packed import DRACO
from atra.files.gltf.primitives import read_primitive
from atra.files.gltf.tree import gltf_tree
from atra.files.paths import write_atomically
from atra.files.reading import read_regular_file
from atra.files.saving import encode_exr
from atra.light.lightmaps.finish.export import exposure_of, finished, parts_of
from atra.light.lightmaps.finish.glb import ELEMENTS, LIGHTMAP, Glb, glb_path
from atra.light.lightmaps.finish.seams import Seams
from atra.light.lightmaps.maps import Lightmap
from atra.light.pictures.files import png_of
from atra.light.scene import Scene, ScenePart

_INSTANCING = "EXT_mesh_gpu_instancing"

_SAFE = LIGHTMAP, "EXT_texture_webp", _INSTANCING
"""Extensions beside Khronos's that name entries of the file as glTF does; others may do so by keys of their own."""

_NAMES = "extensionsUsed", "extensionsRequired"

_SHAPE = "POSITI", "JOINTS", "WEIGHT"
"""First letters of the attributes that say where vertices are."""

_QUANTIZED = "KHR_mesh_quantization"
"""An extension that is used without being named again."""

_MIME = {b"\x89": "image/png", b"\xff": "image/jpeg", b"R": "image/webp", b"\xab": "image/ktx2"}
"""Kinds of images, by their first byte."""

_PAGE = Path(__file__).with_name("page.html")

MaterialOf = Callable[[ScenePart, int | None, int], Any]
"""The material of a part of a scene, whose material has a number in the file, on a map of an atlas."""


def save_lit_model(lightmap: Lightmap, scene: Scene, source: Path | str, path: Path | str) -> list[Path]:
    """Write the glTF or GLB `source` again, with its light: `path` (.glb), each map of the atlas as linear .exr and as
    .png, and `path` with .html, a page that holds all of it and shows it in any browser. Returns the files.

    Nodes, names, materials, textures, cameras and lamps stay; instances of EXT_mesh_gpu_instancing become nodes. The
    map's coordinates are TEXCOORD_1, or the next set if a material uses that; vertices on seams are doubled. Materials
    name the map by MOZ_lightmap, with its `intensity` (white of the PNG; a map is irradiance over pi), and its texture
    the EXR by `extras.exr`. An image that lay beside the file is put into it.
    scene: of `load_scene(source)`, whose mesh was baked. Raises InputError for another suffix or mesh; StorageError.
    """
    path = glb_path(path)
    model = SourceModel(source, lightmap, scene)
    atlas, exposure = lightmap.texels.atlas, exposure_of(lightmap)
    image = finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas))
    files: dict[Path, bytes] = {}
    textures = []
    for tail, part in parts_of(atlas, image):
        stem = f"{path.stem}_light{tail}"
        files[path.with_name(f"{stem}.exr")] = encode_exr({one: part[..., k] for k, one in enumerate("RGB")})
        files[path.with_name(f"{stem}.png")] = png = png_of(exposure * part)
        textures.append(model.add_texture(png, stem, extras={"exr": f"{stem}.exr"}))
    sets = re.findall(r'"texCoord": (\d+)', json.dumps(model.tree.get("materials", [])))
    channel = 1 + max(map(int, sets), default=0)
    given = model.tree.get("materials", [])

    def lit_material(part: ScenePart, number: int | None, on_map: int) -> Any:
        material: Any = {} if number is None else deepcopy(given[number])
        light = {"index": textures[on_map], "texCoord": channel, "intensity": 1.0 / exposure}
        material.setdefault("extensions", {})[LIGHTMAP] = light
        return material

    model.place(channel, lit_material)
    model.use(LIGHTMAP)
    entries = [model.tree["textures"][one] for one in textures]
    files[path] = model.encoded()
    maps = [
        {
            "texture": model.tree["textures"].index(one),
            "width": atlas.width, "height": atlas.map_height, "halves": _halves(part),
        }
        for one, part in zip(entries, np.split(image, atlas.maps), strict=True)
    ]  # fmt: skip
    files[path.with_suffix(".html")] = _page(path.stem, files[path], maps, exposure)
    for name, content in files.items():
        write_atomically(name, content)
    return list(files)


def _halves(image: NDArray[np.float32]) -> str:
    """An (H, W, 3) image as RGBA of half floats, in base64."""
    rgba = np.ones((*image.shape[:2], 4), "<f2")
    rgba[..., :3] = np.clip(image, 0.0, 65504.0)
    return b64encode(rgba.tobytes()).decode()


def _page(name: str, model: bytes, maps: list[dict[str, Any]], exposure: float) -> bytes:
    """A page that shows a model with its maps, all of it inside."""
    stops = min(max(log2(exposure), -8.0), 8.0)
    held = {"NAME": escape(name), "STOPS": f"{stops:.1f}", "MODEL": b64encode(model).decode(), "MAPS": json.dumps(maps)}
    page = _PAGE.read_text(encoding="utf-8")
    return re.sub("|".join(held), lambda found: held[found[0]], page).encode()


class SourceModel(Glb):
    """The glTF that a scene was read from. Raises InputError for another scene or mesh than that of the map."""

    def __init__(self, source: Path | str, lightmap: Lightmap, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"scene is a {type(scene).__name__}, expected the Scene that load_scene read from a glTF")
        if lightmap.texels.mesh is not scene.mesh or not scene.parts:
            raise InputError(
                "the lightmap is of another mesh, expected that of a scene which load_scene read from a glTF"
            )
        source = Path(source)
        content, suffix = read_regular_file(source), source.suffix.lower().lstrip(".")
        folder = Folder(source)
        super().__init__(deepcopy(gltf_tree(content, suffix)))
        self._scene, self._atlas = scene, lightmap.texels.atlas
        self._numbers = Numbers(self.tree, content, suffix, folder)
        for number, view in enumerate(self.tree.get("bufferViews", [])):
            kept = {name: view[name] for name in ("byteStride", "target", "name") if name in view}
            self.add_view(self._numbers.view(number), **kept)
        for image in self.tree.get("images", []):
            if "uri" in image:
                content = folder.read(image.pop("uri"))
                image["bufferView"] = self.add_view(content)
                image["mimeType"] = _MIME.get(content[:1], "image/png")
        samplers = [one for animation in self.tree.get("animations", ()) for one in animation["samplers"]]
        for number in {sampler[key] for sampler in samplers for key in ("input", "output")}:
            accessor, rows = self._numbers.rows(number)
            view = self.views[accessor["bufferView"]][0] if "bufferView" in accessor else {}
            if view.get("byteStride") == rows.shape[1] * rows.itemsize:
                del view["byteStride"]  # rows of an animation may have none

    def place(self, channel: int, material_of: MaterialOf, is_bare: bool = False) -> None:
        """Give each placed mesh coordinates on the map and materials.

        channel: set of the coordinates. material_of: the material of a part, by its number in the file, on a map of the
        atlas. is_bare: whether primitives lose all but their shape, joints and morphs.
        """
        placed: dict[int, list[Any]] = {}
        turns: Counter[tuple[int, int]] = Counter()
        materials: dict[str, int] = {}
        instances = {number: self._instances(node) for number, node in enumerate(list(self.tree["nodes"]))}
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
        for node, primitives in placed.items():
            given = self.tree["nodes"][node]
            old = self.tree["meshes"][given["mesh"]]
            rest = [
                one for k, one in enumerate(old["primitives"]) if (source[node], k) not in turns
            ]  # points and lines
            given["mesh"] = self.add("meshes", {**old, "primitives": primitives + rest})

    def _instances(self, node: Any) -> list[int]:
        """Nodes, one for each instance of a node's mesh, in place of EXT_mesh_gpu_instancing; none without that."""
        many = node.get("extensions", {}).pop(_INSTANCING, None)
        if many is None:
            return []
        if not node["extensions"]:
            del node["extensions"]
        found = {
            name.lower(): self._numbers.floats(number, 4 if name == "ROTATION" else 3)
            for name, number in many["attributes"].items()
            if name in ("TRANSLATION", "ROTATION", "SCALE")
        }
        if "rotation" in found:
            length = np.linalg.norm(found["rotation"], axis=1, keepdims=True)
            found["rotation"] = np.where(length > 0.0, found["rotation"] / np.maximum(length, 1e-30), (0, 0, 0, 1))
        mesh, name = node.pop("mesh"), node.get("name", "instance")
        made = [
            self.add(
                "nodes", {"mesh": mesh, "name": f"{name} {k}", **{key: rows[k].tolist() for key, rows in found.items()}}
            )
            for k in range(min(map(len, found.values()), default=0))
        ]
        node["children"] = node.get("children", []) + made
        return made

    def _lit(self, part: ScenePart, number: int, channel: int, is_bare: bool) -> Any:
        """The primitive's triangles that lie on a map; None without any. Triangles without a place are on the first."""
        scene, atlas = self._scene, self._atlas
        own = slice(part.first_face, part.first_face + part.faces)
        given = deepcopy(self.tree["meshes"][part.mesh]["primitives"][part.primitive])
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
        vertices = corners[first]
        for attributes in (given["attributes"], *given.get("targets", ())):
            for name, accessor in attributes.items():
                given_accessor, rows = self._numbers.rows(accessor)
                fields = {key: given_accessor[key] for key in ("normalized", "name") if key in given_accessor}
                attributes[name] = self.add_rows(rows[vertices], **fields)
        on_map = self.add_rows(places[first])
        for lower in range(channel):  # sets must be consecutive
            given["attributes"].setdefault(f"TEXCOORD_{lower}", on_map)
        given["attributes"][f"TEXCOORD_{channel}"] = on_map
        given["indices"] = self.add_rows(corner.reshape(-1, 1).astype(np.uint32), ELEMENTS)
        given["mode"] = 4
        return given

    def _keep(self, kind: str, places: Iterable[Place]) -> None:
        """Keep the entries that are named; there, each number becomes its place among them."""
        unique = {(id(entry), key): (entry, key) for entry, key in places}.values()
        kept = sorted({entry[key] for entry, key in unique})
        number = {old: new for new, old in enumerate(kept)}
        for entry, key in unique:
            entry[key] = number[entry[key]]
        if kind == "bufferViews":
            self.views = [self.views[old] for old in kept]
        elif kept:
            self.tree[kind] = [self.tree[kind][old] for old in kept]
        else:
            self.tree.pop(kind, None)

    def encoded(self) -> bytes:
        """The file, a GLB, without what has been replaced."""
        tree = self.tree
        if all(name.startswith("KHR_") or name in _SAFE for name in tree.get("extensionsUsed", ())):
            self._keep("meshes", [(node, "mesh") for node in tree["nodes"] if "mesh" in node])
            self._keep("accessors", _accessors_of(tree))
            self._keep("materials", _naming(tree["meshes"], "material"))
            self._keep("textures", _naming(tree["materials"], "index"))
            self._keep("images", _naming(tree.get("textures", []), "source"))
            self._keep("samplers", _naming(tree.get("textures", []), "sampler"))
            self._keep("bufferViews", _naming([tree["accessors"], tree.get("images", [])], "bufferView"))
        text = json.dumps({kind: held for kind, held in tree.items() if kind not in (*_NAMES, "bufferViews")})
        for kind in _NAMES:
            left = [name for name in tree.pop(kind, ()) if name == _QUANTIZED or f'"{name}": ' in text]
            tree |= {kind: left} if left else {}
        return super().encoded()


Place = tuple[Any, Any]
"""Where a number stands: an object of the tree, and a key in it."""


def _accessors_of(tree: Any) -> Iterator[Place]:
    """Where accessors are named."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            yield from ((primitive, "indices"),) if "indices" in primitive else ()
            for attributes in (primitive["attributes"], *primitive.get("targets", ())):
                yield from ((attributes, name) for name in attributes)
    for animation in tree.get("animations", ()):
        yield from ((sampler, key) for sampler in animation["samplers"] for key in ("input", "output"))
    yield from ((skin, "inverseBindMatrices") for skin in tree.get("skins", ()) if "inverseBindMatrices" in skin)


def _naming(tree: Any, key: str) -> Iterator[Place]:
    """Where a key stands with a whole number."""
    if isinstance(tree, dict) and isinstance(tree.get(key), int):
        yield tree, key
    for name, entry in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(entry, dict | list) and name != "extras":
            yield from _naming(entry, key)
