"""What finishing a map gains: denoising, and stitching its seams."""

from math import sqrt
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.light import Baker, Lightmap, Seams, denoised, dilated

_REFERENCE = 4
"""Samples of the raw map that a denoised one is compared with, as a multiple of its own."""


def finishing(baker: Baker, other: Baker, samples: int, threads: int) -> dict[str, float | None]:
    """What denoising and stitching gain on a map of so many samples, beside raw maps of `_REFERENCE` times as many.

    baker, other: by different random numbers. The raw maps' error is found from their difference, as their variances
    forecast too much of it.
    """
    fill(baker, samples)
    raw = baker.maps
    start = perf_counter()
    clean = denoised(raw, threads)
    denoise_s = perf_counter() - start
    for one in (baker, other):
        fill(one, _REFERENCE * samples)
    own, known = baker.maps, other.maps
    used = raw.valid & own.valid & known.valid
    noise = float(squared_differences(own, known)[used].mean()) / 2.0
    square = float(squared_differences(clean, known)[used].mean()) - noise
    seams = Seams.of(raw.texels.mesh, raw.texels.atlas)
    image = dilated(raw.texels, raw.combined, raw.valid)
    before = seams.step(image)
    return {
        "denoise_s": denoise_s,
        "denoised_ratio": sqrt(max(square, 0.0) / noise) if noise > 0.0 else None,
        "seam_step_ratio": seams.step(seams.stitched(image)) / before if before > 0.0 else None,
    }


def fill(baker: Baker, samples: int) -> None:
    """Give every texel so many samples in all."""
    while baker.advance(samples):
        pass


def squared_differences(one: Lightmap, other: Lightmap) -> NDArray[np.float64]:
    """(N,) squares of the differences in luminance between two maps of the same N texels."""
    return (one.luminance - other.luminance).astype(np.float64) ** 2
