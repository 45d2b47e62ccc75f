"""The scene of a bake, and what its triangles reflect and emit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.sampling import sub_pixel_offsets
from atra.light.checks import checked_rows, set_fields
from atra.light.lights import Light, check_light
from atra.light.materials import Emissive, images_of
from atra.light.scene import Scene
from atra.light.sky import Sky, constant_sky
from atra.light.textures import Checker, Image, Texture

ALBEDO = 0.7
"""Default albedo of triangles without a material."""

LARGEST_ALBEDO = 0.999
"""Largest albedo; with 1, light would bounce forever."""

_LOOKUPS, _FEWEST, _MOST = 1 << 18, 16, 1024
"""Texels that are looked up for a material; least and most of them for a triangle."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What triangles do with light: both sides reflect diffusely, fronts may emit.

    albedo: (F, 3) float32, linear RGB in [0, 0.999]. emission: (F, 3) float32, radiance of the front. opacity: (F,)
    float32 in [0, 1], the share of light that a triangle stops and reflects; None: 1. tint: (F, 3) float32 in [0, 1],
    factor on the light that passes straight through; None: 1. Raises InputError for shapes that do not fit, and naming
    the first face with a number outside, or that emits and is not opaque.
    """

    albedo: NDArray[np.float32]
    emission: NDArray[np.float32]
    opacity: NDArray[np.float32] | None = None
    tint: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        faces = len(np.atleast_1d(self.albedo))
        for name, shape, high in (
            ("albedo", (faces, 3), LARGEST_ALBEDO), ("emission", (faces, 3), 1e12), ("opacity", (faces,), 1.0),
            ("tint", (faces, 3), 1.0),
        ):  # fmt: skip
            given = getattr(self, name)
            rows = checked_rows(name, np.ones(shape) if given is None else given, shape, "face", 0.0, high)
            object.__setattr__(self, name, rows)
        assert self.opacity is not None
        wrong = (self.opacity < 1.0) & (self.emission > 0.0).any(axis=1)
        if wrong.any():
            face = int(np.argmax(wrong))
            raise InputError(f"face {face} shines, but its opacity is {self.opacity[face]:g}, expected 1")

    @property
    def panes(self) -> NDArray[np.bool_]:
        """(F,) bool: triangles that light passes."""
        assert self.opacity is not None
        return self.opacity < 1.0

    @classmethod
    def plain(cls, mesh: Mesh, albedo: ArrayLike = ALBEDO, emission: ArrayLike = 0.0) -> Surface:
        """One albedo and emission for all triangles, (3,), or one each, (F, 3)."""
        shape = mesh.triangle_count, 3
        try:
            return cls(np.broadcast_to(albedo, shape), np.broadcast_to(emission, shape))  # type: ignore[arg-type]
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"colours cannot be spread over {shape[0]} faces: {error}") from None

    @classmethod
    def of(cls, scene: Scene) -> Surface:
        """The surface of a scene's materials: Lambertian and metal by their colour, glass as white as possible,
        emitters black and shining; each triangle by the mean of its textures over it."""
        albedo = np.zeros((scene.mesh.triangle_count, 3), np.float32)
        emission = np.zeros_like(albedo)
        numbers = np.asarray(scene.face_materials)
        for number, material in enumerate(scene.materials):
            faces = np.flatnonzero(numbers == number)
            if any(material.emission):
                emission[faces] = material.emission
                image = images_of(material)[3]
                if image is not None:
                    emission[faces] *= _colours(image, scene, faces)
            if not isinstance(material, Emissive):
                albedo[faces] = np.minimum(_colours(material.plain, scene, faces), LARGEST_ALBEDO)
        return cls(albedo, emission)


@dataclass(frozen=True, eq=False)
class BakeScene:
    """A mesh, its surface, lights and sky. Units are those of `atra.light`: a white surface that faces a sun of power
    1, or the whole of a sky of radiance 1, reflects 1.

    mesh: the triangles. surface: what they reflect and emit; None: `Surface.plain`. lights: of `atra.light`. sky: black
    by default.
    """

    mesh: Mesh
    surface: Surface | None = None
    lights: Sequence[Light] = ()
    sky: Sky = constant_sky(0.0)

    def __post_init__(self) -> None:
        if not isinstance(self.mesh, Mesh):
            raise InputError(f"mesh is {self.mesh!r:.100}, expected atra.Mesh")
        if not isinstance(self.sky, Sky):
            raise InputError(f"sky is {self.sky!r:.100}, expected GradientSky or PanoramaSky")
        surface = Surface.plain(self.mesh) if self.surface is None else self.surface
        if len(surface.albedo) != self.mesh.triangle_count:
            raise InputError(f"surface has {len(surface.albedo)} faces, but {self.mesh!r} is to be lit")
        lights = tuple(self.lights)
        for light in lights:
            check_light(light)
        set_fields(self, surface=surface, lights=lights)

    @classmethod
    def of(cls, scene: Scene) -> BakeScene:
        """The same triangles, materials, lights and sky; shading normals are ignored."""
        return cls(scene.mesh, Surface.of(scene), scene.lights, scene.sky)


def _colours(colour: Texture, scene: Scene, faces: NDArray[np.int64]) -> NDArray[np.float32]:
    """(N, 3) means over triangles."""
    if not isinstance(colour, Checker | Image):
        return np.broadcast_to(np.array(colour, np.float32), (len(faces), 3))
    known = scene.second_uv if isinstance(colour, Image) and colour.second_uv else scene.uv
    assert known is not None
    a, b, c = known[scene.mesh.faces[faces]].astype(np.float64).transpose(1, 0, 2)
    points = sub_pixel_offsets(int(np.clip(_LOOKUPS // max(len(faces), 1), _FEWEST, _MOST))).tolist()
    total = np.zeros((len(faces), 3))
    for x, y in points:
        v, w = (x, y) if x + y <= 1.0 else (1.0 - x, 1.0 - y)
        total += _colours_at(colour, a + v * (b - a) + w * (c - a))
    return (total / len(points)).astype(np.float32)


def _colours_at(colour: Checker | Image, uv: NDArray[np.float64]) -> NDArray[np.float32]:
    if isinstance(colour, Image):
        return colour.at(uv)[:, :3]
    u, v = uv.T
    odd = (np.floor(u * colour.scale) + np.floor(v * colour.scale)) % 2
    return np.where(odd[:, None] == 1, colour.second, colour.first).astype(np.float32)
