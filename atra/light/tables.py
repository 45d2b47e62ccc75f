"""A scene's tables for kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.hits import read_only
from atra.light import surface_kernels as words
from atra.light.emitters.harmonics_kernels import OF_COSINE, harmonics
from atra.light.materials import Emissive, Material, MetallicRoughness
from atra.light.scene import Scene
from atra.light.sky import GradientSky, Sky
from atra.light.surface_kernels import Surfaces
from atra.light.textures import CURVES, WRAPS, Checker, Image

START_OFF = 2.0**-20
"""Offset of rays from a triangle, as a fraction of its largest coordinate: sixteen roundings of float32."""


def surfaces_of(scene: Scene, sky_power: float) -> Surfaces:
    """The tables of a scene whose sky is scaled by `sky_power`, around its mesh's origin."""
    scene = scene.local
    materials, images = _materials(scene)
    sky, panorama = sky_tables(scene.sky, sky_power)
    flags = _flags(scene)[np.asarray(scene.face_materials)]
    arrays = (
        _records(scene),
        flags,
        *_corners(scene),
        materials,
        *images,
        sky,
        panorama,
        _sky_harmonics(panorama, float(sky[words.SKY_TURN])),
    )
    either = int(np.bitwise_or.reduce(flags))
    seen_through = bool(either & (words.HOLES | words.SOLID)), bool(either & (words.HOLES | words.ONE_SIDED))
    tables: list[Any] = [*map(read_only, arrays), *seen_through]
    return Surfaces(*tables)


def area_vectors(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, 3) float64 normals of triangles, as long as their areas. corners: (F, 3, 3)."""
    return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def unit_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) float64 unit normals of triangles; 0 for those without area."""
    normals = 2.0 * area_vectors(mesh.local_vertices[mesh.faces].astype(np.float64))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def _records(scene: Scene) -> NDArray[np.float64]:
    mesh = scene.mesh
    corners = [mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3)]
    normals = unit_normals(mesh)
    records = np.zeros((mesh.triangle_count, words.RECORD_WORDS))
    records[:, :3] = normals
    records[:, 3] = np.einsum("fi,fi->f", normals, corners[0])
    records[:, 4] = START_OFF * np.abs(corners).max(axis=(0, 2))
    records[:, 5] = np.asarray(scene.face_materials)
    return records


def _corners(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float32], NDArray[np.float32]]:
    """`weights`, `corners` and `more` of `Surfaces`."""
    more = _more(scene)
    if scene.normals is None and scene.uv is None and not len(more):
        return np.zeros((0, words.CORNER_WORDS)), np.zeros((0, 2 * words.CORNER_WORDS), np.float32), more
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
    return weights, corners, more


def _more(scene: Scene) -> NDArray[np.float32]:
    if scene.colours is None and scene.second_uv is None:
        return np.zeros((0, words.MORE_WORDS), np.float32)
    faces, count = scene.mesh.faces, scene.mesh.triangle_count
    more = np.ones((count, words.MORE_WORDS), np.float32)
    if scene.colours is not None:
        more[:, :12] = scene.colours[faces].reshape(count, 12)
    if scene.second_uv is not None:
        more[:, 12:] = scene.second_uv[faces].reshape(count, 6)
    return more


def _flags(scene: Scene) -> NDArray[np.uint8]:
    """(M,), `flags` of a material's triangles."""
    return np.array(
        [
            (words.SHINES if any(one.emission) else 0)
            | (words.ENDS if isinstance(one, Emissive) else 0)
            | _passes(one, bool(scene.lights))
            for one in scene.materials
        ],
        np.uint8,
    )


def _passes(material: Material, has_lamps: bool) -> int:
    """HOLES, ONE_SIDED and SOLID of a material."""
    is_clear, is_thin, has_holes, bits = material.clear_share > 0.0, False, False, 0
    if isinstance(material, MetallicRoughness):
        is_clear |= material.transmission > 0.0 and material.metallic_roughness is not None
        is_thin, has_holes = material.is_thin, material.alpha != "opaque"
        bits = 0 if material.is_double else words.ONE_SIDED
    if has_holes or (is_clear and is_thin):
        bits |= words.HOLES
    return bits | words.SOLID if is_clear and not is_thin and has_lamps else bits


def _materials(scene: Scene) -> tuple[NDArray[np.float64], tuple[NDArray[Any], ...]]:
    """`materials`, and `textures`, `texels`, `coded` and `curves` of `Surfaces`."""
    rows = np.zeros((len(scene.materials), words.MATERIAL_WORDS))
    rows[:, words.IMAGES : words.IMAGES + 5] = -1.0
    images = _Images()
    for row, material in zip(rows, scene.materials, strict=True):
        row[words.KIND] = material.kind
        row[words.PARAMETER], row[words.VARIANT] = material.numbers
        row[words.CUTOFF], row[words.OPACITY], row[words.BACKS] = 2.0, 1.0, 1.0
        colour = material.colour
        if isinstance(colour, Checker):
            row[words.TEXTURE], row[words.SCALE] = words.CHECKER, colour.scale
            row[words.COLOUR : words.COLOUR + 3] = colour.first
            row[words.SECOND : words.SECOND + 3] = colour.second
        elif isinstance(colour, Image):
            row[words.TEXTURE] = words.IMAGE
        else:
            row[words.COLOUR : words.COLOUR + 3] = colour
        row[words.EMISSION : words.EMISSION + 3] = material.emission
        row[words.TRANSMISSION] = material.clear_share > 0.0
        for slot, image in enumerate(material.images):
            if image is not None:
                row[words.IMAGES + slot] = images.number_of(image)
        if isinstance(material, MetallicRoughness):
            _physical(row, material, scene.colours is not None)
    return rows, images.tables()


def _physical(row: NDArray[np.float64], material: MetallicRoughness, has_colours: bool) -> None:
    row[words.METALLIC], row[words.ROUGHNESS] = material.metallic, material.roughness
    row[words.NORMAL_SCALE], row[words.TRANSMISSION] = material.normal_scale, material.transmission
    row[words.OPACITY] = material.opacity
    row[words.CUTOFF] = {"opaque": 2.0, "mask": material.cutoff, "blend": -1.0}[material.alpha]
    row[words.HAS_COLOURS] = has_colours * (words.COLOURS_EMIT if material.is_unlit else 1)
    row[words.BACKS] = material.is_double
    row[words.SPECULAR], row[words.TINT : words.TINT + 3] = material.specular, material.specular_colour
    row[words.COAT], row[words.COAT_ROUGHNESS] = material.coat, material.coat_roughness
    row[words.ABSORPTION : words.ABSORPTION + 3] = 0.0 if material.is_thin else material.absorption


class _Images:
    """Collects images; texels that several share are kept once."""

    def __init__(self) -> None:
        self._rows: list[NDArray[np.float64]] = []
        self._firsts: dict[int, int] = {}
        self._texels: tuple[list[NDArray[Any]], list[NDArray[Any]]] = [], []

    def number_of(self, image: Image) -> int:
        """The image's row."""
        is_bytes = image.texels.dtype == np.uint8
        kept = self._texels[is_bytes]
        first = self._firsts.get(id(image.texels))
        if first is None:
            first = self._firsts[id(image.texels)] = sum(map(len, kept))
            kept.append(_four_channels(image.texels))
        row = np.zeros(words.TEXTURE_WORDS)
        row[words.FIRST_TEXEL], row[words.TEXELS_Y], row[words.TEXELS_X] = first, *image.texels.shape[:2]
        row[words.WRAP_X], row[words.WRAP_Y] = (WRAPS.index(wrap) for wrap in image.wrap)
        row[words.CURVE] = image.is_coded if is_bytes else -1
        row[words.NEAREST], row[words.UV] = image.is_nearest, image.second_uv
        row[words.FACTOR : words.PLACEMENT], row[words.PLACEMENT :] = image.factor, np.ravel(image.placement)
        self._rows.append(row)
        return len(self._rows) - 1

    def tables(self) -> tuple[NDArray[Any], ...]:
        return (
            np.array(self._rows).reshape(-1, words.TEXTURE_WORDS),
            np.concatenate([np.zeros((0, 4), np.float32), *self._texels[0]]),
            np.concatenate([np.zeros((0, 4), np.uint8), *self._texels[1]]),
            CURVES,
        )


def _four_channels(texels: NDArray[Any]) -> NDArray[Any]:
    """(H, W, 3 or 4) -> (H W, 4), opaque where there was no opacity."""
    flat = texels.reshape(-1, texels.shape[2])
    if flat.shape[1] == 4:
        return flat
    opaque = np.full((len(flat), 1), 255 if flat.dtype == np.uint8 else 1, flat.dtype)
    return np.concatenate([flat, opaque], axis=1)


def _sky_harmonics(panorama: NDArray[np.float32], turn: float) -> NDArray[np.float32]:
    """`harmonics` of `Surfaces`, of a panorama. turn: as of SKY_TURN."""
    rows, columns = panorama.shape[:2]
    ends = np.cos(np.pi * np.arange(rows + 1) / rows)
    middle, thick = 0.5 * (ends[:-1] + ends[1:])[:, None], (ends[:-1] - ends[1:]) * (2.0 * np.pi / columns)
    around = 2.0 * np.pi * ((np.arange(columns) + 0.5) / columns - 0.5 - turn)
    light = np.tensordot(panorama, _waves(around), (1, 1))
    # Within a row harmonics are sums of five waves; eight turns tell how much of each.
    turns = np.arange(8) * (np.pi / 4.0)
    across = np.sqrt(1.0 - middle**2)
    found = np.stack(np.broadcast_arrays(*harmonics(across * np.sin(turns), middle, -across * np.cos(turns))))
    of_waves = found @ np.linalg.pinv(_waves(turns).astype(np.float64))
    return (OF_COSINE[:, None] * np.einsum("khw,hcw,h->kc", of_waves, light, thick)).astype(np.float32)


def _waves(turns: NDArray[np.floating]) -> NDArray[np.float32]:
    """(5, N): what the harmonics in a row of a panorama are made of, at N longitudes."""
    waves = np.ones(len(turns)), np.sin(turns), np.cos(turns), np.sin(2.0 * turns), np.cos(2.0 * turns)
    return np.stack(waves).astype(np.float32)


def sky_tables(sky: Sky, power: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """`sky` and `panorama` of `Surfaces`, scaled by `power`."""
    row = np.zeros(words.SKY_WORDS, np.float32)
    if isinstance(sky, GradientSky):
        row[0] = words.GRADIENT
        row[1:4], row[4:7] = np.multiply(power, sky.below), np.multiply(power, sky.above)
        return row, np.zeros((1, 1, 3), np.float32)
    row[0], row[words.SKY_TURN] = words.PANORAMA, sky.rotation_degrees / 360.0
    with np.errstate(over="ignore"):  # reported where a ray meets infinite light
        return row, sky.texels * np.float32(power)
