"""Reprojection: pixel values of one picture carried over to another where both see the same surface."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits

_ALIKE = 0.9
"""Least cosine between the normals of triangles that may form one surface."""

_PIXELS_OFF = 2.0
"""Largest distance of such triangles from each other's plane, in widths of a pixel there."""


def carried(values: NDArray[np.floating], seen: Hits, to: Hits) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """(H', W', K) values for the pixels of `to`, and (H', W') bool where there are any.

    values: (H, W, K), of the pixels of `seen`, traced through their centres on the same mesh. A pixel gets the bilinear
    mean of the four around the point it sees, without those on another surface: another triangle, and another normal or
    plane.
    """
    hit = np.nonzero(to.hit & np.isfinite(to.points[..., 0]))
    points, normals, prim_id = to.points[hit].astype(np.float64), to.normals[hit], to.prim_id[hit]
    camera = seen.camera
    if camera.lens is None:
        a, b, c = camera.to_pixels @ np.vstack([camera.to_eye_space(points).T, np.ones(len(points))])
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = a / c - 0.5, b / c - 0.5
            near = c > 0.0
        width = 1.0 if camera.is_parallel else camera.to_camera_space(points)[:, 2]
    else:
        x, y = np.nan_to_num(camera.project(points).T - 0.5, nan=-9.0)  # what is not seen is outside
        near, width = np.ones(len(points), np.bool_), np.linalg.norm(camera.to_eye_space(points), axis=1)
    off = _PIXELS_OFF * camera.pixel_pitch * width
    total, weights = np.zeros((len(points), values.shape[2])), np.zeros(len(points))
    inside = near & (x > -1.0) & (y > -1.0) & (x < camera.width) & (y < camera.height)
    left, above = (np.floor(np.where(inside, place, 0.0)).astype(np.intp) for place in (x, y))
    for right, below in product((0, 1), repeat=2):
        column, row = left + right, above + below
        there = inside & (column >= 0) & (row >= 0) & (column < camera.width) & (row < camera.height)
        weight = np.maximum(0.0, 1.0 - np.abs(x - column)) * np.maximum(0.0, 1.0 - np.abs(y - row))
        place = np.where(there, row, 0), np.where(there, column, 0)
        distance = np.abs(np.einsum("ni,ni->n", seen.points[place] - points, normals))
        is_alike = (np.einsum("ni,ni->n", seen.normals[place], normals) > _ALIKE) & (distance <= off)
        is_same = there & seen.hit[place] & ((seen.prim_id[place] == prim_id) | is_alike)
        weight = np.where(is_same, weight, 0.0)
        total += np.where(is_same[:, None], weight[:, None] * values[place], 0.0)
        weights += weight
    known = np.zeros(to.prim_id.shape, bool)
    known[hit] = weights > 1e-3
    found = np.zeros((*to.prim_id.shape, values.shape[2]))
    found[known] = total[weights > 1e-3] / weights[weights > 1e-3, None]
    return found, known
