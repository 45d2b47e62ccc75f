"""Culling: where on the image each cluster may be seen, and whether what is drawn there hides all of it.

Both are bounds. A cluster is left out only if no triangle of it can change a sample: it lies beside the image, or
every sample of its rectangle is nearer already than its box, and nothing is drawn nearer than its nearest corner.
"""

from __future__ import annotations

import numpy as np

from atra.compiled.intrinsics import fetch_add
from atra.compiled.memory import doubles_at, load, store
from atra.compiled.store import kernel, njit
from atra.compiled.vectors import arange, bits_of, folded, lane, mask_of, smaller, splat, where
from atra.exact.sums_kernels import UNIT
from atra.raster.image import SPAN

TILE = 8
"""Pixels along the sides of the squares whose farthest sample is known."""

_CHUNK = 64
"""Clusters a thread takes at a time."""

ROUNDINGS = 32.0 * UNIT
"""Error bound of positions and distances, as a share of their summands; also used where vertices are projected."""

NEARER = 2.0**-20
"""Share by which a bound of nearness is widened; rounding it to float32 changes it by less."""


@njit(forceinline=True)
def extent(a, b, c, box):  # type: ignore[no-untyped-def]
    """Lowest and highest value of a x + b y + c z in a box, and the size of its summands."""
    low = high = size = 0.0
    for factor, axis in ((a, 0), (b, 1), (c, 2)):
        one, other = factor * box[axis], factor * box[axis + 3]
        low, high = low + min(one, other), high + max(one, other)
        size += max(abs(one), abs(other))
    return low, high, size


@njit(forceinline=True)
def _projected_extent(a, b, c, d, e, f, box):  # type: ignore[no-untyped-def]
    """Lowest and highest (a x + b y + c z) / (d x + e y + f z) of a box that lies where the divisor is above 0."""
    x = where(mask_of(0b10101010, 8), splat(box[3], 8), splat(box[0], 8))
    y = where(mask_of(0b11001100, 8), splat(box[4], 8), splat(box[1], 8))
    z = where(mask_of(0b11110000, 8), splat(box[5], 8), splat(box[2], 8))
    above = splat(a, 8) * x + splat(b, 8) * y + splat(c, 8) * z
    position = above / (splat(d, 8) * x + splat(e, 8) * y + splat(f, 8) * z)
    low, high = folded(folded(folded(position))), folded(folded(folded(splat(0.0, 8) - position)))
    return lane(low, 0), -lane(high, 0)


@njit(forceinline=True)
def pixels_met(m, row, d, box, near, depth_size, margin, last):  # type: ignore[no-untyped-def]
    """First and last of the columns (row 0) or rows (row 4) up to `last` that may show something of a box in front of
    the eye. m, d: `to_pixels` and `depth_axis` of `Eye`. margin: pixels from a sample to its whole number."""
    a, b, c = m[row], m[row + 1], m[row + 2]
    low, high = _projected_extent(a, b, c, d[0], d[1], d[2], box)
    rounding = ROUNDINGS * (extent(a, b, c, box)[2] + max(abs(low), abs(high)) * depth_size) / near + margin
    return np.ceil(max(low - rounding, 0.0)), np.floor(min(high + rounding, last))


@njit(forceinline=True)
def _parallel_pixels_met(m, row, box, last):  # type: ignore[no-untyped-def]
    """As `pixels_met`, where rays are parallel."""
    low, high, size = extent(m[row], m[row + 1], m[row + 2], box)
    rounding = ROUNDINGS * (size + abs(m[row + 3]))
    return np.ceil(max(low + m[row + 3] - rounding, 0.0)), np.floor(min(high + m[row + 3] + rounding, last))


@njit
def _beyond(a, b, c, depth_axis, position, least_depth, box):  # type: ignore[no-untyped-def]
    """Lowest and highest distance, up to a positive factor, of a box from the plane through the eye and a row or column
    of the image, with all that rounding may make of it."""
    d, e, f = position * depth_axis[0], position * depth_axis[1], position * depth_axis[2]
    low, high, size = extent(a - d, b - e, c - f, box)
    rounding = ROUNDINGS * (size + extent(a, b, c, box)[2] + extent(d, e, f, box)[2]) + position * least_depth
    return low - rounding, high + rounding


@kernel
def cull_clusters(  # type: ignore[no-untyped-def]
    counter_address, boxes, eye, parallel, width, height, band_rows, rectangles, bounds
):  # fmt: skip
    """rectangles (C, 4) int32: first and last column, first and last row that may show something of each cluster, the
    last before the first where none may; bounds (C,) float32: nearness that nothing in it exceeds.

    A box that reaches to the eye plane may show its triangles in any column, at any nearness; its rows are found by
    bands, from the planes through the eye and their borders.
    """
    m, d, position = doubles_at(eye.to_pixels), doubles_at(eye.depth_axis), doubles_at(eye.position)
    least_depth = eye.least_depth
    box = np.empty(6)
    while True:
        start = fetch_add(counter_address, 1) * _CHUNK
        if start >= len(boxes):
            return
        for cluster in range(start, min(start + _CHUNK, len(boxes))):
            for axis in range(6):
                box[axis] = boxes[cluster, axis] - position[axis % 3]
            rectangles[cluster, 0], rectangles[cluster, 1] = 0, width - 1
            rectangles[cluster, 2], rectangles[cluster, 3] = 0, -1
            bounds[cluster] = np.inf
            near, far, depth_size = extent(d[0], d[1], d[2], box)
            rounding = ROUNDINGS * depth_size + least_depth
            near, far = near - rounding, far + rounding
            if far < 0.0:
                continue
            if not parallel and near <= least_depth:
                first, last = 0, height - 1
                for row in range(0, height, band_rows):
                    low, high = _beyond(m[4], m[5], m[6], d, row, least_depth, box)
                    if low > 0.0:
                        first = row
                    if high < 0.0:
                        last = min(last, row - 1)
                if (
                    _beyond(m[0], m[1], m[2], d, 0, least_depth, box)[1]
                    >= 0.0
                    >= _beyond(m[0], m[1], m[2], d, width - 1, least_depth, box)[0]
                ):
                    rectangles[cluster, 2], rectangles[cluster, 3] = first, last
                continue
            if parallel:
                left, right = _parallel_pixels_met(m, 0, box, width - 1.0)
                top, bottom = _parallel_pixels_met(m, 4, box, height - 1.0)
                bounds[cluster] = -near + abs(near) * NEARER
            else:
                left, right = pixels_met(m, 0, d, box, near, depth_size, 0.0, width - 1.0)
                top, bottom = pixels_met(m, 4, d, box, near, depth_size, 0.0, height - 1.0)
                bounds[cluster] = (1.0 + NEARER) / near
            if left <= right and top <= bottom:
                rectangles[cluster, 0], rectangles[cluster, 1] = int(left), int(right)
                rectangles[cluster, 2], rectangles[cluster, 3] = int(top), int(bottom)


@njit
def tile_stride(width):  # type: ignore[no-untyped-def]
    """Tiles from one row of them to the next in memory: a vector more than the image has."""
    return ((width + SPAN - 1) // SPAN + SPAN // 2) * (SPAN // TILE)


@njit
def forget_tiles(nothing, rows, width, tiles):  # type: ignore[no-untyped-def]
    """Nothing is drawn in any tile of so many rows of pixels yet; nothing: the nearness of that."""
    for place in range(0, (rows + TILE - 1) // TILE * tile_stride(width), SPAN):
        store(splat(nothing, SPAN), tiles + place * 4)


@njit
def find_farthest(band, width, tiles):  # type: ignore[no-untyped-def]
    """Write each tile's least nearness to the address `tiles`, float32, row by row. Beyond the image all is nearest."""
    for top in range(0, band.bottom + 1 - band.top, TILE):
        bottom = min(top + TILE, band.bottom + 1 - band.top)
        target = tiles + top // TILE * tile_stride(width) * 4
        for x in range(0, width, SPAN):
            least = load(band.nearness + (top * band.stride + x) * 4, np.float32(0.0), SPAN)
            for y in range(top + 1, bottom):
                least = smaller(least, load(band.nearness + (y * band.stride + x) * 4, np.float32(0.0), SPAN))
            store(folded(folded(folded(least))), target + x // TILE * 4)


@njit
def is_hidden(left, right, top, bottom, bound, width, tiles):  # type: ignore[no-untyped-def]
    """Whether all tiles of a rectangle, whose rows are counted from the band's first, are nearer than a bound."""
    limit = splat(bound, SPAN)
    last = splat(np.float32(right // TILE), SPAN)
    for row in range(top // TILE, bottom // TILE + 1):
        address = tiles + row * tile_stride(width) * 4
        for tile in range(left // TILE, right // TILE + 1, SPAN):
            farthest = load(address + tile * 4, np.float32(0.0), SPAN)
            if bits_of((limit >= farthest) & (arange(np.float32(tile), SPAN) <= last)) != 0:
                return False
    return True
