"""What triangles show where a map holds all their light: albedo, emission and opacity, by place."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.finish.views_kernels import look_into_sky, look_up
from atra.light.scattering.diffuse import shown_of
from atra.light.scene import Scene
from atra.light.surface_kernels import HOLES
from atra.light.tables import surfaces_of
from atra.views.sampling import sub_pixel_offsets

_LOOKUPS, _FEWEST, _MOST = 1 << 18, 16, 1024
"""Places that are looked up for the means of all triangles; least and most of them for a triangle."""


class Shown(NamedTuple):
    """At N places: albedo, (N, 3), the radiance that is emitted, (N, 3), opacity, (N,), and the factor on light that
    passes straight on, (N, 3); float32."""

    albedo: NDArray[np.float32]
    emission: NDArray[np.float32]
    opacity: NDArray[np.float32]
    tint: NDArray[np.float32]


class Look:
    """The look of a scene without any shading: metal has its plain colour, clear glass is a tinted pane.

    panes: (F,) bool, triangles that light passes, or passes in places.
    """

    def __init__(self, scene: Scene) -> None:
        shown = replace(scene, materials=[shown_of(one) for one in scene.materials], normals=None, lights=())
        self._surfaces, self._mesh = surfaces_of(shown, scene.sky.power), scene.mesh
        self._is_clear = np.array([one.clear_share > 0.0 for one in scene.materials])[scene.face_materials]
        self.panes: NDArray[np.bool_] = self._surfaces.flags & HOLES != 0

    def at(self, faces: NDArray[np.integer], points: NDArray[np.floating]) -> Shown:
        """At points, (N, 3) in the world, of triangles, (N,). Black and opaque where a point is not finite."""
        return self._at(faces, np.ascontiguousarray(points - self._mesh.origin, np.float64))

    def _at(self, faces: NDArray[np.integer], points: NDArray[np.float64]) -> Shown:
        count = len(faces)
        albedo, emission = np.zeros((count, 3), np.float32), np.zeros((count, 3), np.float32)
        opacity: NDArray[np.float32] = np.ones(count, np.float32)
        look_up(self._surfaces, np.ascontiguousarray(faces, np.uint32), points, albedo, emission, opacity)
        tint = np.where(self._is_clear[faces, None], albedo, np.float32(1.0))
        return Shown(albedo, emission, opacity, tint)

    def means(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(F, 3) albedo and (F,) opacity, means over the triangles."""
        every = np.arange(self._mesh.triangle_count)
        a, b, c = (self._mesh.local_vertices[self._mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
        varies = len(self._surfaces.weights) > 0
        count = int(np.clip(_LOOKUPS // max(len(every), 1), _FEWEST, _MOST)) if varies else 1
        places = np.asarray(sub_pixel_offsets(count), np.float64)
        albedo, opacity = np.zeros((len(every), 3)), np.zeros(len(every))
        for v, w in np.where(places.sum(axis=1, keepdims=True) <= 1.0, places, 1.0 - places):
            shown = self._at(every, (1.0 - v - w) * a + v * b + w * c)
            albedo += shown.albedo
            opacity += shown.opacity
        return (albedo / count).astype(np.float32), (opacity / count).astype(np.float32)

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
