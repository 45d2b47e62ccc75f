"""Models as our path tracer shows them, beside Mitsuba 3.

    python -m experiments.studies models_beside SHEET.png MODEL...

Both get the same triangles, normals, textures, sky and sun. Mitsuba's `principled` stands for glTF's material: it has
the same parameters, another diffuse part and other masking, so pictures are alike, not equal. What is printed are
the ratio of the means of both pictures, and how far apart blocks of 16 x 16 pixels are at most.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.camera import Camera
from atra.light import Image, MetallicRoughness, PathRenderer, Scene, Sun, constant_sky, load_scene
from atra.light.pictures.files import srgb_of
from atra.light.textures import linear
from experiments.light.equal_error.measure import block_differences
from experiments.light.mitsuba_light import load_mitsuba, suns_of

_SIDE, _DEPTH = 256, 6
_SKY = 0.8
_SUN = Sun((-0.5, -1.0, -0.6), 0.0, power=0.6)


def shown(path: Path) -> tuple[Scene, Camera]:
    """The model under a plain sky and a sun, seen as a whole."""
    scene = load_scene(path, sky=constant_sky(_SKY))
    scene = Scene(**{**vars(scene), "lights": (_SUN,)})
    return scene, Camera.framing(scene.mesh, fov_y_degrees=30, width=_SIDE, height=_SIDE)


def _texture(mi: Any, image: Image, channels: slice | int, factor: NDArray[np.float64] | float) -> Any:
    texels = linear(image.texels, image.is_coded).astype(np.float64)[..., channels] * factor
    held = np.ascontiguousarray(texels.reshape(*texels.shape[:2], -1), np.float32)
    return mi.load_dict({"type": "bitmap", "bitmap": mi.Bitmap(held), "raw": True})


def _material(mi: Any, one: MetallicRoughness) -> Any:
    made: dict[str, Any] = {"type": "principled", "specular": 0.5, "metallic": one.metallic, "roughness": one.roughness}
    if isinstance(one.colour, Image):
        made["base_color"] = _texture(mi, one.colour, slice(3), np.array(one.colour.factor[:3]))
    else:
        made["base_color"] = {"type": "rgb", "value": list(one.colour)}  # type: ignore[arg-type]
    if one.metallic_roughness is not None:
        made["metallic"] = _texture(mi, one.metallic_roughness, 2, one.metallic)
        made["roughness"] = _texture(mi, one.metallic_roughness, 1, one.roughness)
    made = {"type": "twosided", "bsdf": made}
    if one.normals is not None:
        normal = _texture(mi, one.normals, slice(3), 1.0)
        made = {"type": "normalmap", "normalmap": normal, "bsdf": made}
    if one.alpha == "blend" and not isinstance(one.colour, Image):
        made = {"type": "mask", "opacity": one.opacity, "bsdf": made}
    return mi.load_dict(made)


def of_mitsuba(mi: Any, scene: Scene, camera: Camera, samples: int) -> NDArray[np.float64]:
    """(H, W, 3), Mitsuba's picture."""
    parts: dict[str, Any] = {
        "type": "scene",
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": [_SKY] * 3}},
        "integrator": {"type": "path", "max_depth": _DEPTH},
        "camera": {
            "type": "perspective", "fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": 1e-4,
            "to_world": mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up),
            "film": {"type": "hdrfilm", "width": _SIDE, "height": _SIDE, "rfilter": {"type": "box"}},
        },
    } | suns_of(scene.lights)  # fmt: skip
    for number, material in enumerate(scene.materials):
        assert isinstance(material, MetallicRoughness)
        used, faces = np.unique(scene.mesh.faces[scene.face_materials == number], return_inverse=True)
        properties = mi.Properties()
        properties["bsdf"] = _material(mi, material)
        if any(material.emission):
            glow = material.emission_image
            light = {"type": "rgb", "value": list(material.emission)}
            light = light if glow is None else _texture(mi, glow, slice(3), np.array(material.emission))
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": light})
        mesh = mi.Mesh(
            f"part {number}", len(used), faces.size // 3, props=properties, has_vertex_normals=True,
            has_vertex_texcoords=scene.uv is not None,
        )  # fmt: skip
        given = mi.traverse(mesh)
        given["vertex_positions"] = np.ascontiguousarray(scene.mesh.vertices[used].ravel())
        given["faces"] = faces.ravel().astype(np.uint32)
        assert scene.normals is not None
        given["vertex_normals"] = np.ascontiguousarray(scene.normals[used].ravel())
        if scene.uv is not None:
            downwards = scene.uv[used] * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)
            given["vertex_texcoords"] = np.ascontiguousarray(downwards.ravel())
        given.update()
        parts[f"part{number}"] = mesh
    return np.array(mi.render(mi.load_dict(parts), spp=samples, seed=1), np.float64)[..., :3]


def study(sheet: str, *models: str, samples: int = 64, variant: str = "scalar_rgb") -> None:
    """Draw every model twice, ours first, into one sheet."""
    from PIL import Image as Picture

    mi, _ = load_mitsuba(variant, f"variant={variant}", None)
    rows = []
    for path in map(Path, models):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene, camera = shown(path)
        with PathRenderer(scene, camera, bounces=_DEPTH - 1) as renderer:
            renderer.add(samples)
            own = renderer.image.astype(np.float64)
        theirs = of_mitsuba(mi, scene, camera, samples)
        rows.append(np.concatenate([srgb_of(own.astype(np.float32)), srgb_of(theirs.astype(np.float32))], axis=1))
        apart = block_differences(own, theirs).max()
        name = f"{path.parent.name}/{path.name}"
        print(f"{name}: mean {own.mean() / theirs.mean():.4f} of Mitsuba's, blocks {apart:.2%} apart", flush=True)
        across = 4
        padded = rows + [np.zeros_like(rows[0])] * (-len(rows) % across)
        lines = [np.concatenate(padded[k : k + across], axis=1) for k in range(0, len(padded), across)]
        Picture.fromarray(np.concatenate(lines, axis=0)).save(sheet)
