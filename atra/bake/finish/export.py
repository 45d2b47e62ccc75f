"""Files of a lightmap: EXR to be worked with, PNG to be looked at, and a model that opens elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.bake.finish.seams import Seams, dilated
from atra.bake.maps import LIGHTS, Lightmap
from atra.bake.surface import BakeScene
from atra.errors import InputError
from atra.files import write_atomically
from atra.render.pictures import exr_of_channels, png_of, srgb_of

_BRIGHT = 0.99
"""Of texels are shown no brighter than white."""


def finished(lightmap: Lightmap, values: NDArray[np.float32], seams: Seams | None = None) -> NDArray[np.float32]:
    """(H, W, C): (N, C) values with gutters filled, and with seams that match, where they are given."""
    image = dilated(lightmap.texels, values, lightmap.valid)
    return image if seams is None else seams.stitched(image)


def exposure_of(lightmap: Lightmap) -> float:
    """What light is multiplied by to be shown."""
    lit = lightmap.luminance[lightmap.valid]
    bright = float(np.quantile(lit, _BRIGHT)) if len(lit) else 0.0
    return 1.0 / bright if bright > 0.0 else 1.0


def save_maps(
    lightmap: Lightmap, folder: Path, *, stitch: bool = True, visible: NDArray[np.bool_] | None = None
) -> list[Path]:
    """Write every kind of light and openness as EXR, linear, and PNG, and occupancy and charts as PNG; what was
    written.

    stitch: whether seams are made to match. visible: (N,) bool, what a view shows, is written, too.
    Raises InputError without the package OpenEXR, StorageError.
    """
    texels = lightmap.texels
    seams = Seams.of(texels.mesh, texels.atlas) if stitch else None
    exposure = exposure_of(lightmap)
    files: dict[str, bytes] = {}
    for name in LIGHTS:
        image = finished(lightmap, lightmap.light(name), seams)
        files[f"{name}.exr"] = exr_of_channels({channel: image[..., k] for k, channel in enumerate("RGB")})
        files[f"{name}.png"] = png_of(exposure * image)
    openness = finished(lightmap, lightmap.openness[:, None])[..., 0]
    files["openness.exr"], files["openness.png"] = exr_of_channels({"Y": openness}), _grey(openness)
    files["occupancy.png"] = _grey(texels.occupied.astype(float))
    if visible is not None:
        files["culling_map.png"] = _grey(texels.image(0.2 + 0.8 * visible))
    files["charts.png"] = png_of(texels.image(chart_colours(texels.chart)))
    for name, content in files.items():
        write_atomically(folder / name, content)
    return [folder / name for name in files]


def _grey(image: NDArray[np.floating]) -> bytes:
    return png_of(np.repeat(image[..., None], 3, axis=2))


def chart_colours(chart: NDArray[np.integer]) -> NDArray[np.float64]:
    """(N, 3), a colour of its own for each."""
    turns = np.asarray(chart, np.float64)[:, None] * 0.618034 + (0.0, 1 / 3, 2 / 3)
    return 0.5 + 0.4 * np.cos(2.0 * np.pi * turns)


def save_model(lightmap: Lightmap, scene: BakeScene, path: Path, *, stitch: bool = True) -> Path:
    """Write the mesh as binary glTF with its light, which viewers show as it is (KHR_materials_unlit).

    The map is the base colour, by TEXCOORD_0 and the same as TEXCOORD_1, and MOZ_lightmap for those that know it; the
    albedo is the colour of the corners. Raises InputError for another suffix, StorageError.
    """
    if path.suffix.lower() != ".glb":
        raise InputError(f"a model is to be written to {str(path)!r}, expected a name that ends in .glb")
    import trimesh
    from PIL import Image

    mesh, atlas = lightmap.texels.mesh, lightmap.texels.atlas
    assert scene.surface is not None
    seams = Seams.of(mesh, atlas) if stitch else None
    exposure = exposure_of(lightmap)
    image = Image.fromarray(srgb_of(exposure * finished(lightmap, lightmap.combined, seams)), "RGB")
    mapped = np.isfinite(atlas.uv).all(axis=(1, 2))
    corners = mesh.vertices[mesh.faces[mapped]].reshape(-1, 3)
    uv = atlas.uv[mapped].reshape(-1, 2) / (atlas.width, atlas.height)
    uv[:, 1] = 1.0 - uv[:, 1]
    whole = np.clip(np.rint(255.0 * scene.surface.albedo[mapped]), 0, 255).astype(np.uint8)
    colours = np.repeat(np.column_stack([whole, np.full(len(whole), 255, np.uint8)]), 3, axis=0)
    material = trimesh.visual.material.PBRMaterial(
        name="lightmap", baseColorTexture=image, metallicFactor=0.0, roughnessFactor=1.0, doubleSided=True
    )
    visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    visual.vertex_attributes["color"] = colours
    faces = np.arange(len(corners)).reshape(-1, 3)
    model = trimesh.Trimesh(corners, faces, visual=visual, process=False)
    content = trimesh.Scene({"scene": model}).export(
        file_type="glb", tree_postprocessor=lambda tree: _mark_as_lightmap(tree, 1.0 / exposure)
    )
    write_atomically(path, content)
    return path


def _mark_as_lightmap(tree: dict[str, Any], intensity: float) -> None:
    """intensity: what the map's white stands for."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive["attributes"]["TEXCOORD_1"] = primitive["attributes"]["TEXCOORD_0"]
    for material in tree["materials"]:
        texture = material["pbrMetallicRoughness"]["baseColorTexture"]
        texture["texCoord"] = 1
        lightmap = {"index": texture["index"], "texCoord": 1, "intensity": intensity}
        material["extensions"] = {"KHR_materials_unlit": {}, "MOZ_lightmap": lightmap}
    tree["extensionsUsed"] = sorted({*tree.get("extensionsUsed", ()), "KHR_materials_unlit", "MOZ_lightmap"})
