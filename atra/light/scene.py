"""A scene to render: triangles, materials, lights and sky."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import as_vector
from atra.geometry.view import View
from atra.light.checks import checked_rows, set_fields
from atra.light.lights import Light, Sun
from atra.light.materials import Lambertian, Material
from atra.light.sky import GradientSky, Sky
from atra.light.textures import Checker, Texture


class ScenePart(NamedTuple):
    """A primitive of a file, as a node places it: whole runs of a scene's faces and vertices.

    node, mesh, primitive: their numbers in the file, from 0; -1 where the format has none. name: of the node.
    """

    name: str
    node: int
    mesh: int
    primitive: int
    first_face: int
    faces: int
    first_vertex: int
    vertices: int


@dataclass(frozen=True, eq=False)
class Scene:
    """Triangles, materials, lights, sky and cameras; all arrays are private read-only copies.

    mesh: the triangles. materials: from `atra.light.materials`. face_materials: (F,) integers, the material of each
    triangle; None: the first for all. lights: of `atra.light`. sky: the background and its light. normals: (V, 3)
    shading normals, non-zero, towards the front; None: flat triangles. uv: (V, 2) float32, for materials with a
    `Checker` or an `Image`; second_uv: as uv, for images that name it. colours: (V, 4) float32 in [0, 1], linear RGB
    and opacity, which multiply those of a `MetallicRoughness`. None: there are none. cameras: by name. parts: of the
    file it was read from. left_out: what the file has, but the scene has not, by name.

    Raises InputError for shapes that do not fit the mesh, unknown materials (first face named), vertices' numbers that
    are not finite (first vertex named), and a texture without uv.

    Examples
    --------
    >>> import atra
    >>> from atra import light
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> scene = light.Scene(mesh, [light.Lambertian((0.7, 0.6, 0.5))], lights=[light.Sun((0, 0, -1))])
    >>> len(scene.lights)
    1
    """

    mesh: Mesh
    materials: Sequence[Material] = (Lambertian(),)
    face_materials: NDArray[np.int32] | None = None
    lights: Sequence[Light] = ()
    sky: Sky = GradientSky()
    normals: NDArray[np.float32] | None = None
    uv: NDArray[np.float32] | None = None
    second_uv: NDArray[np.float32] | None = None
    colours: NDArray[np.float32] | None = None
    cameras: Mapping[str, View] = field(default_factory=dict)
    parts: Sequence[ScenePart] = ()
    left_out: Sequence[str] = ()

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
            if not isinstance(light, Light):
                raise InputError(f"a light is {light!r:.100}, expected Sun, PointLight, SphereLight or SpotLight")
        numbers = _checked_numbers(self.face_materials, self.mesh.triangle_count, len(materials))
        vertices = len(self.mesh.vertices)
        rows: dict[str, NDArray[np.float32] | None] = {}
        for name, what, size, low, high in (
            ("normals", "normal", 3, -1e6, 1e6), ("uv", "uv", 2, -1e6, 1e6), ("second_uv", "second uv", 2, -1e6, 1e6),
            ("colours", "colour", 4, 0.0, 1.0),
        ):  # fmt: skip
            given = getattr(self, name)
            rows[name] = None if given is None else checked_rows(what, given, (vertices, size), "vertex", low, high)
        normals = rows["normals"]
        if normals is not None and not (zero := np.abs(normals).max(axis=1) > 1e-6).all():
            raise InputError(f"the normal of vertex {int(np.argmin(zero))} is zero, expected a direction")
        for number, one in enumerate(materials):
            if self.uv is None and (isinstance(one.colour, Checker) or any(one.images)):
                raise InputError(f"material {number} has a texture, expected uv of the vertices, but uv is None")
            if self.second_uv is None and any(image is not None and image.second_uv for image in one.images):
                raise InputError(f"material {number} has a texture over second_uv, but second_uv is None")
        set_fields(self, materials=materials, lights=lights, face_materials=numbers, **rows)
        set_fields(self, cameras=dict(self.cameras), parts=tuple(self.parts), left_out=tuple(self.left_out))

    @property
    def local(self) -> Self:
        """The scene with its mesh's origin moved to that of the world, lights along with it, cameras not; itself where
        the mesh has none."""
        if not self.mesh.has_origin:
            return self
        moved = copy(self)
        lights = tuple(
            light
            if isinstance(light, Sun)
            else replace(light, position=as_vector(np.subtract(light.position, self.mesh.origin)))
            for light in self.lights
        )
        set_fields(moved, mesh=self.mesh.local, lights=lights, cameras={})
        return moved

    @classmethod
    def plain(cls, mesh: Mesh, albedo: Texture = 0.7, **others: Any) -> Self:  # type: ignore[assignment]
        """A mesh of one diffuse colour. albedo: in [0, 1], linear RGB, or one number for a grey. others: further fields
        of the class. Raises InputError as they do."""
        return cls(mesh, (Lambertian(albedo),), **others)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Copied and unpickled arrays are writable, even if the original was not.
        self.__dict__.update(state)
        for array in (self.face_materials, self.normals, self.uv, self.second_uv, self.colours):
            if array is not None:
                array.setflags(write=False)


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
