"""What a mesh file holds: parts, names, units and notes; and faces made into a part."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.meshes.polygons import cut_polygons
from atra.files.reading import Allowance
from atra.geometry.mesh import LARGEST_COORDINATE

NONE = -1
"""Stands for no material, and for no node."""

BYTES_PER_ROW = 3 * (2 * 8 + 8 + 4)
"""Memory for the three numbers of a face or vertex: 64 bits in a part, joined and checked, 32 bits when kept."""


class Part(NamedTuple):
    """Triangles of a mesh file in world space.

    vertices: (V, 3) float64, or float32 where the file has them. faces: (F, 3) whole numbers. face: (F,), number of
    each triangle's face in the file or primitive. material: an index into the file's materials, of all or of each of
    (F,) triangles. node: an index into its nodes.
    """

    vertices: NDArray[np.floating]
    faces: NDArray[np.integer]
    face: NDArray[np.int64]
    material: int | NDArray[np.int32] = NONE
    node: int = NONE


class MeshFile(NamedTuple):
    """parts: in the order of the file. units: the unit of length that the file states. notes: what was left out."""

    parts: list[Part]
    materials: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()
    units: str | None = None
    notes: tuple[str, ...] = ()


def polygon_part(
    vertices: NDArray[np.floating],
    sizes: NDArray[np.int64],
    corners: NDArray[np.int64],
    materials: NDArray[np.int32] | None = None,
) -> tuple[Part, list[str]]:
    """The triangles of polygons, as for `cut_polygons`, and notes. materials: (P,), of each polygon.

    A vertex that no face uses, and that is not finite, is moved to the first vertex that one uses. Raises InputError
    for an index without vertex, and for a used vertex that `Mesh` refuses.
    """
    check_indices(sizes, corners, len(vertices))
    vertices, notes = _sound(vertices, corners)
    faces, face, more = cut_polygons(vertices, sizes, corners)
    return Part(vertices, faces, face, NONE if materials is None else materials[face]), notes + more


def placed_part(
    vertices: NDArray[np.floating],
    faces: NDArray[np.integer],
    transform: NDArray[np.float64],
    material: int = NONE,
    node: int = NONE,
) -> Part:
    """A part in world space. transform: (4, 4); one that mirrors turns the winding of the faces, so that their front
    stays outside."""
    if not np.array_equal(transform, np.eye(4)):  # the identity keeps the file's bits
        vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
        if np.linalg.det(transform[:3, :3]) < 0.0:
            faces = faces[:, ::-1]
    return Part(vertices, faces, np.arange(len(faces)), material, node)


def joined(parts: Sequence[Part]) -> tuple[NDArray[np.floating], NDArray[np.integer]]:
    """Vertices and faces of all parts, one behind the other; those of a single one as they are."""
    if len(parts) == 1:
        return parts[0].vertices, parts[0].faces
    firsts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    faces = np.concatenate([part.faces + first for part, first in zip(parts, firsts, strict=True)])
    return np.concatenate([part.vertices for part in parts]), faces


def check_indices(sizes: NDArray[np.int64], corners: NDArray[np.int64], count: int) -> None:
    """Raise InputError for the first corner that names none of `count` vertices."""
    if len(corners) and (corners.min() < 0 or corners.max() >= count):
        first = int(np.argmax((corners < 0) | (corners >= count)))
        face = int(np.searchsorted(np.cumsum(sizes), first, "right"))
        raise InputError(f"face {face} names vertex {corners[first]}, but there are {count} vertices, counted from 0")


def _sound(vertices: NDArray[np.floating], corners: NDArray[np.int64]) -> tuple[NDArray[np.floating], list[str]]:
    extremes = np.array([vertices.min(initial=0.0), vertices.max(initial=0.0)], np.float64)
    if (np.abs(extremes) <= LARGEST_COORDINATE).all() or not len(corners):  # False for NaN, too
        return vertices, []
    is_bad: NDArray[np.bool_] = np.any(~(np.abs(vertices) <= LARGEST_COORDINATE), axis=1)
    is_bad_corner = is_bad[corners]
    if is_bad_corner.any():
        index = int(corners[is_bad_corner].min())
        raise InputError(
            f"vertex {index} is {tuple(vertices[index].tolist())}, expected finite numbers of at most "
            f"{LARGEST_COORDINATE:g} in size"
        )
    vertices = np.array(vertices)
    vertices[is_bad] = vertices[corners[0]]
    return vertices, [f"{is_bad.sum():,} vertices that no face uses are not finite or beyond {LARGEST_COORDINATE:g}"]


def check_rows(rows: int, allowance: Allowance) -> None:
    """Check the memory of so many faces and vertices."""
    allowance.check(f"{rows:,} faces and vertices", rows * BYTES_PER_ROW)
