"""Views of a scene: lit by its lightmap, and in plain clay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.looks import look_of
from atra.light.lightmaps.priority import start_off
from atra.light.scene import Scene
from atra.rays.scene import RayScene


def looked_up(hits: Hits, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, C) float32: an (h, w, C) map, interpolated at the hits; 0 without a hit or a place on the map."""
    shown = np.zeros((*hits.depth.shape, image.shape[2]), np.float32)
    hit = hits.hit
    shown[hit] = _on_map(hits.prim_id[hit], hits.u[hit], hits.v[hit], atlas, image)
    return shown


def _on_map(
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
    light = shown.albedo * _on_map(seen, hits.u[hit], hits.v[hit], atlas, image) + shown.emission
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
            light = shown.albedo * _on_map(face, found.u[hit], found.v[hit], atlas, image) + shown.emission
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
