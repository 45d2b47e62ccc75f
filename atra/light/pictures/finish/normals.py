"""Normals of what pixels see."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits
from atra.light.scene import Scene


def shading_normals(hits: Hits, scene: Scene) -> NDArray[np.float32]:
    """(H, W, 3) float32, unit normals of the scene at the hits, facing the eye; 0 = a miss. A scene without normals has
    those of its triangles."""
    normals = eye_normals(hits)
    if scene.normals is None:
        return normals
    y, x = np.nonzero(hits.hit)
    a, b, c = np.moveaxis(scene.normals[scene.mesh.faces[hits.prim_id[y, x]]], 1, 0)
    u, v = (np.nan_to_num(weights[y, x])[:, None] for weights in (hits.u, hits.v))
    own = (1.0 - u - v) * a + u * b + v * c
    own /= np.maximum(np.linalg.norm(own, axis=1, keepdims=True), 1e-20)
    away = np.einsum("ni,ni->n", own, normals[y, x]) < 0.0
    normals[y, x] = np.where(away[:, None], -own, own)
    return normals


def eye_normals(hits: Hits) -> NDArray[np.float32]:
    """(H, W, 3) float32, unit normals of the hit triangles in the world, facing the eye; 0 = a miss."""
    normals = np.zeros((*hits.depth.shape, 3), np.float32)
    y, x = np.nonzero(hits.hit)
    corners = hits.mesh.triangles(hits.prim_id[y, x])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.where(length > 0.0, length, 1.0)
    _, directions = hits.camera.rays(x, y, hits.offset)
    away = np.einsum("ni,ni->n", across, directions @ hits.camera.axes) > 0.0
    normals[y, x] = np.where(away[:, None], -across, across)
    return normals
