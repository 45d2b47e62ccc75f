"""The scene of a bake, and what its triangles reflect and emit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.light.checks import checked_rows, set_fields
from atra.light.lightmaps.paint import by_place, means_of, paint_of, plain_opacity
from atra.light.lightmaps.paint_kernels import LARGEST_ALBEDO, OPACITY, Paint, look_up
from atra.light.lights import Light, check_light
from atra.light.materials import Emissive, Material
from atra.light.scattering.diffuse import as_pane
from atra.light.scene import Scene
from atra.light.sky import Sky, constant_sky
from atra.light.textures import Checker, Image

ALBEDO = 0.7
"""Default albedo of triangles without a material."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What triangles do with light: both sides reflect diffusely, fronts may emit.

    albedo: (F, 3) float32, linear RGB in [0, 0.999]. emission: (F, 3) float32, radiance of the front. opacity: (F,)
    float32 in [0, 1], the share of light that a triangle stops and reflects; None: 1. tint: (F, 3) float32 in [0, 1],
    factor on the light that passes straight through; None: 1. scene: of the same faces; where the colour or opacity of
    its materials varies within a triangle, by textures or colours of vertices, light meets that of the place, and
    `albedo` and `opacity` are means; None: nothing varies. Raises InputError for shapes that do not fit, and naming the
    first face with a number outside, or that emits and is not opaque.
    """

    albedo: NDArray[np.float32]
    emission: NDArray[np.float32]
    opacity: NDArray[np.float32] | None = None
    tint: NDArray[np.float32] | None = None
    scene: Scene | None = None

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
        if self.scene is not None and self.scene.mesh.triangle_count != faces:
            raise InputError(f"the scene has {self.scene.mesh.triangle_count} faces, but the albedo has {faces}")

    @property
    def panes(self) -> NDArray[np.bool_]:
        """(F,) bool: triangles that light passes, or passes in places."""
        assert self.opacity is not None
        panes = self.opacity < 1.0
        return panes if self.scene is None else panes | (by_place(self.scene) & OPACITY != 0)

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
        """The surface of a scene's materials: Lambertian and metal by their colour, emitters black and shining.
        Textures and colours of vertices count by place, images of emission by their mean over each triangle. A mask has
        holes; blended surfaces that do not shine let the rest of the light on, and clear glass most of it, straight and
        tinted by its colour."""
        numbers = np.asarray(scene.face_materials)
        clear = [0.0 if any(one.emission) else one.clear_share for one in scene.materials]
        scene = replace(scene, materials=tuple(map(as_pane, scene.materials, clear)))
        albedo = np.array([_plain_albedo(one) for one in scene.materials], np.float32)[numbers]
        emission = np.array([one.emission for one in scene.materials], np.float32)[numbers]
        opacity = np.array([plain_opacity(one) for one in scene.materials], np.float32)[numbers]
        varies = bool(by_place(scene).any())
        if varies:
            means_of(scene, albedo, emission, opacity)
        tint = np.where(np.array(clear)[numbers, None] > 0.0, albedo, np.float32(1.0))
        return cls(albedo, emission, np.minimum(opacity, np.float32(1.0)), tint, scene if varies else None)


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

    @cached_property
    def paint(self) -> Paint | None:
        """Tables of what varies within triangles; None where nothing does. Raises InputError where the surface's scene
        has another number of vertices."""
        assert self.surface is not None
        return None if self.surface.scene is None else paint_of(self.surface.scene, self.mesh)

    def surface_at(
        self, prim_id: NDArray[np.uint32], points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Albedo (N, 3) and opacity (N,), float32, of triangles (N,) at points (N, 3) of theirs; where a point is not
        finite, their means."""
        assert self.surface is not None
        assert self.surface.opacity is not None
        albedo, opacity = self.surface.albedo[prim_id], self.surface.opacity[prim_id]
        if self.paint is not None:
            local = np.ascontiguousarray(points - self.mesh.origin, np.float64)
            look_up(self.paint, prim_id, local, albedo, opacity)
        return albedo, opacity


def plain_scene(scene: BakeScene | Scene) -> BakeScene:
    """The scene itself, or that of plain surfaces which stands for a `Scene`."""
    return scene if isinstance(scene, BakeScene) else BakeScene.of(scene)


def _plain_albedo(material: Material) -> tuple[float, ...]:
    """(3,) albedo of a material of one colour; black for others, whose colours are looked up by place."""
    colour = material.plain
    if isinstance(material, Emissive) or isinstance(colour, Checker | Image):
        return 0.0, 0.0, 0.0
    return tuple(min(one, LARGEST_ALBEDO) for one in colour)
