"""Files of a lightmap: EXR for further work, PNG for viewing, and a glTF model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.glb import LIGHTMAP, Glb
from atra.light.lightmaps.finish.looks import look_of
from atra.light.lightmaps.finish.seams import Seams, dilated
from atra.light.lightmaps.maps import LIGHTS, Lightmap
from atra.light.pictures.files import exr_of_channels, png_of
from atra.light.scene import Scene

_BRIGHT = 0.99
"""Quantile of the texels' luminance that is shown as white."""


def finished(lightmap: Lightmap, values: NDArray[np.float32], seams: Seams | None = None) -> NDArray[np.float32]:
    """(H, W, C) image of (N, C) values with gutters filled and, if `seams` are given, matched; several maps stacked
    vertically."""
    image = dilated(lightmap.texels, values, lightmap.valid)
    return image if seams is None else seams.stitched(image)


def exposure_of(lightmap: Lightmap) -> float:
    """The factor that scales light for display."""
    lit = lightmap.luminance[lightmap.valid]
    bright = float(np.quantile(lit, _BRIGHT)) if len(lit) else 0.0
    return 1.0 / bright if bright > 0.0 else 1.0


def save_maps(
    lightmap: Lightmap, folder: Path | str, *, stitch: bool = True, visible: NDArray[np.bool_] | None = None
) -> list[Path]:
    """Write each kind of light and the openness as linear EXR and PNG, occupancy and charts as PNG; returns the files.
    Several maps get numbered files.

    stitch: whether seams are matched. visible: (N,) bool, what a view shows, written as well. Raises InputError without
    the package OpenEXR, StorageError.
    """
    texels, folder = lightmap.texels, Path(folder)
    seams = Seams.of(texels.mesh, texels.atlas) if stitch else None
    exposure = exposure_of(lightmap)
    files: dict[str, bytes] = {}

    def keep(name: str, image: NDArray[Any], exposure: float = 1.0, *, exactly: bool = False) -> None:
        for tail, part in _parts(texels.atlas, image):
            if exactly:
                channels = "RGB" if part.shape[2] == 3 else "Y"
                files[f"{name}{tail}.exr"] = exr_of_channels({one: part[..., k] for k, one in enumerate(channels)})
            files[f"{name}{tail}.png"] = png_of(np.broadcast_to(exposure * part, (*part.shape[:2], 3)))

    for name in LIGHTS:
        keep(name, finished(lightmap, lightmap.light(name), seams), exposure, exactly=True)
    keep("openness", finished(lightmap, lightmap.openness[:, None]), exactly=True)
    keep("occupancy", texels.occupied[..., None])
    if visible is not None:
        keep("culling_map", texels.image(0.2 + 0.8 * visible)[..., None])
    turns = texels.chart[:, None] * 0.618034 + (0.0, 1 / 3, 2 / 3)
    keep("charts", texels.image(0.5 + 0.4 * np.cos(2.0 * np.pi * turns)))
    for name, content in files.items():
        write_atomically(folder / name, content)
    return [folder / name for name in files]


def _parts(atlas: Atlas, image: NDArray[Any]) -> list[tuple[str, NDArray[Any]]]:
    """The maps of an (H, W, C) image, with the suffixes of their names."""
    parts = np.split(image, atlas.maps)
    return [(f"_{number}" if len(parts) > 1 else "", part) for number, part in enumerate(parts)]


def save_model(lightmap: Lightmap, scene: Scene, path: Path | str, *, stitch: bool = True) -> Path:
    """Write the mesh as binary glTF with its light, which viewers show unshaded (KHR_materials_unlit).

    The map is the base colour, by TEXCOORD_0 and an equal TEXCOORD_1, and also a MOZ_lightmap; albedo and opacity are
    the colour of vertices. Several maps get a mesh each, and panes one of their own that blends. Nodes place vertices,
    which count from the mesh's origin. Raises InputError for another suffix, StorageError.
    """
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise InputError(f"a model is to be written to {str(path)!r}, expected a name that ends in .glb")
    atlas, look, mesh = lightmap.texels.atlas, look_of(scene), scene.mesh
    seams = Seams.of(lightmap.texels.mesh, atlas) if stitch else None
    exposure = exposure_of(lightmap)
    image = exposure * finished(lightmap, lightmap.combined, seams)
    mapped = np.isfinite(atlas.uv).all(axis=(1, 2))
    albedo, opacity = look.means()
    colours = np.clip(np.rint(255.0 * np.column_stack([albedo, opacity])), 0, 255).astype(np.uint8)
    model = Glb({"asset": {"version": "2.0", "generator": "atra"}, "scene": 0, "nodes": []})
    model.use("KHR_materials_unlit", LIGHTMAP)
    for number, (tail, part) in enumerate(_parts(atlas, image)):
        texture = model.add_texture(png_of(part), f"lightmap{tail}")
        for name, kind, mode in (("scene", ~look.panes, "OPAQUE"), ("panes", look.panes, "BLEND")):
            faces = np.flatnonzero(mapped & kind & (atlas.map_of == number))
            if not len(faces):
                continue
            uv = atlas.uv[faces].reshape(-1, 2) / (atlas.width, atlas.map_height) - (0, number)
            on_map = model.add_rows(uv.astype(np.float32))
            attributes = {
                "POSITION": model.add_rows(mesh.local_vertices[mesh.faces[faces]].reshape(-1, 3)),
                "TEXCOORD_0": on_map,
                "TEXCOORD_1": on_map,
                "COLOR_0": model.add_rows(np.repeat(colours[faces], 3, axis=0), normalized=True),
            }
            primitive = {"attributes": attributes, "material": _material(model, texture, mode, 1.0 / exposure)}
            lit = model.add("meshes", {"name": f"{name}{tail}", "primitives": [primitive]})
            model.add("nodes", {"name": f"{name}{tail}", "mesh": lit, "translation": mesh.origin.tolist()})
    model.add("scenes", {"nodes": list(range(len(model.tree["nodes"])))})
    write_atomically(path, model.encoded())
    return path


def _material(model: Glb, texture: int, mode: str, intensity: float) -> int:
    """A material of a map. intensity: the light that its white stands for."""
    on_map = {"index": texture, "texCoord": 1}
    plain = {"baseColorTexture": on_map, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    extensions = {"KHR_materials_unlit": {}, LIGHTMAP: on_map | {"intensity": intensity}}
    fields = {"name": "lightmap", "doubleSided": True, "alphaMode": mode}
    return model.add("materials", {"pbrMetallicRoughness": plain, "extensions": extensions} | fields)
