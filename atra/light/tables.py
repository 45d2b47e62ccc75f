"""A scene's tables for kernels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.hits import read_only
from atra.light import surface_kernels as words
from atra.light.emitters.sky_kernels import OF_COSINE, harmonics
from atra.light.materials import Emissive, Material, MetallicRoughness
from atra.light.scattering.texels_kernels import IMAGE_ROW
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
    flags = np.array([_flags(one, bool(scene.lights)) for one in scene.materials], np.uint8)[scene.face_materials]
    arrays: tuple[NDArray[Any], ...] = (
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


def area_vectors(corners: NDArray[np.floating]) -> NDArray[np.float64]:
    """(F, 3) float64 normals of triangles, as long as their areas. corners: (F, 3, 3)."""
    return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def unit_normals(mesh: Mesh) -> NDArray[np.float64]:
    """(F, 3) float64 unit normals of triangles; 0 for those without area."""
    normals = 2.0 * area_vectors(mesh.local_vertices[mesh.faces].astype(np.float64))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0.0, length, 1.0))


def sound_normals(
    normals: NDArray[np.float64] | None, vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> NDArray[np.float64]:
    """(V, 3) without zeros and NaN: a mean of the triangles around where there is none."""
    known = np.zeros((len(vertices), 3)) if normals is None else normals
    missing = ~(np.linalg.norm(known, axis=1) > 1e-3)
    if not missing.any():
        return known
    of_faces, around = area_vectors(vertices[faces]), np.zeros_like(known)
    for corner in range(3):
        np.add.at(around, faces[:, corner], of_faces)
    length = np.linalg.norm(around, axis=1, keepdims=True)
    around = np.where(length > 0.0, around / np.where(length > 0.0, length, 1.0), (0.0, 0.0, 1.0))
    return np.where(missing[:, None], around, known)


def _records(scene: Scene) -> NDArray[np.float64]:
    mesh = scene.mesh
    corners, normals = mesh.vertices[mesh.faces].astype(np.float64), unit_normals(mesh)
    records = np.zeros((mesh.triangle_count, words.RECORD_WORDS))
    records[:, :3] = normals
    records[:, 3] = np.einsum("fi,fi->f", normals, corners[:, 0])
    records[:, 4] = START_OFF * np.abs(corners).max(axis=(1, 2))
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


def _flags(material: Material, has_lamps: bool) -> int:
    """`flags` of a material's triangles."""
    is_clear, is_thin = material.clear_share > 0.0, False
    bits = words.SHINES * any(material.emission) | words.ENDS * isinstance(material, Emissive)
    if isinstance(material, MetallicRoughness):
        is_clear |= material.transmission > 0.0 and material.metallic_roughness is not None
        is_thin = material.is_thin
        bits |= words.ONE_SIDED * (not material.is_double) | words.HOLES * (material.alpha != "opaque")
    if is_clear and is_thin:
        bits |= words.HOLES
    return bits | words.SOLID * (is_clear and not is_thin and has_lamps)


def _materials(scene: Scene) -> tuple[NDArray[np.void], tuple[NDArray[Any], ...]]:
    """`materials`, and `textures`, `texels`, `coded` and `curves` of `Surfaces`."""
    rows, images = np.zeros(len(scene.materials), words.MATERIAL_ROW), _Images()
    rows["cutoff"], rows["opacity"], rows["is_double"] = 2.0, 1.0, True
    for row, material in zip(rows, scene.materials, strict=True):
        row["kind"], row["parameter"] = material.kind, getattr(material, "ior", getattr(material, "fuzz", 0.0))
        row["is_schlick"] = getattr(material, "fresnel", "") == "schlick"
        row["transmission"], row["emission"] = material.clear_share > 0.0, material.emission
        colour = material.colour
        if isinstance(colour, Checker):
            row["texture"], row["scale"] = words.CHECKER, colour.scale
            row["colour"], row["second"] = colour.first, colour.second
        elif isinstance(colour, Image):
            row["texture"] = words.IMAGE
        else:
            row["colour"] = colour
        row["images"] = [-1 if image is None else images.number_of(image) for image in material.images]
        if isinstance(material, MetallicRoughness):
            for name in _OWN:
                row[name] = getattr(material, name)
            row["cutoff"] = {"opaque": 2.0, "mask": material.cutoff, "blend": -1.0}[material.alpha]
            row["has_colours"] = scene.colours is not None
            row["colours_emit"] = scene.colours is not None and material.is_unlit
            row["absorption"] = 0.0 if material.is_thin else material.absorption
    return rows, images.tables()


_OWN = (
    "metallic", "roughness", "normal_scale", "transmission", "opacity", "is_double", "is_thin", "specular",
    "specular_colour", "coat", "coat_roughness",
)  # fmt: skip
"""Fields that `MetallicRoughness` has of its own, as they are."""


class _Images:
    """Collects images; texels that several share are kept once."""

    def __init__(self) -> None:
        self._rows: list[tuple[Any, ...]] = []
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
        curve, wraps = image.is_coded if is_bytes else -1, [WRAPS.index(wrap) for wrap in image.wrap]
        rows, columns = image.texels.shape[:2]
        of_uv = image.is_nearest, image.second_uv, image.factor, tuple(np.ravel(image.placement))
        self._rows.append((first, columns, rows, *wraps, curve, *of_uv))
        return len(self._rows) - 1

    def tables(self) -> tuple[NDArray[Any], ...]:
        return (
            np.array(self._rows, IMAGE_ROW),
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
