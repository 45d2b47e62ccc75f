"""What triangles show where a map holds all their light: albedo, emission and opacity, by place."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.finish.views_kernels import look_into_sky, look_up
from atra.light.materials import shown_of
from atra.light.scene import Scene
from atra.light.surface_kernels import HOLES
from atra.light.tables import surfaces_of


class Shown(NamedTuple):
    """At N places: albedo, (N, 3), the radiance that is emitted, (N, 3), opacity, (N,), and the factor on light that
    passes straight on, (N, 3); float32."""

    albedo: NDArray[np.float32]
    emission: NDArray[np.float32]
    opacity: NDArray[np.float32]
    tint: NDArray[np.float32]


class Look:
    """The look of a scene without any shading: metal has its plain colour, clear glass is a tinted pane.

    panes: (F,) bool, triangles that light passes, or passes in places. varies: whether colours differ within triangles.
    """

    def __init__(self, scene: Scene) -> None:
        shown = replace(scene, materials=[shown_of(one) for one in scene.materials], normals=None, lights=())
        self._surfaces, self._mesh = surfaces_of(shown, scene.sky.power), scene.mesh
        self._is_clear = np.array([one.clear_share > 0.0 for one in scene.materials])[scene.face_materials]
        self.panes: NDArray[np.bool_] = self._surfaces.flags & HOLES != 0
        self.varies = len(self._surfaces.weights) > 0

    def at(self, faces: NDArray[np.integer], points: NDArray[np.floating]) -> Shown:
        """At points, (N, 3) in the world, of triangles, (N,). Black and opaque where a point is not finite."""
        count, points = len(faces), np.ascontiguousarray(points - self._mesh.origin, np.float64)
        albedo, emission = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
        opacity: NDArray[np.float32] = np.ones(count, np.float32)
        look_up(self._surfaces, np.ascontiguousarray(faces, np.uint32), points, albedo, emission, opacity)
        tint = np.where(self._is_clear[faces, None], albedo, np.float32(1.0))
        return Shown(albedo, emission, opacity, tint)

    def sky_along(self, ways: NDArray[np.float64]) -> NDArray[np.float32]:
        """(N, 3) float32: radiance of the sky along vectors of any length."""
        ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
        colours = np.zeros((len(ways), 3), np.float32)
        look_into_sky(self._surfaces, ways.astype(np.float32), colours)
        return colours


_LOOKS: WeakKeyDictionary[Scene, Look] = WeakKeyDictionary()


def look_of(scene: Scene) -> Look:
    """The look of a scene, made once."""
    if scene not in _LOOKS:
        _LOOKS[scene] = Look(scene)
    return _LOOKS[scene]
