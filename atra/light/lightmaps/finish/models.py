"""Models with their light: the glTF that was baked, with the map beside its materials; and one that nothing shades."""

from __future__ import annotations

import json
import re
import warnings
from base64 import b64encode
from html import escape
from math import isqrt, log2
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.files.saving import encode_exr
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.finish.export import exposure_of, finished, parts_of
from atra.light.lightmaps.finish.gltf import Glb, SourceModel
from atra.light.lightmaps.finish.seams import Seams, dilated
from atra.light.lightmaps.finish.views import interpolated, look_of
from atra.light.lightmaps.maps import Lightmap
from atra.light.pictures.files import png_of
from atra.light.pictures.finish.tone import stops_of, toned
from atra.light.scene import Scene, ScenePart

_LIGHTMAP, _UNLIT = "MOZ_lightmap", "KHR_materials_unlit"
"""Extensions by which a material names its lightmap, and by which nothing shades it."""

_SHARP = 2048
"""Texels along a side up to which the texture is finer than the map, so that images of a scene stay sharp."""

_AT_ONCE = 1 << 18
"""Texels that are looked up at a time, which bounds the memory."""

_PAGE = Path(__file__).with_name("page.html")


def _glb_path(path: Path | str) -> Path:
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise InputError(f"a model is to be written to {str(path)!r}, expected a name that ends in .glb")
    return path


def save_lit_model(lightmap: Lightmap, scene: Scene, source: Path | str, path: Path | str) -> list[Path]:
    """Write the glTF or GLB `source` again, with its light: `path` (.glb), each map of the atlas as linear .exr and as
    .png, and `path` with .html, a page that holds all of it and shows it in any browser. Returns the files.

    Nodes, names, materials, textures, cameras and lamps stay; instances of EXT_mesh_gpu_instancing become nodes. The
    map's coordinates are TEXCOORD_1, or the next set if a material uses that; vertices on seams are doubled. Materials
    name the map by MOZ_lightmap, with its `intensity` (white of the PNG; a map is irradiance over pi), and its texture
    the EXR by `extras.exr`. An image that lay beside the file is put into it.
    scene: of `load_scene(source)`, whose mesh was baked. Raises InputError for another suffix or mesh; StorageError.
    """
    path = _glb_path(path)
    model = SourceModel(source, lightmap, scene)
    atlas, exposure = lightmap.texels.atlas, exposure_of(lightmap)
    files: dict[Path, bytes] = {}
    textures, maps = [], []
    for tail, part in parts_of(atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas))):
        stem = f"{path.stem}_light{tail}"
        files[path.with_name(f"{stem}.exr")] = encode_exr({one: part[..., k] for k, one in enumerate("RGB")})
        files[path.with_name(f"{stem}.png")] = png = png_of(exposure * part)
        textures.append(model.add_texture(png, stem, extras={"exr": f"{stem}.exr"}))
        same = {"width": atlas.width, "height": atlas.map_height}
        maps.append({"texture": textures[-1], **same, "halves": _halves(part)})
    sets = re.findall(r'"texCoord": (\d+)', json.dumps(model.given.get("materials", [])))
    channel = 1 + max(map(int, sets), default=0)

    def lit_material(part: ScenePart, number: int | None, on_map: int) -> Any:
        material = model.material(number)
        light = {"index": textures[on_map], "texCoord": channel, "intensity": 1.0 / exposure}
        material.setdefault("extensions", {})[_LIGHTMAP] = light
        return material

    model.place(channel, lit_material)
    files[path] = model.encoded(_LIGHTMAP)
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


def save_model(
    lightmap: Lightmap, scene: Scene, path: Path | str, source: Path | str | None = None, *,
    exposure: float | str = "auto", tone: str = "neutral",
) -> Path:  # fmt: skip
    """Write the scene as binary glTF with its light in the base colour, which any viewer shows unshaded
    (KHR_materials_unlit); returns the path.

    The texture is what `lit_view` shows of the surface: albedo times map, and emission, toned as a picture is, with the
    opacity as alpha. Where colours vary within triangles, it has up to 2,048 texels along a side, if that is more than
    the map has. Metal shows its plain colour.
    source: the glTF that `load_scene` read the scene from, whose nodes, names, cameras and lamps stay; None: the mesh,
    placed at its origin, with panes as a mesh of their own. exposure, tone: as of `stops_of` and `toned`. Raises
    InputError for another suffix, and as `save_lit_model`, `stops_of` and `toned`; StorageError.
    """
    path = _glb_path(path)
    empty: Any = {"asset": {"version": "2.0", "generator": "atra"}, "scene": 0, "nodes": []}
    model = Glb(empty) if source is None else SourceModel(source, lightmap, scene)
    texels, shown = _shown(lightmap, scene)
    shown[:, :3] = toned(shown[:, :3], stops_of(shown[:, :3], exposure), tone)
    has_alpha = bool((shown[:, 3] < 1.0).any())
    textures = [
        model.add_texture(png_of(part[..., :3], part[..., 3] if has_alpha else None), f"light{tail}")
        for tail, part in parts_of(texels.atlas, dilated(texels, shown, np.ones(len(texels), np.bool_)))
    ]
    if isinstance(model, SourceModel):
        _place(model, scene, textures)
    else:
        _add_meshes(model, lightmap.texels.atlas, scene, textures)
    write_atomically(path, model.encoded(_UNLIT))
    return path


def _shown(lightmap: Lightmap, scene: Scene) -> tuple[Texels, NDArray[np.float32]]:
    """The texels of the texture; and (N, 4) float32, what each shows: linear RGB and opacity."""
    texels, look = lightmap.texels, look_of(scene)
    atlas = texels.atlas
    light = finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas))
    finer = max(1, isqrt(_SHARP**2 // (atlas.width * atlas.height))) if look.varies else 1
    if finer > 1:
        larger = Atlas(finer * atlas.uv, atlas.chart, finer * atlas.width, finer * atlas.height, atlas.maps)
        with warnings.catch_warnings(action="ignore"):  # those of the map were given when it was made
            texels = Texels.of(scene.mesh, larger)
    shown = np.empty((len(texels), 4), np.float32)
    for first in range(0, len(texels), _AT_ONCE):
        here = slice(first, first + _AT_ONCE)
        face = texels.prim_id[here]
        found = look.at(face, texels.positions[here])
        row, column = np.divmod(texels.number[here], texels.atlas.width)
        place = (np.stack([column, row], axis=1) + 0.5) / finer
        shown[here, :3] = found.albedo * interpolated(face, place, atlas, light) + found.emission
        shown[here, 3] = found.opacity
    return texels, shown


def _place(model: SourceModel, scene: Scene, textures: list[int]) -> None:
    """Give the meshes of a glTF the textures in place of its materials."""
    panes, given = look_of(scene).panes, model.given.get("materials", [])

    def unlit(part: ScenePart, number: int | None, on_map: int) -> Any:
        kept: Any = {} if number is None else given[number]
        has_panes = bool(panes[part.first_face : part.first_face + part.faces].any())
        mode = "OPAQUE" if not has_panes else "MASK" if kept.get("alphaMode") == "MASK" else "BLEND"
        return _material(textures[on_map], kept.get("name", "light"), mode, kept.get("doubleSided", False))

    model.place(0, unlit, is_bare=True)
    for name in model.tree.get("extensions", {}).keys() - {"KHR_lights_punctual"}:
        del model.tree["extensions"][name]


def _add_meshes(model: Glb, atlas: Atlas, scene: Scene, textures: list[int]) -> None:
    """Add a mesh for the opaque triangles of each map, and one for its panes."""
    panes, mesh = look_of(scene).panes, scene.mesh
    mapped = np.isfinite(atlas.uv).all(axis=(1, 2))
    for number, texture in enumerate(textures):
        for kind, of_kind, mode in (("scene", ~panes, "OPAQUE"), ("panes", panes, "BLEND")):
            faces = np.flatnonzero(mapped & of_kind & (atlas.map_of == number))
            if not len(faces):
                continue
            uv = atlas.uv[faces].reshape(-1, 2) / (atlas.width, atlas.map_height) - (0, number)
            attributes = {
                "POSITION": model.add_rows(mesh.local_vertices[mesh.faces[faces]].reshape(-1, 3)),
                "TEXCOORD_0": model.add_rows(uv.astype(np.float32)),
            }
            name = f"{kind}_{number}" if atlas.maps > 1 else kind
            material = model.add("materials", _material(texture, name, mode, True))
            primitives = [{"attributes": attributes, "material": material}]
            placed = {"mesh": model.add("meshes", {"name": name, "primitives": primitives})}
            model.add("nodes", {"name": name, "translation": mesh.origin.tolist(), **placed})
    model.add("scenes", {"nodes": list(range(len(model.tree["nodes"])))})


def _material(texture: int, name: str, mode: str, is_double: bool) -> Any:
    plain = {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    fields = {"name": name, "alphaMode": mode, "doubleSided": is_double}
    return {"pbrMetallicRoughness": plain, "extensions": {_UNLIT: {}}} | fields
