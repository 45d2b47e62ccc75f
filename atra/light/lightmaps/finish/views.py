"""Views of a scene: lit by its lightmap, and in plain clay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits, read_only
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.finish.views_kernels import SkyTables, look_into_sky
from atra.light.lightmaps.gather.tables import start_off
from atra.light.lightmaps.surface import BakeScene, plain_scene
from atra.light.scene import Scene
from atra.light.sky import Sky
from atra.light.tables import sky_tables
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
    place = (1.0 - second - third) * a + second * b + third * c
    mapped = np.isfinite(place).all(axis=1)
    rows, columns, *steps = atlas.texels_around(np.where(mapped[:, None], place, 0.0), face)
    fy, fx = (step.astype(np.float32)[:, None] for step in steps)
    upper, lower = ((1.0 - fx) * image[row, columns[0]] + fx * image[row, columns[1]] for row in rows)
    return np.where(mapped[:, None], (1.0 - fy) * upper + fy * lower, np.float32(0.0))


def lit_view(hits: Hits, scene: BakeScene | Scene, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: the view of the hits, lit by an (h, w, 3) map alone; emitting faces show their
    emission, panes what is behind them, and rays that leave the scene its sky."""
    scene, hit = plain_scene(scene), hits.hit
    assert scene.surface is not None
    seen, points = hits.prim_id[hit], hits.points[hit]
    light, opacity = _shown(scene, seen, points, _on_map(seen, hits.u[hit], hits.v[hit], atlas, image))
    behind = scene.surface.panes[seen] & (opacity < 1.0) & np.isfinite(points).all(axis=1)
    ways = hits.camera.rays_world(hits.offset)[1]
    if behind.any():
        share, beyond = opacity[behind, None], _through(scene, atlas, image, points[behind], ways[hit][behind])
        light[behind] = share * light[behind] + (1.0 - share) * scene.surface.tint[seen[behind]] * beyond  # type: ignore[index]
    view = np.zeros((*hit.shape, 3), np.float32)
    view[hit] = light
    out = ~hit & np.isfinite(ways).all(axis=2)
    view[out] = _sky_along(scene.sky, ways[out])
    return view


def _shown(
    scene: BakeScene, face: NDArray[np.uint32], points: NDArray[np.float32], light: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(N, 3) what triangles show at points where the map has (N, 3) `light`, and their opacity there."""
    assert scene.surface is not None
    albedo, opacity = scene.surface_at(face, points)
    return albedo * light + scene.surface.emission[face], opacity


def _through(
    scene: BakeScene, atlas: Atlas, image: NDArray[np.float32], points: NDArray[np.float32], ways: NDArray[np.float64]
) -> NDArray[np.float32]:
    """(N, 3) float32: what rays that go on from points on panes show."""
    surface, off = scene.surface, start_off(scene.mesh)
    assert surface is not None
    shown, passed = np.zeros((len(points), 3), np.float32), np.ones((len(points), 3), np.float32)
    left = np.arange(len(points))
    with RayScene(scene.mesh) as rays_scene:
        while len(left):
            found = rays_scene.intersect(points, ways[left], tnear=off / np.linalg.norm(ways[left], axis=1))
            out = left[~found.hit]
            shown[out] += passed[out] * _sky_along(scene.sky, ways[out])
            hit = found.hit & np.isfinite(found.u)
            left, face = left[hit], found.prim_id[hit]
            points = (found.rays.origins + found.t[:, None] * found.rays.directions)[hit]
            light, opacity = _shown(scene, face, points, _on_map(face, found.u[hit], found.v[hit], atlas, image))
            shown[left] += passed[left] * opacity[:, None] * light
            passed[left] *= (1.0 - opacity[:, None]) * surface.tint[face]  # type: ignore[index]
            on = opacity < 1.0
            left, points = left[on], points[on]
    return shown


def _sky_along(sky: Sky, ways: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, 3) float32: radiance of the sky along vectors of any length."""
    ways = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    colours = np.zeros((len(ways), 3), np.float32)
    look_into_sky(SkyTables(*map(read_only, sky_tables(sky, sky.power))), ways.astype(np.float32), colours)
    return colours


def clay_view(hits: Hits) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: grey, brighter where a face turns to the view."""
    facing = np.abs((np.nan_to_num(hits.normals) * hits.camera.axes[2]).sum(axis=2, keepdims=True))
    grey = np.where(hits.hit[..., None], 0.15 + 0.6 * facing, 0.0)
    return np.asarray(np.repeat(grey, 3, axis=2), np.float32)
