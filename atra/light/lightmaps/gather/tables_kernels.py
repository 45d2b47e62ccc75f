"""Tables of a bake, as kernels read them, and the memory of a batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import njit

SUN, POINT, SPHERE, SPOT, EMITTERS, SKY = 0, 1, 2, 3, 4, 5
KIND, PLACE, SIZE, ACROSS, UP, COLOUR, CONE = 0, 1, 4, 5, 8, 11, 14
LIGHT_WORDS = 16
"""float32 of a light; up to UP as of `atra.light.lights_kernels`. COLOUR: times its power (3). Of a spot, ACROSS is
the way it looks (3), and CONE the cosines of the angles where it begins to fade and where it ends (2). Emitting faces
are one light together, and the sky is one: both have tables of their own, and these words serve the grid alone."""

ORIGIN, NORMAL, DIRECTION, WEIGHT, CARRIED, LENGTH = 0, 3, 6, 9, 12, 15
PATH_ROWS = 16

DIRECT, INDIRECT, ENVIRONMENT, OPEN, BACK = 0, 3, 6, 9, 10
CHANNELS, RESULTS = 9, 11
"""Of a sample: three colours of three channels, then 1 or 0: nothing is near by, and the back of a face is seen."""

SQUARE = RESULTS
SUMS = RESULTS + 1
"""Of a texel, float64: sums of the results, and of the square of the luminance of all light."""

HARMONICS = 9
"""Of a probe's channel: spherical harmonics up to L2."""

LUMINANCE = np.float32(0.2126), np.float32(0.7152), np.float32(0.0722)
"""Of linear RGB (Rec. 709)."""

GIVES_BOTH, GIVES_LIGHT, GIVES_BSDF = 0, 1, 2
"""What finds the light of the sky: rays to it and rays that leave by chance, weighted; or one of them alone."""


class Tables(NamedTuple):
    """All that light meets.

    planes: (F, 4) float64, unit normals and n . p. vertices: (V, 3) float32, faces: (F, 3) uint32. uv: (F, 3, 2)
    float64, texels. albedo, emission: (F, 3) float32. emitters: (E,) int32, faces that shine; emitter_shares: (E,)
    float64, running sums of how often each is chosen, up to 1; emitter_density: (F,) float32, of a point on a face.
    lights: (L, LIGHT_WORDS) float32. grid: (3, 3) float64: its lower corner, cells per unit of length, and how many
    there are. of_all: (C,) float32, how often one of all lights is chosen in a cell; listed: (C, K) int32, lights that
    are chosen otherwise, odds: (C, K) float32, how often; they and of_all add up to 1.
    sky, panorama: as of `Surfaces`; sky_shares: (cells,) float64, running sums as above; sky_density:
    (R, C) float32, of a direction, per unit of solid angle.
    pane_bits: (F / 8,) uint8, a bit a face, lowest first: whether it lets light on; unlike opacities, they stay in
    the cache. box_of_panes: (2, 3) float32, around such faces, with room to spare; zeros where there are none.
    offset: how far rays start off a surface. width: texels of a row. open_length: how near a thing counts as near by.
    sky_by: what finds its light. seed: of random numbers.
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
    """N rays, of which the first so many are in use, and what N samples have gathered.

    floats: (PATH_ROWS, > N) float32: origin, unit normal there, or 0 in the open, unit direction, weight (r, g, b) of
    what comes from there, what a ray to a light carries (r, g, b), and how far it reaches, 0 = there is none.
    prim_id: (N,) uint32, what is hit. distance: (N,) float32, how far. key: (N,) uint32, of random numbers. slot: (N,)
    int32, the sample that this belongs to. alive: (N,) int8, 0 = an idle lane. results: (N, RESULTS) float32.
    """

    floats: NDArray[np.float32]
    prim_id: NDArray[np.uint32]
    distance: NDArray[np.float32]
    key: NDArray[np.uint32]
    slot: NDArray[np.int32]
    alive: NDArray[np.int8]
    results: NDArray[np.float32]


@njit(forceinline=True)
def vector(rows, first, index):  # type: ignore[no-untyped-def]
    return rows[first, index], rows[first + 1, index], rows[first + 2, index]


@njit(forceinline=True)
def set_vector(rows, first, index, value):  # type: ignore[no-untyped-def]
    rows[first, index], rows[first + 1, index], rows[first + 2, index] = value


@njit
def choose(shares, number):  # type: ignore[no-untyped-def]
    """The first place whose running sum lies above `number`, in [0, 1)."""
    low, high = 0, len(shares) - 1
    while low < high:
        middle = (low + high) // 2
        if shares[middle] > number:
            high = middle
        else:
            low = middle + 1
    return low
