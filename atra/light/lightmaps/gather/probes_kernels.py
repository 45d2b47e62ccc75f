"""Kernels of light probes: first rays and directions, and sums of spherical harmonics."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import float_kernel, njit
from atra.light.emitters.harmonics_kernels import HARMONICS, harmonics_at
from atra.light.lightmaps.gather.tables_kernels import (
    BACK,
    CHANNELS,
    DIRECTION,
    LENGTH,
    NORMAL,
    ORIGIN,
    RESULTS,
    WEIGHT,
)
from atra.light.lightmaps.samples_kernels import sample_key, sequence_key
from atra.light.numbers_kernels import ZERO, bits_of, mixed, on_sphere, set_vector, unit_of, vector
from atra.light.scattering.spots_kernels import WHITE

_STEPS = np.uint32(3242174889), np.uint32(2447445414)
"""Steps of the R2 sequence, times 2^32. Source: M. Roberts, "The unreasonable effectiveness of quasirandom
sequences"."""

_NOWHERE = ZERO, ZERO, ZERO


@njit
def _first_direction(probe, sample, seed):  # type: ignore[no-untyped-def]
    """The first direction of a probe's sample: uniform over the sphere, and evenly spread over a probe's samples."""
    key = mixed(np.uint32(np.uint32(probe) ^ mixed(seed)))
    u = np.uint32(bits_of(key, np.uint32(0)) + np.uint32(sample) * _STEPS[0])
    v = np.uint32(bits_of(key, np.uint32(1)) + np.uint32(sample) * _STEPS[1])
    return on_sphere(unit_of(u), unit_of(v))


@float_kernel
def generate_probes(batch, points, first, probes, sample, samples, tables):  # type: ignore[no-untyped-def]
    """Write samples `sample` to `sample + samples` of `probes` points from number `first` on, side by side.

    points: (P, 3) float32.
    """
    for k in range(probes):
        for e in range(samples):
            i = k * samples + e
            batch.slot[i], batch.alive[i] = i, 1
            for one in range(RESULTS):
                batch.results[i, one] = ZERO
            batch.key[i] = sample_key(first + k, sample + e, tables.seed)
            batch.sequence[i], batch.sample[i] = sequence_key(first + k, tables.seed), sample + e
            place = points[first + k, 0], points[first + k, 1], points[first + k, 2]
            set_vector(batch.floats, ORIGIN, i, place)
            set_vector(batch.floats, NORMAL, i, _NOWHERE)
            set_vector(batch.floats, WEIGHT, i, WHITE)


@float_kernel
def look_around(batch, first, probes, sample, samples, tables):  # type: ignore[no-untyped-def]
    """Set the first direction of each path."""
    for k in range(probes):
        for e in range(samples):
            direction = _first_direction(first + k, sample + e, tables.seed)
            set_vector(batch.floats, DIRECTION, k * samples + e, direction)


@njit(forceinline=True)
def project(light, direction, first, sums):  # type: ignore[no-untyped-def]
    """Add light from a direction, times the harmonics, to channels from `first` on of sums, (CHANNELS, HARMONICS)."""
    weights = harmonics_at(np.float64(direction[0]), np.float64(direction[1]), np.float64(direction[2]))
    for channel in range(len(light)):
        for one in range(HARMONICS):
            sums[first + channel, one] += light[channel] * weights[one]


@float_kernel
def gather_light(batch, first, probes, samples, sums):  # type: ignore[no-untyped-def]
    """As `gather_paths`, for the results of rays to a light; these results are reset."""
    for k in range(probes):
        for e in range(samples):
            i = k * samples + e
            if batch.floats[LENGTH, i] > ZERO:
                project(batch.results[i, :CHANNELS], vector(batch.floats, DIRECTION, i), 0, sums[first + k])
                for channel in range(CHANNELS):
                    batch.results[i, channel] = ZERO


@float_kernel
def gather_paths(batch, first, probes, sample, samples, tables, sums, backs):  # type: ignore[no-untyped-def]
    """Add results times the harmonics of first directions to sums, (P, CHANNELS, HARMONICS) float64, sample by sample,
    and count back faces seen, (P,) int64. Returns a probe whose light is not finite, or -1."""
    bad = -1
    for k in range(probes):
        for e in range(samples):
            i = k * samples + e
            direction = _first_direction(first + k, sample + e, tables.seed)
            project(batch.results[i, :CHANNELS], direction, 0, sums[first + k])
            backs[first + k] += batch.results[i, BACK] > ZERO
        for channel in range(CHANNELS):
            if not abs(sums[first + k, channel, 0]) < np.inf:
                bad = first + k
    return bad
