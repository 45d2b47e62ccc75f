"""A scene's tables for kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.light import surface_kernels
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
        (materials[:, surface_kernels.KIND] == EMISSIVE)[numbers],
        *_corners(scene),
        materials,
        texels,
        sky,
        panorama,
    )
    return Surfaces(*(_read_only(array) for array in arrays))


def _read_only(array: NDArray) -> NDArray:
    """A read-only view: Numba compiles separate kernels for writable arrays."""
    view = array.view()
    view.setflags(write=False)
    return view


def _records(scene: RenderScene, materials: NDArray[np.float64], start_off: float | None) -> NDArray[np.float64]:
    mesh, numbers = scene.mesh, np.asarray(scene.face_materials)
    corners = [mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3)]
    normals = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    length = np.linalg.norm(normals, axis=1)
    normals /= np.where(length > 0.0, length, 1.0)[:, None]
    records = np.zeros((mesh.triangle_count, surface_kernels.RECORD_WORDS))
    records[:, :3] = normals
    records[:, 3] = np.einsum("fi,fi->f", normals, corners[0])
    records[:, 4] = START_OFF * np.abs(corners).max(axis=(0, 2)) if start_off is None else start_off
    records[:, 5] = numbers
    plain = np.zeros((len(materials), 4), np.float32)
    plain[:, :3] = materials[:, surface_kernels.COLOUR : surface_kernels.COLOUR + 3]
    plain[:, 3] = materials[:, surface_kernels.TEXTURE] == surface_kernels.CONSTANT
    records[:, 6:] = plain.view(np.float64)[numbers]
    return records


def _corners(scene: RenderScene) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    """`weights` and `corners` of `Surfaces`."""
    if scene.normals is None and scene.uv is None:
        return np.zeros((0, surface_kernels.CORNER_WORDS)), np.zeros((0, 2 * surface_kernels.CORNER_WORDS), np.float32)
    faces, count = scene.mesh.faces, scene.mesh.triangle_count
    a, b, c = (scene.mesh.vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    b, c = b - a, c - a
    bb, bc, cc = ((one * other).sum(axis=1, keepdims=True) for one, other in ((b, b), (b, c), (c, c)))
    area = bb * cc - bc * bc
    area = np.where(area > 0.0, area, np.inf)  # without area every point counts as the first corner
    weights = np.zeros((count, surface_kernels.CORNER_WORDS))
    for first, slope in ((0, (cc * b - bc * c) / area), (4, (bb * c - bc * b) / area)):
        weights[:, first : first + 3] = slope
        weights[:, first + 3] = -(slope * a).sum(axis=1)
    corners = np.zeros((count, 2 * surface_kernels.CORNER_WORDS), np.float32)
    if scene.normals is not None:
        corners[:, :9] = _unit_rows(scene.normals)[faces].reshape(count, 9)
    if scene.uv is not None:
        corners[:, 9:15] = scene.uv[faces].reshape(count, 6)
    return weights, corners


def _materials(materials: tuple[Material, ...]) -> tuple[NDArray[np.float64], NDArray[np.float32]]:
    rows = np.zeros((len(materials), surface_kernels.MATERIAL_WORDS))
    images: list[NDArray[np.float32]] = []
    for row, material in zip(rows, materials, strict=True):
        row[surface_kernels.KIND] = material.kind
        row[surface_kernels.PARAMETER], row[surface_kernels.VARIANT] = material.numbers
        colour = getattr(material, "colour", (1.0, 1.0, 1.0))
        if isinstance(colour, Checker):
            row[surface_kernels.TEXTURE], row[surface_kernels.SCALE] = surface_kernels.CHECKER, colour.scale
            row[surface_kernels.COLOUR : surface_kernels.COLOUR + 3] = colour.first
            row[surface_kernels.SECOND : surface_kernels.SECOND + 3] = colour.second
        elif isinstance(colour, Image):
            row[surface_kernels.TEXTURE] = surface_kernels.IMAGE
            row[surface_kernels.FIRST_TEXEL] = sum(map(len, images))
            row[surface_kernels.TEXELS_Y], row[surface_kernels.TEXELS_X] = colour.texels.shape[:2]
            images.append(colour.texels.reshape(-1, 3))
        else:
            row[surface_kernels.COLOUR : surface_kernels.COLOUR + 3] = colour
    return rows, np.concatenate([np.zeros((0, 3), np.float32), *images])


def sky_tables(sky: Sky, power: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """`sky` and `panorama` of `Surfaces`, scaled by `power`."""
    row = np.zeros(surface_kernels.SKY_WORDS, np.float32)
    if isinstance(sky, GradientSky):
        row[0], row[1:4], row[4:7] = (
            surface_kernels.GRADIENT,
            np.multiply(power, sky.below),
            np.multiply(power, sky.above),
        )
        return row, np.zeros((1, 1, 3), np.float32)
    row[0] = surface_kernels.PANORAMA
    with np.errstate(over="ignore"):  # reported where a ray meets infinite light
        return row, sky.texels * np.float32(power)


def _unit_rows(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    exact = normals.astype(np.float64)
    return (exact / np.linalg.norm(exact, axis=1, keepdims=True)).astype(np.float32)
