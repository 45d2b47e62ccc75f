"""Files of a lightmap: EXR for further work, PNG for viewing, and a glTF model."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.looks import look_of
from atra.light.lightmaps.finish.seams import Seams, dilated
from atra.light.lightmaps.maps import LIGHTS, Lightmap
from atra.light.pictures.files import exr_of_channels, png_of, srgb_of
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
    import trimesh

    atlas, look = lightmap.texels.atlas, look_of(scene)
    seams = Seams.of(lightmap.texels.mesh, atlas) if stitch else None
    exposure = exposure_of(lightmap)
    image = srgb_of(exposure * finished(lightmap, lightmap.combined, seams))
    mapped = np.isfinite(atlas.uv).all(axis=(1, 2))
    albedo, opacity = look.means()
    colours = np.clip(np.rint(255.0 * np.column_stack([albedo, opacity])), 0, 255).astype(np.uint8)
    models, panes = {}, look.panes
    for number, (tail, part) in enumerate(_parts(atlas, image)):
        for name, kind in (("scene", ~panes), ("panes", panes)):
            faces = np.flatnonzero(mapped & kind & (atlas.map_of == number))
            if len(faces):
                models[f"{name}{tail}"] = _lit_mesh(scene, atlas, faces, part, colours[faces], name == "panes")
    placed, place = trimesh.Scene(), np.eye(4)
    place[:3, 3] = scene.mesh.origin
    for name, model in models.items():
        placed.add_geometry(model, geom_name=name, node_name=name, transform=place)
    content = placed.export(file_type="glb", tree_postprocessor=lambda tree: _mark_as_lightmap(tree, 1.0 / exposure))
    write_atomically(path, content)
    return path


def _lit_mesh(
    scene: Scene, atlas: Atlas, faces: NDArray[np.int64], image: NDArray[np.uint8], colours: NDArray[np.uint8],
    blends: bool,
) -> Any:  # fmt: skip
    """These triangles, all of one map, with that map as texture and their colours, (N, 4)."""
    import trimesh
    from PIL import Image

    corners = scene.mesh.local_vertices[scene.mesh.faces[faces]].reshape(-1, 3)
    uv = atlas.uv[faces].reshape(-1, 2) / (atlas.width, atlas.map_height)
    uv[:, 1] = 1.0 + atlas.map_of[faces[0]] - uv[:, 1]
    material = trimesh.visual.material.PBRMaterial(
        name="lightmap", baseColorTexture=Image.fromarray(image, "RGB"), metallicFactor=0.0, roughnessFactor=1.0,
        doubleSided=True, alphaMode="BLEND" if blends else "OPAQUE",
    )  # fmt: skip
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    visual.vertex_attributes["color"] = np.repeat(colours, 3, axis=0)
    return trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), visual=visual, process=False)


def _mark_as_lightmap(tree: dict[str, Any], intensity: float) -> None:
    """Add the lightmap extensions to a glTF tree. intensity: the light that the map's white stands for."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["attributes"]["TEXCOORD_1"] = primitive["attributes"]["TEXCOORD_0"]
    for material in tree["materials"]:
        texture = material["pbrMetallicRoughness"]["baseColorTexture"]
        texture["texCoord"] = 1
        lightmap = {"index": texture["index"], "texCoord": 1, "intensity": intensity}
        material["extensions"] = {"KHR_materials_unlit": {}, "MOZ_lightmap": lightmap}
    tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", ()), "KHR_materials_unlit", "MOZ_lightmap"})
