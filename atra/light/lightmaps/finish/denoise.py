"""Denoising of lightmaps, chart by chart."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light.lightmaps.finish.seams import nearest_known
from atra.light.lightmaps.maps import LIGHTS, Lightmap
from atra.light.lightmaps.paths_kernels import LUMINANCE
from atra.light.oidn import denoiser

FEWEST = 16
"""Charts with fewer texels are left as they are."""

_BLUR = 2.0
"""Width in texels of the Gaussian means that fill gutters; streaks of noise there would pass for light."""


def denoised(lightmap: Lightmap, threads: int | None = None) -> Lightmap:
    """The lightmap with less noise. Openness, sample counts and texels that are not `valid` stay as they are.

    Each chart is denoised as an image of its own, because charts in one image would leak light into each other. Each
    kind of light is denoised on its own. If denoising changes a chart by more than its noise explains, the change is
    scaled down to that fraction. threads: None = every core. Raises InputError without the package pyoidn, AtraError if
    it fails. Sources: Intel Open Image Denoise, filter RTLightmap, https://www.openimagedenoise.org; the scaling
    follows the positive part of James and Stein's estimator (1961), which assumes a target independent of the noise.
    """
    names = LIGHTS[:-1]
    values: dict[str, Any] = {name: lightmap.light(name).copy() for name in names}
    numbers = np.flatnonzero(lightmap.valid)
    chart = lightmap.texels.chart[numbers]
    order = numbers[np.argsort(chart, kind="stable")]
    row, column = np.divmod(lightmap.texels.number, lightmap.texels.atlas.width)
    with denoiser(threads) as filtered:
        for of_chart in np.split(order, np.cumsum(np.bincount(chart))[:-1]):
            if len(of_chart) < FEWEST:
                continue
            place = tuple(axis[of_chart] - axis[of_chart].min() for axis in (row, column))
            for light in values.values():
                if light[of_chart].any():
                    light[of_chart] = filtered(color=_filled(place, light[of_chart]))[place]
            share = _share_of_noise(lightmap, of_chart, sum(light[of_chart] for light in values.values()))
            for name, light in values.items():
                raw = lightmap.light(name)[of_chart]
                light[of_chart] = raw + share * (light[of_chart] - raw)
    return replace(lightmap, **values)


def _share_of_noise(lightmap: Lightmap, texels: NDArray[np.int64], clean: NDArray[np.float32]) -> np.float32:
    """Fraction of the denoiser's change that the texels' noise explains, 0 to 1; 1 where single samples tell no noise.
    clean: (N, 3), all their light."""
    samples = lightmap.samples[texels]
    if samples.min() < 2:
        return np.float32(1.0)
    taken = float((((lightmap.combined[texels] - clean) @ np.array(LUMINANCE)) ** 2).sum())
    noise = lightmap.squared_error(texels)
    return np.float32(min(1.0, noise / taken) if taken > 0.0 else 1.0)


def _filled(place: tuple[NDArray[np.int64], ...], values: NDArray[np.float32]) -> NDArray[np.float32]:
    """(H, W, 3) image of (N, 3) values at their rows and columns, with means of the neighbourhood in between."""
    from scipy.ndimage import gaussian_filter

    shape = tuple(int(axis.max()) + 1 for axis in place)
    known, image = np.zeros((*shape, 1)), np.zeros((*shape, 3))
    known[place], image[place] = 1.0, values
    near, sums = (gaussian_filter(one, (_BLUR, _BLUR, 0.0), mode="constant") for one in (known, image))
    means = (sums[place] / near[place])[nearest_known(place, shape)]
    return np.where(known > 0.0, image, means).astype(np.float32)
