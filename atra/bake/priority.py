"""The culling map: which texels a camera sees."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.bake.charts.texels import Texels
from atra.geometry.view import View
from atra.hits import Hits
from atra.rays.scene import RayScene

START_OFF = 1e-4
"""Of the distance to the eye: how far rays stay away from the texel and from the eye."""


def visible_texels(texels: Texels, hits: Hits, scene: RayScene) -> NDArray[np.bool_]:
    """(N,) bool: in the image and not hidden, by what the pixels show, and for all others by a ray to the eye.

    Texels of several triangles are seen where the one is that they stand for.
    """
    seen = _shown(texels, hits)
    rest = np.flatnonzero(~seen & _in_image(texels, hits.camera))
    seen[rest[_reach_the_eye(texels, rest, hits.camera, scene)]] = True
    return seen


def _shown(texels: Texels, hits: Hits) -> NDArray[np.bool_]:
    """Of the points that pixels show, the texel that each lies in."""
    hit = hits.hit
    face = hits.prim_id[hit].astype(np.int64)
    u, v = hits.u[hit].astype(np.float64), hits.v[hit].astype(np.float64)
    corners = texels.atlas.uv[face]
    place = (1.0 - u - v)[:, None] * corners[:, 0] + u[:, None] * corners[:, 1] + v[:, None] * corners[:, 2]
    known = np.isfinite(place).all(axis=1)
    atlas = texels.atlas
    column = np.clip(place[known, 0].astype(np.int64), 0, atlas.width - 1)
    row = np.clip(place[known, 1].astype(np.int64), 0, atlas.height - 1)
    is_front = np.einsum("ni,ni->n", hits.normals[hit][known], _to_eye_of(texels, face[known], hits)) > 0.0
    image = np.zeros(atlas.width * atlas.height, np.bool_)
    image[(row * atlas.width + column)[is_front]] = True
    return image[texels.number]


def _to_eye_of(texels: Texels, face: NDArray[np.int64], hits: Hits) -> NDArray[np.float64]:
    """From the first corner of each face to the eye, or against the view axis where rays are parallel."""
    camera = hits.camera
    if camera.is_parallel:
        return np.broadcast_to(-camera.axes[2], (len(face), 3))
    return camera.eye - texels.mesh.vertices[texels.mesh.faces[face, 0]].astype(np.float64)


def _in_image(texels: Texels, camera: View) -> NDArray[np.bool_]:
    points = camera.to_eye_space(texels.positions)
    a, b, c = (points @ camera.to_pixels[:, :3].T + camera.to_pixels[:, 3]).T
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = (a >= 0.0) & (a <= camera.width * c) & (b >= 0.0) & (b <= camera.height * c) & (c > 0.0)
    facing = -camera.axes[2] if camera.is_parallel else -points
    return np.asarray(inside & (points @ camera.axes[2] > 0.0) & ((texels.normals * facing).sum(axis=1) > 0.0))


def _reach_the_eye(texels: Texels, numbers: NDArray[np.int64], camera: View, scene: RayScene) -> NDArray[np.bool_]:
    if not len(numbers):
        return np.zeros(0, np.bool_)
    points = camera.to_eye_space(texels.positions[numbers])
    if camera.is_parallel:
        depth = points @ camera.axes[2]
        ways = -depth[:, None] * camera.axes[2]
    else:
        ways = -points
    origins = points + camera.eye
    return ~scene.occluded(origins, ways, tnear=START_OFF, tfar=1.0 - START_OFF)
