"""Lightmaps: the light of texels as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.light.lightmaps import paths_kernels as kept
from atra.light.lightmaps.charts.texels import Texels
from atra.light.scattering.sampler_kernels import LEAST_LEFT, MOST_LEFT

LIGHTS = ("direct", "indirect", "environment", "combined")
"""Kinds of light; the last is the sum of the others."""

_LUMINANCE = np.array(kept.LUMINANCE, np.float64)

INSIDE_SHARE = 0.5
"""A texel whose rays hit back faces in more than this share lies inside an object."""


@dataclass(frozen=True, eq=False)
class Lightmap:
    """Means of samples, texel by texel. Light is what a white surface reflects, linear RGB: irradiance divided by pi.

    texels: the N lit texels. samples: (N,) int32. direct: (N, 3) float32, from lights and emitting faces. indirect: (N,
    3) float32, after bounces. environment: (N, 3) float32, straight from the sky. openness: (N,) float32,
    cosine-weighted share of rays that hit nothing near by. backs: (N,) float32, share of rays that hit back faces.
    variance: (N,) float32, of the luminance of one sample. Samples of a texel are spread evenly, so that their mean
    varies by less than this over their number. changes: (N, 2) float32, squared changes of the mean luminance at the
    last two doublings of samples.
    """

    texels: Texels
    samples: NDArray[np.int32] = field(repr=False)
    direct: NDArray[np.float32] = field(repr=False)
    indirect: NDArray[np.float32] = field(repr=False)
    environment: NDArray[np.float32] = field(repr=False)
    openness: NDArray[np.float32] = field(repr=False)
    backs: NDArray[np.float32] = field(repr=False)
    variance: NDArray[np.float32] = field(repr=False)
    changes: NDArray[np.float32] = field(repr=False)

    @classmethod
    def of(cls, texels: Texels, samples: NDArray[np.int32], sums: NDArray[np.float64]) -> Lightmap:
        """The means of (N, SUMS) sums."""
        count = np.maximum(samples, 1)[:, None]
        means = sums / count
        direct, indirect, environment = (means[:, k : k + 3] for k in (kept.DIRECT, kept.INDIRECT, kept.ENVIRONMENT))
        luminance = (direct + indirect + environment) @ _LUMINANCE
        spread = np.maximum(0.0, means[:, kept.SQUARE] - luminance**2) * (count / np.maximum(count - 1, 1))[:, 0]
        rows = (
            direct,
            indirect,
            environment,
            means[:, kept.OPEN],
            means[:, kept.BACK],
            spread,
            sums[:, [kept.CHANGE, kept.BEFORE]],
        )
        return cls(texels, samples, *(np.ascontiguousarray(row, np.float32) for row in rows))

    @cached_property
    def combined(self) -> NDArray[np.float32]:
        """(N, 3) float32, all light."""
        return self.direct + self.indirect + self.environment

    @cached_property
    def valid(self) -> NDArray[np.bool_]:
        """(N,) bool: has samples and does not lie inside an object."""
        return (self.samples > 0) & (self.backs <= INSIDE_SHARE)

    def squared_error(self, texels: NDArray[np.int64]) -> float:
        """Estimated sum of squared errors of these texels' luminance, at least two samples each; as `accumulate` does,
        by how the map changed while samples doubled. Source: as there."""
        samples = self.samples[texels]
        doubled = 1 << np.floor(np.log2(samples)).astype(np.int64)
        last, before = self.changes[texels].astype(np.float64).T
        known = doubled >= 4
        ratio = float(last[known].sum() / max(before[known].sum(), 1e-300)) if known.any() else MOST_LEFT
        left = min(max(ratio, LEAST_LEFT), MOST_LEFT)
        return float((last * doubled / samples).sum()) * left / (1.0 - left)

    def light(self, name: str) -> NDArray[np.float32]:
        """(N, 3) float32, one of `LIGHTS`. Raises InputError for another name."""
        if name not in LIGHTS:
            raise InputError(f"light is {name!r}, expected one of {', '.join(LIGHTS)}")
        values: NDArray[np.float32] = getattr(self, name)
        return values

    @property
    def luminance(self) -> NDArray[np.float64]:
        """(N,) float64, of all light."""
        return np.asarray(self.combined @ _LUMINANCE)


def relative_error(got: NDArray[np.floating], true: NDArray[np.floating], weights: NDArray | None = None) -> float:
    """Root mean square error of luminances over the true mean. weights: per texel or pixel."""
    square = np.average((got - true) ** 2, weights=weights)
    return float(np.sqrt(square) / np.average(true, weights=weights))
