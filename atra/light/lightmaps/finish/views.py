"""Views of a scene, lit by its lightmap and in plain clay, and what its triangles show where a map holds all light."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.views_kernels import look_into_sky, look_up
from atra.light.lightmaps.priority import start_off
from atra.light.materials import shown_of
from atra.light.scene import Scene
from atra.light.surface_kernels import HOLES
from atra.light.tables import surfaces_of
from atra.rays.scene import RayScene


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


def on_map(
    face: NDArray[np.uint32], u: NDArray[np.float32], v: NDArray[np.float32], atlas: Atlas, image: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(N, C) float32: the map at barycentric weights of N triangles."""
    second, third = (weights.astype(np.float64)[:, None] for weights in (u, v))
    a, b, c = atlas.uv[face].swapaxes(0, 1)
    return interpolated(face, (1.0 - second - third) * a + second * b + third * c, atlas, image)


def interpolated(
    face: NDArray[np.integer], place: NDArray[np.float64], atlas: Atlas, image: NDArray[np.float32]
) -> NDArray[np.float32]:
    """(N, C) float32: an (h, w, C) map at places, (N, 2) in texels, of N triangles; 0 where they are not finite."""
    mapped = np.asarray(np.isfinite(place).all(axis=1))
    rows, columns, *steps = atlas.texels_around(np.where(mapped[:, None], place, 0.0), face)
    fy, fx = (step.astype(np.float32)[:, None] for step in steps)
    upper, lower = ((1.0 - fx) * image[row, columns[0]] + fx * image[row, columns[1]] for row in rows)
    return np.where(mapped[:, None], (1.0 - fy) * upper + fy * lower, np.float32(0.0))


def lit_view(hits: Hits, scene: Scene, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: the view of the hits, lit by an (h, w, 3) map alone; emitting faces show their
    emission, panes what is behind them, and rays that leave the scene its sky. Metal and glass show plain colours."""
    look, hit = look_of(scene), hits.hit
    seen, points = hits.prim_id[hit], hits.points[hit]
    shown = look.at(seen, points)
    light = shown.albedo * on_map(seen, hits.u[hit], hits.v[hit], atlas, image) + shown.emission
    behind = look.panes[seen] & (shown.opacity < 1.0) & np.isfinite(points).all(axis=1)
    ways = hits.camera.rays_world(hits.offset)[1]
    if behind.any():
        share, beyond = shown.opacity[behind, None], _through(scene, atlas, image, points[behind], ways[hit][behind])
        light[behind] = share * light[behind] + (1.0 - share) * shown.tint[behind] * beyond
    view = np.zeros((*hit.shape, 3), np.float32)
    view[hit] = light
    out = ~hit & np.isfinite(ways).all(axis=2)
    view[out] = look.sky_along(ways[out])
    return view


def _through(
    scene: Scene, atlas: Atlas, image: NDArray[np.float32], points: NDArray[np.float32], ways: NDArray[np.float64]
) -> NDArray[np.float32]:
    """(N, 3) float32: what rays that go on from points on panes show."""
    look, off = look_of(scene), start_off(scene.mesh)
    total, passed = np.zeros((len(points), 3), np.float32), np.ones((len(points), 3), np.float32)
    left = np.arange(len(points))
    with RayScene(scene.mesh) as rays_scene:
        while len(left):
            found = rays_scene.intersect(points, ways[left], tnear=off / np.linalg.norm(ways[left], axis=1))
            out = left[~found.hit]
            total[out] += passed[out] * look.sky_along(ways[out])
            hit = found.hit & np.isfinite(found.u)
            left, face = left[hit], found.prim_id[hit]
            points = (found.rays.origins + found.t[:, None] * found.rays.directions)[hit]
            shown = look.at(face, points)
            light = shown.albedo * on_map(face, found.u[hit], found.v[hit], atlas, image) + shown.emission
            total[left] += passed[left] * shown.opacity[:, None] * light
            passed[left] *= (1.0 - shown.opacity[:, None]) * shown.tint
            on = shown.opacity < 1.0
            left, points = left[on], points[on]
    return total


def clay_view(hits: Hits) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: grey, brighter where a face turns to the view."""
    facing = np.abs((np.nan_to_num(hits.normals) * hits.camera.axes[2]).sum(axis=2, keepdims=True))
    grey = np.where(hits.hit[..., None], 0.15 + 0.6 * facing, 0.0)
    return np.asarray(np.repeat(grey, 3, axis=2), np.float32)
