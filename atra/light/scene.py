"""A scene to render: triangles, materials, lights and sky."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.light.checks import checked_rows, set_fields
from atra.light.lights import Light, check_light
from atra.light.materials import Lambertian, Material, base_colour, needs_uv
from atra.light.sky import GradientSky, Sky


@dataclass(frozen=True, eq=False)
class RenderScene:
    """Triangles, materials, lights and sky; all arrays are private read-only copies.

    mesh: the triangles. materials: from `atra.light.materials`. face_materials: (F,) integers, the material of each
    triangle; None: the first for all. lights: for hybrid rendering; path tracing finds light only in the sky and at
    `Emissive`. sky: the background and its light. normals: (V, 3) shading normals, non-zero, towards the front; None:
    flat triangles. uv: (V, 2) float32, for materials with a `Checker` or an `Image`; None: there is none. Raises
    InputError for shapes that do not fit the mesh, unknown materials (first face named), normals and uv that are not
    finite (first vertex named), and a texture without uv.
    """

    mesh: Mesh
    materials: Sequence[Material] = (Lambertian(),)
    face_materials: NDArray[np.int32] | None = None
    lights: Sequence[Light] = ()
    sky: Sky = GradientSky()
    normals: NDArray[np.float32] | None = None
    uv: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, Mesh):
            raise InputError(f"mesh is {self.mesh!r:.100}, expected atra.Mesh")
        if not isinstance(self.sky, Sky):
            raise InputError(f"sky is {self.sky!r:.100}, expected GradientSky or PanoramaSky")
        materials, lights = _listed("materials", self.materials), _listed("lights", self.lights)
        for number, material in enumerate(materials):
            if not isinstance(material, Material):
                raise InputError(f"material {number} is {material!r:.100}, expected one of atra.light's materials")
        for light in lights:
            check_light(light)
        numbers = _checked_numbers(self.face_materials, self.mesh.triangle_count, len(materials))
        normals, uv = (
            None if given is None else checked_rows(name, given, (len(self.mesh.vertices), size), "vertex", -1e6, 1e6)
            for name, given, size in (("normal", self.normals, 3), ("uv", self.uv, 2))
        )
        if normals is not None and not (zero := np.abs(normals).max(axis=1) > 1e-6).all():
            raise InputError(f"the normal of vertex {int(np.argmin(zero))} is zero, expected a direction")
        textured = next((number for number, one in enumerate(materials) if needs_uv(one)), None)
        if uv is None and textured is not None:
            raise InputError(f"material {textured} has a texture, expected uv of the vertices, but uv is None")
        set_fields(self, materials=materials, lights=lights, face_materials=numbers, normals=normals, uv=uv)

    @classmethod
    def from_trimesh(cls, loaded: Any, **others: Any) -> Self:
        """The triangles, uv and base colours of what `trimesh.load` returns, for example for glTF. Each material
        becomes a `Lambertian` of its base colour and texture; its other properties are ignored.

        loaded: a `trimesh.Trimesh` or `trimesh.Scene`; a scene's meshes are concatenated. others: further fields of the
        class. Raises InputError for anything else, for no triangles, and as `Mesh` and `Image` do.
        """
        parts = loaded.dump() if hasattr(loaded, "dump") else [loaded]
        parts = [part for part in parts if len(getattr(part, "faces", ()))]
        if not parts:
            raise InputError(f"loaded is {loaded!r:.100}, expected a trimesh.Trimesh or trimesh.Scene with triangles")
        firsts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        faces = np.concatenate([part.faces + first for part, first in zip(parts, firsts, strict=False)])
        numbers = np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.faces) for part in parts])
        known = [_uv_of(part) for part in parts]
        uv = [np.zeros((len(part.vertices), 2)) if one is None else one for part, one in zip(parts, known, strict=True)]
        materials = [
            base_colour(getattr(part.visual, "material", None), one is not None)
            for part, one in zip(parts, known, strict=True)
        ]
        return cls(
            Mesh(np.concatenate([part.vertices for part in parts]), faces),
            materials,
            numbers,
            uv=np.concatenate(uv),
            **others,
        )

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Copied and unpickled arrays are writable, even if the original was not.
        self.__dict__.update(state)
        for array in (self.face_materials, self.normals, self.uv):
            if array is not None:
                array.setflags(write=False)


def _uv_of(part: Any) -> NDArray[np.float64] | None:
    """(V, 2) of a `trimesh.Trimesh`, or None."""
    uv = getattr(part.visual, "uv", None)
    return None if uv is None or len(uv) != len(part.vertices) else np.asarray(uv)[:, :2]


def _listed(name: str, given: Any) -> tuple[Any, ...]:
    if isinstance(given, str | bytes) or not isinstance(given, Iterable):
        raise InputError(f"{name} are {given!r:.100}, expected a list of them")
    return tuple(given)


def _checked_numbers(given: ArrayLike | None, faces: int, materials: int) -> NDArray[np.int32]:
    if materials == 0:
        raise InputError("there are no materials, expected at least one")
    try:
        numbers = np.zeros(faces, np.int32) if given is None else np.asarray(given)
    except ValueError as error:
        raise InputError(f"face_materials cannot be read as an array: {error}") from None
    if numbers.shape != (faces,) or numbers.dtype.kind not in "iu":
        raise InputError(
            f"face_materials is {numbers.dtype} of {numbers.shape}, expected whole numbers of ({faces},), one per face"
        )
    wrong = (numbers < 0) | (numbers >= materials)
    if wrong.any():
        face = int(np.argmax(wrong))
        raise InputError(f"face {face} is made of material {numbers[face]}, but there are {materials}, counted from 0")
    numbers = numbers.astype(np.int32)
    numbers.setflags(write=False)
    return numbers
