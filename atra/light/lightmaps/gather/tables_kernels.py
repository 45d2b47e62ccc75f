"""The tables and batches of a bake, as kernels read them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit

SUN, POINT, SPHERE, SPOT, EMITTERS, SKY = 0, 1, 2, 3, 4, 5
KIND, PLACE, SIZE, ACROSS, UP, COLOUR = 0, 1, 4, 5, 8, 11
LIGHT_WORDS = 14
"""float32 numbers of a light; before COLOUR as in `atra.light.lights_kernels`. COLOUR: times power (3). All emitting
faces are one light, and so is the sky; they have tables of their own, and only the grid reads their words."""

ORIGIN, NORMAL, DIRECTION, WEIGHT, CARRIED, LENGTH = 0, 3, 6, 9, 12, 15
PATH_ROWS = 16

DIRECT, INDIRECT, ENVIRONMENT, OPEN, BACK = 0, 3, 6, 9, 10
CHANNELS, RESULTS = 9, 11
"""Results of a sample: three kinds of light with three channels; then 1 or 0 for "nothing near by" and "sees a back
face"."""

SQUARE, HALF, CHANGE, BEFORE = RESULTS, RESULTS + 1, RESULTS + 2, RESULTS + 3
SUMS = RESULTS + 4
"""float64 numbers of a texel: sums of its results and of the squared luminance of all light; its mean luminance when
its samples last were a power of two; and by how much that differed from the mean of half as many, squared, then and one
doubling earlier."""

LUMINANCE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)
"""Weights of linear RGB (Rec. 709)."""

GIVES_BOTH, GIVES_LIGHT, GIVES_BSDF = 0, 1, 2
"""What finds the sky's light: rays aimed at it and scattered rays, weighted; or one of them alone."""


@njit(forceinline=True)
def note_doubling(sums, texel, samples):  # type: ignore[no-untyped-def]
    """Keep how a texel's mean has changed, if its samples have doubled."""
    if samples & (samples - 1) != 0:
        return
    total = 0.0
    for channel in range(3):
        light = sums[texel, DIRECT + channel] + sums[texel, INDIRECT + channel] + sums[texel, ENVIRONMENT + channel]
        total += np.float64(LUMINANCE[channel]) * light
    change = total / samples - sums[texel, HALF]
    sums[texel, BEFORE], sums[texel, CHANGE] = sums[texel, CHANGE], change * change
    sums[texel, HALF] += change


class Tables(NamedTuple):
    """A scene for the kernels of a bake.

    planes: (F, 4) float64, unit normals and n . p. vertices: (V, 3) float32. faces: (F, 3) uint32. uv: (F, 3, 2)
    float64, texels. albedo, emission: (F, 3) float32. emitters: (E,) int32, emitting faces; emitter_shares: (E,)
    float64, running sums of their probabilities; emitter_density: (F,) float32, of a point on a face. lights: (L,
    LIGHT_WORDS) float32. grid: (3, 3) float64, its lower corner, cells per unit, and numbers of cells. of_all: (C,)
    float32, probability that a cell chooses among all lights; listed: (C, K) int32, its listed lights; odds: (C, K)
    float32, their probabilities, which add up to 1 with of_all. sky, panorama: as in `Surfaces`; sky_shares: (cells,)
    float64, running sums; sky_density: (R, C) float32, of a direction, per solid angle. pane_bits: (F / 8,) uint8, a
    bit per face, lowest first: whether light passes it; unlike opacities, they fit the cache. box_of_panes: (2, 3)
    float32, around panes, with margin; zeros without. offset: how far rays start off a surface. width: texels of a row.
    open_length: distance below which a thing occludes. sky_by: what finds the sky's light. seed: of random numbers.
    """

    planes: NDArray[np.float64]
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    uv: NDArray[np.float64]
    albedo: NDArray[np.float32]
    emission: NDArray[np.float32]
    opacity: NDArray[np.float32]
    tint: NDArray[np.float32]
    emitters: NDArray[np.int32]
    emitter_shares: NDArray[np.float64]
    emitter_density: NDArray[np.float32]
    lights: NDArray[np.float32]
    grid: NDArray[np.float64]
    of_all: NDArray[np.float32]
    listed: NDArray[np.int32]
    odds: NDArray[np.float32]
    sky: NDArray[np.float32]
    panorama: NDArray[np.float32]
    sky_shares: NDArray[np.float64]
    sky_density: NDArray[np.float32]
    pane_bits: NDArray[np.uint8]
    box_of_panes: NDArray[np.float32]
    offset: np.float64
    width: int
    open_length: np.float32
    sky_by: int
    seed: np.uint32


class Batch(NamedTuple):
    """Room for N rays and the results of N samples.

    floats: (PATH_ROWS, > N) float32: origin, unit normal (0 for probes), unit direction, weight (r, g, b) of arriving
    light, and of a ray to a light what it carries (r, g, b) and its length, 0 = none. prim_id: (N,) uint32, hits.
    distance: (N,) float32, to them. key: (N,) uint32, of random numbers. slot: (N,) int32, the sample of a ray. alive:
    (N,) int8, 0 = an idle lane. sequence: (N,) uint32, a texel's or probe's key of evenly spread numbers. sample: (N,)
    uint32, the number of the sample in it. results: (N, RESULTS) float32, by slot.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    distance: NDArray[np.float32]
    key: NDArray[np.uint32]
    slot: NDArray[np.int32]
    alive: NDArray[np.int8]
    sequence: NDArray[np.uint32]
    sample: NDArray[np.uint32]
    results: NDArray[np.float32]


@njit
def choose(shares, number):  # type: ignore[no-untyped-def]
    """The first place whose running sum exceeds `number`, in [0, 1)."""
    low, high = 0, len(shares) - 1
    while low < high:
        middle = (low + high) // 2
        if shares[middle] > number:
            high = middle
        else:
            low = middle + 1
    return low
