"""Views of a scene: lit by its lightmap, and in plain clay."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from atra.hits import Hits
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.surface import BakeScene


def looked_up(hits: Hits, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, C) float32: an (h, w, C) map, interpolated at the hits; 0 without a hit or a place on the map."""
    shown = np.zeros((*hits.depth.shape, image.shape[2]), np.float32)
    u, v = (weights[hits.hit].astype(np.float64)[:, None] for weights in (hits.u, hits.v))
    face = hits.prim_id[hits.hit]
    a, b, c = atlas.uv[face].swapaxes(0, 1)
    place = (1.0 - u - v) * a + u * b + v * c
    mapped = np.isfinite(place).all(axis=1)
    rows, columns, *steps = atlas.texels_around(np.where(mapped[:, None], place, 0.0), face)
    fy, fx = (step.astype(np.float32)[:, None] for step in steps)
    upper, lower = ((1.0 - fx) * image[row, columns[0]] + fx * image[row, columns[1]] for row in rows)
    shown[hits.hit] = np.where(mapped[:, None], (1.0 - fy) * upper + fy * lower, np.float32(0.0))
    return shown


def lit_view(hits: Hits, scene: BakeScene, atlas: Atlas, image: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: the view of the hits, lit by an (h, w, 3) map alone; emitting faces show their
    emission."""
    assert scene.surface is not None
    seen = hits.prim_id[hits.hit]
    view = looked_up(hits, atlas, image)
    albedo = scene.albedo_at(seen, hits.points[hits.hit])
    view[hits.hit] = albedo * view[hits.hit] + scene.surface.emission[seen]
    return view


def clay_view(hits: Hits) -> NDArray[np.float32]:
    """(H, W, 3) float32, linear RGB: grey, brighter where a face turns to the view."""
    facing = np.abs((np.nan_to_num(hits.normals) * hits.camera.axes[2]).sum(axis=2, keepdims=True))
    grey = np.where(hits.hit[..., None], 0.15 + 0.6 * facing, 0.0)
    return np.asarray(np.repeat(grey, 3, axis=2), np.float32)
