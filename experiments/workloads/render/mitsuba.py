"""The same pictures by Mitsuba 3: its scene of a scene of ours, and its path integrator."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.parallel import resolve_threads
from atra.render import Dielectric, Emissive, GradientSky, Lambertian, Metal, RenderScene
from atra.render.materials import Material
from experiments.workloads.render import RenderOptions, Rival

_PATHS_AT_ONCE = 1 << 22
"""A wavefront of them is kept in memory."""

_OLDEST_LLVM = 16
"""15 "cannot select" an instruction that Dr.Jit 1.5 asks for, and aborts; 19 was tried, those between were not."""


def material_of(material: Material) -> dict[str, Any]:
    """A material as Mitsuba has it. Raises InputError for one that its plain materials are not: fuzz, textures,
    Schlick's approximation."""

    def colour(value: Any) -> dict[str, Any]:
        return {"type": "rgb", "value": list(value)}

    match material:
        case Lambertian(colour=tuple()):
            return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour(material.colour)}}
        case Metal(fuzz=0.0, colour=tuple()):
            conductor = {"type": "conductor", "material": "none", "specular_reflectance": colour(material.colour)}
            return {"type": "twosided", "bsdf": conductor}
        case Dielectric(fresnel="exact"):
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
        case Emissive():
            return {"type": "diffuse", "reflectance": colour((0, 0, 0))}
    raise InputError(f"Mitsuba 3 has no plain material for {material!r:.100}")


def mitsuba_scene(mi: Any, scene: RenderScene, camera: Camera, max_depth: int) -> Any:
    """A scene of flat triangles and a sky of one colour, in Mitsuba's variant of the moment. Raises InputError for what
    it would show otherwise."""
    sky = scene.sky
    if not isinstance(sky, GradientSky) or sky.below != sky.above or scene.normals is not None:
        raise InputError("Mitsuba 3 is handed flat triangles under a sky of one colour, expected a scene without more")
    parts: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": max_depth, "rr_depth": 10_000},
        "camera": {
            "type": "perspective", "fov": camera.fov_y_degrees, "fov_axis": "y", "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(origin=camera.eye, target=camera.target, up=camera.up),
            "film": {
                "type": "hdrfilm", "width": camera.width, "height": camera.height, "rfilter": {"type": "box"},
                "component_format": "float32",
            },
            "sampler": {"type": "independent"},
        },
    }  # fmt: skip
    if any(sky.above):
        radiance = [sky.power * channel for channel in sky.above]
        parts["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": radiance}}
    for number, material in enumerate(scene.materials):
        faces = scene.mesh.faces[scene.face_materials == number]
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(material_of(material))
        if isinstance(material, Emissive):
            lamp = {"type": "area", "radiance": {"type": "rgb", "value": list(material.colour)}}
            properties["emitter"] = mi.load_dict(lamp)
        used, faces = np.unique(faces, return_inverse=True)
        mesh = mi.Mesh(f"part {number}", len(used), faces.size // 3, props=properties)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ascontiguousarray(scene.mesh.vertices[used].ravel())
        parameters["faces"] = faces.ravel().astype(np.uint32)
        parameters.update()
        parts[f"part{number}"] = mesh
    return mi.load_dict(parts)


def check_llvm(version: str) -> None:
    """Raises InputError for a libLLVM that ends the process when it compiles Mitsuba's path integrator for AVX-512."""
    if int(version.split(".")[0]) < _OLDEST_LLVM:
        raise InputError(
            f"workload.mitsuba=llvm_ad_rgb finds libLLVM {version}, expected {_OLDEST_LLVM} or newer: install one "
            "(Debian: libllvm19) or let DRJIT_LIBLLVM_PATH name its libLLVM.so"
        )


class MitsubaPicture:
    """Pictures by Mitsuba's `path` integrator, a few million paths at a time.

    It aims at the sky and at lamps from every surface, which path tracing here does not, so each of its samples takes
    more rays and has less noise. Scene and camera as for `mitsuba_scene`, threads as for tracers.
    Raises InputError where Mitsuba, or what its variant needs, is missing.
    """

    def __init__(self, scene: RenderScene, camera: Camera, options: RenderOptions, threads: int | None) -> None:
        variant = options.mitsuba.value
        try:
            self._mi, drjit = import_module("mitsuba"), import_module("drjit")
        except ImportError as error:
            raise InputError(f"workload.mitsuba={variant} needs {error.name}; run: pip install -e '.[peers]'") from None
        try:
            self._mi.set_variant(variant)
        except Exception as error:  # whatever Dr.Jit finds wrong with LLVM
            raise InputError(f"workload.mitsuba={variant} cannot be used: {error}") from None
        if options.mitsuba is Rival.llvm_ad_rgb:
            check_llvm(drjit.detail.llvm_version())
        drjit.set_thread_count(resolve_threads(threads))
        self._scene = mitsuba_scene(self._mi, scene, camera, options.max_depth)
        self._most = max(1, _PATHS_AT_ONCE // (camera.width * camera.height))
        self._seed = 0
        self.make(1)

    def make(self, samples: int) -> Any:
        """(H, W, 3) float32, the mean of so many samples, other ones at every call."""
        total: Any = 0.0
        left = samples
        while left:
            count = min(left, self._most)
            image = self._mi.render(self._scene, spp=count, seed=self._seed)
            total = total + count * np.array(image)
            left -= count
            self._seed += 1
        return total / samples
