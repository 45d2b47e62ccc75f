"""Small scenes the tests of lightmaps share, with charts of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import atra
from atra.light import Atlas, Baker, Emissive, Lambertian, Lightmap, MetallicRoughness, Scene, constant_sky
from atra.light.lightmaps.charts.unwrap import UNMAPPED
from atra.light.lightmaps.finish.views import on_map
from tests.meshes import joined, quads

_CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])


def sheet(mesh: atra.Mesh, texels: int, gap: int = 2, charted: int | None = None) -> Atlas:
    """Charts of a mesh of quadrilaterals: squares of so many texels side by side, row by row. charted: number of the
    first quadrilaterals that have one."""
    count = mesh.triangle_count // 2 if charted is None else charted
    columns = int(np.ceil(np.sqrt(count)))
    size = columns * (texels + gap) + gap
    uv = []
    for number in range(count):
        row, column = divmod(number, columns)
        first = np.array([column, columns - 1 - row]) * (texels + gap) + gap
        uv += [(first + texels * _CORNERS[list(face)]) / size for face in ((0, 1, 2), (0, 2, 3))]
    atlas, others = Atlas.of_uv(np.array(uv), size, size), mesh.triangle_count - 2 * count
    known = np.concatenate([atlas.uv, np.full((others, 3, 2), np.nan)])
    return replace(atlas, uv=known, chart=np.append(atlas.chart, np.full(others, UNMAPPED)))


def cube(half: float = 1.0, inwards: bool = False) -> atra.Mesh:
    """A closed box around the origin."""
    corners = half * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return quads([[tuple(corners[k]) for k in (side if inwards else side[::-1])] for side in sides])


def painted(mesh: atra.Mesh, albedo: Any = 0.7, emission: Any = 0.0, opacity: Any = 1.0, **others: Any) -> Scene:
    """Diffuse faces of these albedos, (F, 3) or one for all, in the dark. emission: radiance of black faces that shine.
    opacity: of faces that let the rest of the light on."""
    count = mesh.triangle_count
    albedo, emission = (np.broadcast_to(one, (count, 3)) for one in (albedo, emission))
    rows = np.column_stack([albedo, emission, np.broadcast_to(opacity, count)])
    kinds, numbers = np.unique(rows, axis=0, return_inverse=True)
    materials = [_painted(*np.split(row, [3, 6])) for row in kinds]
    return Scene(mesh, materials, numbers.ravel(), **({"sky": constant_sky(0.0)} | others))


def _painted(albedo: Any, emission: Any, opacity: Any) -> Emissive | Lambertian | MetallicRoughness:
    if emission.any():
        return Emissive(tuple(emission.tolist()))
    colour = tuple(albedo.tolist())
    return Lambertian(colour) if opacity == 1.0 else MetallicRoughness(colour, float(opacity[0]), "blend")


def shining_room() -> Scene:
    """A closed room of coloured walls with a block in it, and one wall that shines."""
    colours = [(0.7, 0.7, 0.6), (0.6, 0.1, 0.1), (0.1, 0.5, 0.2), (0.7, 0.6, 0.7), (0.5, 0.5, 0.5)]
    materials = [*(Lambertian(colour) for colour in colours), Emissive((3.0, 2.5, 2.0))]
    numbers = np.array([1, 2, 0, 5, 3, 0, 4, 4, 4, 4, 4, 4]).repeat(2)
    return Scene(joined(cube(inwards=True), cube(0.3)), materials, numbers, sky=constant_sky(0.0))


def baked(scene: Scene, atlas: Atlas, samples: int, **options: Any) -> Lightmap:
    """The map of so many samples."""
    with Baker(scene, atlas, **({"threads": 1} | options)) as baker:
        baker.add(samples)
        return baker.maps


def looked_up(hits: atra.Hits, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, C): an (h, w, C) map at the hits; 0 without a hit or a place on the map."""
    shown = np.zeros((*hits.depth.shape, image.shape[2]), np.float32)
    shown[hits.hit] = on_map(hits.prim_id[hits.hit], hits.u[hits.hit], hits.v[hits.hit], atlas, image)
    return shown


def standard_error(lightmap: Lightmap) -> NDArray[np.float64]:
    """(N,), of the luminance of each texel's mean."""
    return np.sqrt(lightmap.variance.astype(np.float64) / lightmap.samples)
