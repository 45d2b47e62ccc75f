"""Light for any scene: its own materials where it has some, and else grey triangles, a sun and a sky."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.light import GradientSky, Lambertian, RenderScene, Sun
from scenes.lit.weekend import weekend

WITH_MATERIALS: dict[str, Callable[[], RenderScene]] = {"weekend": weekend}
"""Built-in scenes that have materials of their own, by name."""

_GREY = Lambertian((0.7, 0.7, 0.7))
_FORWARD, _RIGHT = 0.5, 0.3


def lit(name: str, mesh: Mesh, camera: Camera) -> RenderScene:
    """A scene to be shown, of the mesh of the scene called `name`.

    Without materials of its own it is grey, under the sky of "Ray Tracing in One Weekend" and a sun behind the camera's
    left shoulder, 60 degrees high or so: that reaches into rooms through where they are looked into.
    Raises InputError for a mesh that is not that of a scene with materials, such as one that was subdivided.
    """
    made = WITH_MATERIALS.get(name)
    if made is not None:
        own = made()
        if own.mesh.triangle_count != mesh.triangle_count:
            raise InputError(
                f"{name} has materials for {own.mesh.triangle_count:,} triangles, but the mesh has "
                f"{mesh.triangle_count:,}; neither subdivide nor copy it"
            )
        return replace(own, mesh=mesh)
    right, down, forward = camera.axes
    x, y, z = (down + _FORWARD * forward + _RIGHT * right).tolist()
    return RenderScene(mesh, [_GREY], lights=[Sun((x, y, z))], sky=GradientSky())


def length_of(mesh: Mesh, part: float) -> float:
    """That part of the diagonal of the mesh's box, in scene units."""
    return float(part * np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
