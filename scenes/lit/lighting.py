"""Light for any scene: its own materials where it has some, and else grey triangles, a sun and a sky."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.light import GradientSky, Lambertian, Scene, Sun
from scenes.lit.interiors import lit_atrium, lit_living_room
from scenes.lit.rooms import lit_cornell_box
from scenes.lit.weekend import weekend

WITH_MATERIALS: dict[str, Callable[[], Scene]] = {
    "cornell_box": lit_cornell_box,
    "weekend": weekend,
    "living_room": lit_living_room,
    "atrium": lit_atrium,
}
"""Built-in scenes that have materials of their own, by name."""

_GREY = Lambertian((0.7, 0.7, 0.7))
_FORWARD, _RIGHT = 0.5, 0.3


def lit(name: str, mesh: Mesh, camera: Camera) -> Scene:
    """A scene to be shown, of the mesh of the scene called `name`.

    Without materials of its own, or with a mesh that was subdivided or copied, it is grey, under the sky of "Ray
    Tracing in One Weekend" and a sun behind the camera's left shoulder, 60 degrees high or so: that reaches into rooms
    through where they are looked into.
    """
    own = _with_materials(name)
    if own is not None and own.mesh.triangle_count == mesh.triangle_count:
        return replace(own, mesh=mesh)
    right, down, forward = camera.axes
    x, y, z = (down + _FORWARD * forward + _RIGHT * right).tolist()
    return Scene(mesh, [_GREY], lights=[Sun((x, y, z))], sky=GradientSky())


@cache
def _with_materials(name: str) -> Scene | None:
    """The scene of `WITH_MATERIALS`, made once; None for other names."""
    made = WITH_MATERIALS.get(name)
    return None if made is None else made()


def length_of(mesh: Mesh, part: float) -> float:
    """That part of the diagonal of the mesh's box, in scene units."""
    return float(part * np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
