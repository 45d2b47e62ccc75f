"""Light along the rays of a bundle: what each hit takes from the one that it faces, or from the sky."""

from __future__ import annotations

import numpy as np

from atra.kernels.caching import float_kernel
from atra.kernels.shading.numbers import ZERO
from atra.kernels.shading.surface import sky_colour

NOWHERE, NOTHING = -1, -2
"""In place of a texel: a place that has none; the back of a face, which takes and gives nothing."""

PLACE_WORDS = 8
"""float64 of a triangle: the first four times a point (x, y, z, 1) of its plane give x on the map, the others y."""


def words_of(bounces: int) -> int:
    """float32 of a texel in `fresh` and `light`, whole cache lines: how many hits, then three channels of the sky's
    light, and of light after each number of reflections."""
    return -(-(1 + 3 * (bounces + 1)) // 16) * 16


@float_kernel
def settle(fresh, totals, direct, light):  # type: ignore[no-untyped-def]
    """Add what texels took to their totals, and say what they give from now on.

    fresh: (N, words) float32, set to 0. totals: (N, 1 + 3 (B + 1)) float64, hits and sums. direct: (N, 3) float32.
    light: (N, words) float32, written: three channels after 0 reflections, then after 1, up to B - 1.
    """
    for texel in range(len(totals)):
        for word in range(totals.shape[1]):
            totals[texel, word] += fresh[texel, word]
            fresh[texel, word] = ZERO
        share = 1.0 / max(totals[texel, 0], 1.0)
        for word in range(totals.shape[1] - 4):
            straight = direct[texel, word] if word < 3 else ZERO
            light[texel, word] = np.float32(totals[texel, 1 + word] * share) + straight


@float_kernel
def exchange(hits, lines, tables, maps, on_ray, bounces, light, fresh):  # type: ignore[no-untyped-def]
    """Fronts that a ray meets take what leaves the front that they see along it, or the sky.

    hits: depth and prim_id, (k, H, W) float32 and uint32, and count, (H, W) uint32, of `LayerHits`; where there are
    more than k, the last sees what is not known, and takes nothing. lines: (4, 3) float64: where the ray of pixel
    (0, 0) starts, what a pixel to the right adds, what one down, and the unit direction of all. maps: places, (F,
    PLACE_WORDS), and texels of the map, (texels,) int32, or NOWHERE. on_ray: (2, k) int64, scratch: the texel whose
    front looks back along the ray, and that whose front looks ahead. light, fresh: of `settle`; fresh is added to.
    """
    depth, prim_id, count = hits
    places, texel_of = maps
    layers, height, width = depth.shape
    rows = len(texel_of) // tables.width
    nearest = np.float32(tables.offset)
    dx, dy, dz = lines[3, 0], lines[3, 1], lines[3, 2]
    skies = (
        sky_colour(tables, (np.float32(-dx), np.float32(-dy), np.float32(-dz))),
        sky_colour(tables, (np.float32(dx), np.float32(dy), np.float32(dz))),
    )
    for y in range(height):
        for x in range(width):
            known = min(np.int64(count[y, x]), layers)
            ox = lines[0, 0] + x * lines[1, 0] + y * lines[2, 0]
            oy = lines[0, 1] + x * lines[1, 1] + y * lines[2, 1]
            oz = lines[0, 2] + x * lines[1, 2] + y * lines[2, 2]
            for i in range(known):
                face, t = prim_id[i, y, x], np.float64(depth[i, y, x])
                px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
                u = places[face, 0] * px + places[face, 1] * py + places[face, 2] * pz + places[face, 3]
                v = places[face, 4] * px + places[face, 5] * py + places[face, 6] * pz + places[face, 7]
                texel = np.int64(NOWHERE)
                if u >= 0.0 and v >= 0.0 and u < tables.width and v < rows:  # false of NaN: it has no place
                    texel = np.int64(texel_of[np.int64(v) * tables.width + np.int64(u)])
                facing = tables.planes[face, 0] * dx + tables.planes[face, 1] * dy + tables.planes[face, 2] * dz
                on_ray[0, i] = texel if facing < 0.0 else NOTHING
                on_ray[1, i] = texel if facing > 0.0 else NOTHING
            for i in range(known):
                ahead = np.int64(on_ray[0, i] == NOTHING)
                texel = on_ray[ahead, i]
                if texel < 0:
                    continue
                step = 2 * ahead - 1
                j, t = i + step, depth[i, y, x]
                while 0 <= j < known and abs(depth[j, y, x] - t) < nearest:
                    j += step
                if 0 <= j < known:
                    fresh[texel, 0] += np.float32(1.0)
                    source = on_ray[1 - ahead, j]
                    if source >= 0:
                        face = prim_id[j, y, x]
                        for order in range(bounces):
                            for channel in range(3):
                                word = 3 * order + channel
                                fresh[texel, 4 + word] += tables.albedo[face, channel] * light[source, word]
                elif ahead == 0 or count[y, x] == known:
                    fresh[texel, 0] += np.float32(1.0)
                    for channel in range(3):
                        fresh[texel, 1 + channel] += skies[ahead][channel]
