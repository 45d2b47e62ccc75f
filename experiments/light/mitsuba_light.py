"""Mitsuba 3's light: a variant that can follow paths here, and its parts of a lit scene of ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.view import unit_vector
from atra.light import (
    Dielectric,
    Emissive,
    GradientSky,
    Lambertian,
    Metal,
    MetallicRoughness,
    PanoramaSky,
    Scene,
    Sun,
)
from atra.light.materials import Material
from experiments.methods.peers.mitsuba_scene import INSTALL_LLVM, OLDEST_LLVM

_FINE_ROWS = 256
"""Rows of a panorama for Mitsuba, at least."""


def check_llvm(version: tuple[int, ...], setting: str) -> None:
    """Raises InputError for a libLLVM that ends the process when it compiles Mitsuba's path integrator for AVX-512.
    setting: that asks for it."""
    if version[0] < OLDEST_LLVM:
        told = ".".join(map(str, version))
        raise InputError(f"{setting} finds libLLVM {told}, expected {OLDEST_LLVM} or newer: {INSTALL_LLVM}")


def load_mitsuba(variant: str, setting: str, threads: int | None) -> tuple[Any, Any]:
    """The modules mitsuba, of that variant, and drjit, which has so many threads from now on.

    setting: that asks for it. threads: as for tracers. Raises InputError where Mitsuba, or what its variant needs, is
    missing.
    """
    try:
        mi, drjit = import_module("mitsuba"), import_module("drjit")
    except ImportError as error:
        raise InputError(f"{setting} needs {error.name}; run: pip install -e '.[peers]'") from None
    try:
        mi.set_variant(variant)
    except Exception as error:  # whatever Dr.Jit finds wrong with LLVM
        raise InputError(f"{setting} cannot be used: {error}") from None
    if variant.startswith("llvm"):
        check_llvm(drjit.detail.llvm_version(), setting)
    drjit.set_thread_count(resolve_threads(threads))
    return mi, drjit


def material_of(mi: Any, material: Material) -> Any:
    """A material for `load_dict` in Mitsuba's variant of the moment. Raises InputError for one that its plain materials
    are not: fuzz, coloured textures, Schlick's approximation."""
    match material:
        case Lambertian(colour=tuple()):
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _rgb(material.colour)}}
        case Metal(fuzz=0.0, colour=tuple()):
            conductor = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(material.colour)}
            return {"type": "twosided", "bsdf": conductor}
        case Dielectric(fresnel="exact"):
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
        case MetallicRoughness(metallic=1.0, colour=(1.0, 1.0, 1.0), metallic_roughness=None, normals=None):
            conductor = {"type": "roughconductor", "material": "none", "distribution": "ggx"}
            return {"type": "twosided", "bsdf": conductor | {"alpha": max(material.roughness**2, 1e-3)}}
        case Emissive():
            return {"type": "diffuse", "reflectance": _rgb((0, 0, 0))}
    raise InputError(f"Mitsuba 3 has no plain material for {material!r:.100}")


def parts_of(mi: Any, scene: Scene, bsdf_of: Callable[[Any, Material], Any] = material_of) -> dict[str, Any]:
    """The triangles, lamps and sky of a scene, in Mitsuba's variant of the moment; `load_dict` makes a scene of them.
    bsdf_of: makes a material.

    Raises InputError for what Mitsuba would show otherwise: normals between corners, a sky of two colours.
    """
    sky = scene.sky
    is_gradient = isinstance(sky, GradientSky) and sky.below != sky.above
    if is_gradient or scene.normals is not None:
        raise InputError("Mitsuba 3 is handed flat triangles under a sky of one colour, expected a scene without more")
    parts: dict[str, Any] = {"type": "scene"}
    if isinstance(sky, PanoramaSky):
        parts["sky"] = {"type": "envmap", "bitmap": mi.Bitmap(_environment(sky))}
    elif any(sky.above):
        parts["sky"] = {"type": "constant", "radiance": _rgb([sky.power * channel for channel in sky.above])}
    for number, material in enumerate(scene.materials):
        faces = scene.mesh.faces[scene.face_materials == number]
        properties = mi.Properties()
        bsdf = bsdf_of(mi, material)
        properties["bsdf"] = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
        if isinstance(material, Emissive):
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(material.colour)})
        used, faces = np.unique(faces, return_inverse=True)
        mesh = mi.Mesh(
            f"part {number}", len(used), faces.size // 3, props=properties, has_vertex_texcoords=scene.uv is not None
        )
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ascontiguousarray(scene.mesh.vertices[used].ravel())
        parameters["faces"] = faces.ravel().astype(np.uint32)
        if scene.uv is not None:  # v is counted downwards
            downwards = scene.uv[used] * np.array([1, -1], np.float32) + np.array([0, 1], np.float32)
            parameters["vertex_texcoords"] = np.ascontiguousarray(downwards.ravel())
        parameters.update()
        parts[f"part{number}"] = mesh
    return parts


def mitsuba_scene(mi: Any, scene: Scene, camera: Camera, max_depth: int, roulette: int = 10_000) -> Any:
    """A scene, in Mitsuba's variant of the moment. roulette: rays after which a path may end by chance. Raises
    InputError as `parts_of` does."""
    return mi.load_dict(parts_of(mi, scene) | {
        "integrator": {"type": "path", "max_depth": max_depth, "rr_depth": roulette},
        "camera": {
            "type": "perspective", "fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up),
            "film": {
                "type": "hdrfilm", "width": camera.width, "height": camera.height, "rfilter": {"type": "box"},
                "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        },
    })  # fmt: skip


def _environment(sky: PanoramaSky) -> NDArray[np.float32]:
    """A panorama as Mitsuba has it: the first column is ahead, the first and the last row are at the poles."""
    found = sky.power * sky.texels.astype(np.float64)
    rows, columns = (max(_FINE_ROWS, 2 * count) for count in found.shape[:2])
    down = np.clip(np.arange(rows) / (rows - 1) * len(found) - 0.5, 0, len(found) - 1)
    turn = (np.arange(columns) + 0.5) / columns + 0.5 + sky.rotation_degrees / 360.0
    for axis, place in enumerate((down, turn * found.shape[1] - 0.5)):
        first = np.floor(place).astype(int)
        part = (place - first).reshape((-1, 1) if axis else (-1, 1, 1))
        near, far = (found.take(first + step, axis, mode="wrap") for step in (0, 1))
        found = (1.0 - part) * near + part * far
    return np.ascontiguousarray(found, np.float32)


def suns_of(lights: Sequence[Any]) -> dict[str, Any]:
    """Sharp suns as Mitsuba has them. Raises InputError for another light."""
    for light in lights:
        if not isinstance(light, Sun) or light.angle_degrees:
            raise InputError(f"Mitsuba 3 is handed suns that appear as points, expected no {light!r:.100}")
    return {
        f"sun{number}": {
            "type": "directional",
            "direction": unit_vector("direction of Sun", sun.direction).tolist(),
            "irradiance": _rgb([np.pi * sun.power * channel for channel in sun.colour]),  # ours is over pi
        }
        for number, sun in enumerate(lights)
    }


def _rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": list(value)}
