"""A scene's tables for kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.hits import read_only
from atra.light import surface_kernels as words
from atra.light.materials import Checker, Image, Material
from atra.light.scattering_kernels import EMISSIVE
from atra.light.scene import RenderScene
from atra.light.sky import GradientSky, Sky
from atra.light.surface_kernels import Surfaces

START_OFF = 2.0**-20
"""Default offset of rays from a triangle, as a fraction of its largest coordinate: sixteen roundings of float32."""


def surfaces_of(scene: RenderScene, sky_power: float, start_off: float | None) -> Surfaces:
    """The tables of a scene whose sky is scaled by `sky_power`.

    start_off: offset of rays from a triangle, scene units; None: by the size of its coordinates.
    """
    materials, texels = _materials(tuple(scene.materials))
    sky, panorama = sky_tables(scene.sky, sky_power)
    numbers = np.asarray(scene.face_materials)
    arrays = (
        _records(scene, materials, start_off),
        (materials[:, words.KIND] == EMISSIVE)[numbers],
        *_corners(scene),
        materials,
        texels,
        sky,
        panorama,
    )
    return Surfaces(*(read_only(array) for array in arrays))


def unit_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) float64 unit normals of triangles; 0 for those without area."""
    corners = [mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3)]
    normals = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _records(scene: RenderScene, materials: NDArray[np.float64], start_off: float | None) -> NDArray[np.float64]:
    mesh, numbers = scene.mesh, np.asarray(scene.face_materials)
    corners = [mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3)]
    normals = unit_normals(mesh)
    records = np.zeros((mesh.triangle_count, words.RECORD_WORDS))
    records[:, :3] = normals
    records[:, 3] = np.einsum("fi,fi->f", normals, corners[0])
    records[:, 4] = START_OFF * np.abs(corners).max(axis=(0, 2)) if start_off is None else start_off
    records[:, 5] = numbers
    plain = np.zeros((len(materials), 4), np.float32)
    plain[:, :3] = materials[:, words.COLOUR : words.COLOUR + 3]
    plain[:, 3] = materials[:, words.TEXTURE] == words.CONSTANT
    records[:, 6:] = plain.view(np.float64)[numbers]
    return records


def _corners(scene: RenderScene) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """`weights` and `corners` of `Surfaces`."""
    if scene.normals is None and scene.uv is None:
        return np.zeros((0, words.CORNER_WORDS)), np.zeros((0, 2 * words.CORNER_WORDS), np.float32)
    faces, count = scene.mesh.faces, scene.mesh.triangle_count
    a, b, c = (scene.mesh.vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    b, c = b - a, c - a
    bb, bc, cc = ((one * other).sum(axis=1, keepdims=True) for one, other in ((b, b), (b, c), (c, c)))
    area = bb * cc - bc * bc
    area = np.where(area > 0.0, area, np.inf)  # without area every point counts as the first corner
    weights = np.zeros((count, words.CORNER_WORDS))
    for first, slope in ((0, (cc * b - bc * c) / area), (4, (bb * c - bc * b) / area)):
        weights[:, first : first + 3] = slope
        weights[:, first + 3] = -(slope * a).sum(axis=1)
    corners = np.zeros((count, 2 * words.CORNER_WORDS), np.float32)
    if scene.normals is not None:
        normals = scene.normals.astype(np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        corners[:, :9] = normals.astype(np.float32)[faces].reshape(count, 9)
    if scene.uv is not None:
        corners[:, 9:15] = scene.uv[faces].reshape(count, 6)
    return weights, corners


def _materials(materials: tuple[Material, ...]) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    rows = np.zeros((len(materials), words.MATERIAL_WORDS))
    images: list[NDArray[np.float32]] = []
    for row, material in zip(rows, materials, strict=True):
        row[words.KIND] = material.kind
        row[words.PARAMETER], row[words.VARIANT] = material.numbers
        colour = getattr(material, "colour", (1.0, 1.0, 1.0))
        if isinstance(colour, Checker):
            row[words.TEXTURE], row[words.SCALE] = words.CHECKER, colour.scale
            row[words.COLOUR : words.COLOUR + 3] = colour.first
            row[words.SECOND : words.SECOND + 3] = colour.second
        elif isinstance(colour, Image):
            row[words.TEXTURE] = words.IMAGE
            row[words.FIRST_TEXEL] = sum(map(len, images))
            row[words.TEXELS_Y], row[words.TEXELS_X] = colour.texels.shape[:2]
            images.append(colour.texels.reshape(-1, 3))
        else:
            row[words.COLOUR : words.COLOUR + 3] = colour
    return rows, np.concatenate([np.zeros((0, 3), np.float32), *images])


def sky_tables(sky: Sky, power: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """`sky` and `panorama` of `Surfaces`, scaled by `power`."""
    row = np.zeros(words.SKY_WORDS, np.float32)
    if isinstance(sky, GradientSky):
        row[0] = words.GRADIENT
        row[1:4], row[4:7] = np.multiply(power, sky.below), np.multiply(power, sky.above)
        return row, np.zeros((1, 1, 3), np.float32)
    row[0] = words.PANORAMA
    with np.errstate(over="ignore"):  # reported where a ray meets infinite light
        return row, sky.texels * np.float32(power)
