"""Panels: rectangles that stand for shining surfaces where only lights are asked for light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.light.checks import Colour
from atra.light.emitters.tables import mean_emission
from atra.light.lights_kernels import ACROSS, KIND, LIGHT_WORDS, PANEL, PLACE, SIZE, SPHERE, UP
from atra.light.scene import Scene
from atra.light.tables import area_vectors

MOST_PANELS = 8
"""Shining bodies that are asked for light, those of the greatest power."""

_FLAT = 0.5
"""Least length of the sum of a body's area vectors, as a share of its area, for a panel; else it is a sphere."""


@dataclass(frozen=True)
class Panel:
    """The light of one shining body. row: (LIGHT_WORDS,), for kernels. colour, power: as of a light."""

    row: NDArray[np.float32]
    colour: Colour
    power: float = 1.0


def panels_of(scene: Scene) -> list[Panel]:
    """A light for each body of connected triangles of one shining material, at most `MOST_PANELS`.

    A body that shines to one side becomes a rectangle of its area and spread, any other a sphere of its area.
    """
    scene = scene.local
    radiance = np.array([mean_emission(material) for material in scene.materials])[scene.face_materials]
    shining = np.flatnonzero(radiance.max(axis=1) > 0.0)
    if not len(shining):
        return []
    corners = scene.mesh.vertices[scene.mesh.faces[shining]].astype(np.float64)
    fronts = area_vectors(corners)
    areas = np.linalg.norm(fronts, axis=1)
    body = _bodies(corners, np.asarray(scene.face_materials)[shining])
    powers = np.bincount(body, areas * radiance[shining].max(axis=1))
    chosen = [one for one in np.argsort(-powers, kind="stable")[:MOST_PANELS] if powers[one] > 0.0]
    parts = [body == one for one in chosen]
    return [_panel(corners[own], fronts[own], areas[own], radiance[shining][own][0]) for own in parts]


def _bodies(corners: NDArray[np.float64], materials: NDArray[np.int32]) -> NDArray[np.intp]:
    """(N,) the body of each triangle, from 0: those that share corners and a material, whatever their vertices."""
    rows = np.concatenate([corners.reshape(-1, 3), np.repeat(materials, 3)[:, None]], axis=1)
    _, places = np.unique(rows, axis=0, return_inverse=True)
    faces = places.reshape(-1, 3)
    least = np.arange(int(faces.max()) + 1)
    while True:
        before = least.copy()
        np.minimum.at(least, faces, least[faces].min(axis=1, keepdims=True))
        least = least[least]
        if np.array_equal(least, before):
            return np.unique(least[faces[:, 0]], return_inverse=True)[1].ravel()


def _panel(
    corners: NDArray[np.float64], fronts: NDArray[np.float64], areas: NDArray[np.float64], radiance: NDArray[np.float64]
) -> Panel:
    area, front = float(areas.sum()), fronts.sum(axis=0)
    middle = (areas[:, None] * corners.mean(axis=1)).sum(axis=0) / area
    row = np.zeros(LIGHT_WORDS, np.float32)
    row[PLACE:SIZE] = middle
    if np.linalg.norm(front) < _FLAT * area:
        row[KIND], row[SIZE] = SPHERE, np.sqrt(area / (4.0 * np.pi))
        facing = 0.25 * area  # a sphere's disc
    else:
        across, up = _sides(corners - middle, areas, front / np.linalg.norm(front))
        row[KIND], row[ACROSS:UP], row[UP:] = PANEL, across, up
        facing = float(np.linalg.norm(front))
    red, green, blue = (min(float(channel), 1e12) for channel in facing / np.pi * radiance)
    return Panel(row, (red, green, blue))


def _sides(
    corners: NDArray[np.float64], areas: NDArray[np.float64], front: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The two vectors of a rectangle with the area and the directions of spread of triangles around the origin."""
    # The second moment of a triangle, by its corners and their sum; that of a rectangle is a third of a^2 and b^2.
    whole = corners.sum(axis=1)
    moments = (np.einsum("fci,fcj->fij", corners, corners) + np.einsum("fi,fj->fij", whole, whole)) / 12.0
    spread = np.einsum("f,fij->ij", areas, moments) / areas.sum()
    flat = np.eye(3) - np.outer(front, front)
    values, directions = np.linalg.eigh(flat @ spread @ flat)
    across = directions[:, 2]
    up = np.cross(front, across)
    ratio = np.sqrt(max(values[1], 1e-6 * values[2], 1e-300) / max(values[2], 1e-300))
    long = 0.5 * np.sqrt(areas.sum() / ratio)
    return long * across, long * ratio * up
