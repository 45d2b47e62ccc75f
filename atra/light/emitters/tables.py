"""A scene's emitters as kernels read them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light.emitters.emitters_kernels import Emitters, fill_alias_table
from atra.light.scene import RenderScene
from atra.light.sky import PanoramaSky

_LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
"""Weights of linear sRGB's channels."""

_LEAST_SHARE = 0.25
"""Least share of rays for triangles, and for the sky, where both shine: only one of them may reach a room."""


def no_emitters() -> Emitters:
    """Nothing to be aimed at."""
    return _emitters(np.zeros(0, np.uint32), np.zeros((0, 9)), np.zeros(0), np.zeros(0), np.zeros((0, 0)), 0.0)


def emitters_of(scene: RenderScene) -> Emitters:
    """The emissive triangles of a scene by their power, and its sky, if a panorama, by the radiance of texels. A sky of
    a gradient is left to scattering, which finds it everywhere."""
    mesh = scene.mesh
    luminance = np.array([_LUMINANCE @ material.emission for material in scene.materials])[scene.face_materials]
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    edges = corners[:, 1:] - corners[:, :1]
    areas = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    powers = np.pi * areas * luminance
    prim_ids = np.flatnonzero(powers > 0.0).astype(np.uint32)
    triangles = float(powers[prim_ids].sum())
    texels = _sky_weights(scene)
    radius = 0.5 * np.linalg.norm(np.ptp(mesh.bounds, axis=0))
    sky = float(texels.sum() * np.pi * radius**2)
    share = sky / (sky + triangles) if sky > 0.0 else 0.0
    if triangles > 0.0 and sky > 0.0:
        share = min(max(share, _LEAST_SHARE), 1.0 - _LEAST_SHARE)
    densities = np.zeros(mesh.triangle_count if triangles > 0.0 else 0)
    if triangles > 0.0:
        densities[prim_ids] = (1.0 - share) * powers[prim_ids] / triangles / areas[prim_ids]
    shapes = np.concatenate([corners[prim_ids, 0], edges[prim_ids].reshape(-1, 6)], axis=1)
    return _emitters(prim_ids, shapes, powers[prim_ids], densities, texels, share)


def _sky_weights(scene: RenderScene) -> NDArray[np.float64]:
    """(H, W): luminance times solid angle of the texels of a panorama; (0, 0) for another sky, or a black one."""
    sky = scene.sky
    if not isinstance(sky, PanoramaSky) or sky.power == 0.0 or not sky.texels.any():
        return np.zeros((0, 0))
    weights = sky.power * (sky.texels.astype(np.float64) @ _LUMINANCE)
    return np.asarray(weights * _solid_angles(*weights.shape))


def _solid_angles(rows: int, columns: int) -> NDArray[np.float64]:
    """(H, 1): of a texel in each row of a panorama."""
    heights = np.cos(np.pi * np.arange(rows + 1) / rows)
    return np.asarray((heights[:-1] - heights[1:])[:, None] * (2.0 * np.pi / columns))


def _emitters(
    prim_ids: NDArray[np.uint32],
    corners: NDArray[np.float64],
    powers: NDArray[np.float64],
    densities: NDArray[np.float64],
    texels: NDArray[np.float64],
    share: float,
) -> Emitters:
    sky = texels / texels.sum() * share / _solid_angles(*texels.shape) if texels.size else texels
    return Emitters(
        prim_ids,
        corners.astype(np.float32),
        *_alias_table(powers),
        densities.astype(np.float32),
        *_alias_table(texels.ravel()),
        sky.astype(np.float32),
        np.float32(share),
    )


def _alias_table(weights: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """`odds` and `others` of `fill_alias_table`."""
    count = len(weights)
    odds = weights * (count / weights.sum()) if count else np.zeros(0)
    others, small, large = (np.empty(count, np.int32) for _ in range(3))
    fill_alias_table(odds, others, small, large)
    return odds.astype(np.float32), others
