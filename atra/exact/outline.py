"""The outline of a triangle on the image, near which float32 may put a ray on either side of an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.exact.intersection import Pairs

OUTLINE_TOLERANCE_PIXELS = 1e-3
"""Distance from a triangle's outline up to which float32 may put a ray on either side of it, ten times its rounding."""


def is_on_outline(pairs: Pairs) -> NDArray[np.bool_]:
    """(N,) bool, whether a ray is within OUTLINE_TOLERANCE_PIXELS of its triangle's outline on the image.

    The image of a lens is bent, so it is looked at where the ray is: on the plane across the ray.
    Edges are cut just in front of the eye; an edge entirely behind it is infinitely far away.
    """
    corners, ends = pairs.corners, np.add(*pairs.rays)
    if pairs.camera.lens is not None:
        beside = np.einsum("nij,nkj->nki", pairs.across, corners)
        corners = np.concatenate([beside, pairs.depths[..., None]], axis=2)
        ends = np.broadcast_to([0.0, 0.0, 1.0], ends.shape)
    point = _on_image_plane(pairs, ends)
    closest = np.full(len(point), np.inf)
    for i in range(3):
        start, end = corners[:, i], corners[:, (i + 1) % 3]
        # A cut at a millionth of the edge's size in front of the eye lies outside any image.
        near = 1e-6 * np.maximum(np.abs(start).max(axis=1), np.abs(end).max(axis=1)) + np.finfo(float).tiny
        visible = np.maximum(start[:, 2], end[:, 2]) > near
        p, q = _on_image_plane(pairs, _cut(start, end, near)), _on_image_plane(pairs, _cut(end, start, near))
        along = q - p
        length_squared = (along**2).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.clip(((point - p) * along).sum(axis=1) / length_squared, 0.0, 1.0)
        t = np.where(length_squared > 0.0, t, 0.0)
        distance = np.linalg.norm(p + t[:, None] * along - point, axis=1)
        closest = np.where(visible, np.minimum(closest, distance), closest)
    return closest <= OUTLINE_TOLERANCE_PIXELS


def _cut(point: NDArray[np.float64], other: NDArray[np.float64], near: NDArray[np.float64]) -> NDArray[np.float64]:
    """`point`, moved towards `other` to depth `near` if it is nearer than that."""
    rise = other[:, 2] - point[:, 2]
    behind = (point[:, 2] < near) & (rise > 0.0)
    t = np.where(behind, (near - point[:, 2]) / np.where(behind, rise, 1.0), 0.0)
    moved = point + t[:, None] * (other - point)
    moved[:, 2] = np.maximum(moved[:, 2], near)
    return moved


def _on_image_plane(pairs: Pairs, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) float64, positions on the image plane in pixels from the view axis, or the ray of a lens."""
    on_plane = point[:, :2] if pairs.camera.is_parallel else point[:, :2] / point[:, 2:]
    return np.asarray(on_plane / pairs.pitch)
