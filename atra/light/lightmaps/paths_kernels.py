"""Kernels of a bake that follows paths one after the other: those of texels, and those of probes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY
from atra.light import numbers_kernels
from atra.light.emitters.emitters_kernels import FROM_SKY, has_emitters
from atra.light.emitters.sky_kernels import HARMONICS, harmonics_at
from atra.light.lightmaps.charts.texels_kernels import corners_of, edges_of, point_at, slopes_of, weights_at
from atra.light.numbers_kernels import ONE, ZERO, key_of, mixed, on_sphere, scaled
from atra.light.pictures.following_kernels import aimed, follow, more
from atra.light.scattering.sampler_kernels import DIRECTION, JITTER, pair_of
from atra.light.scattering.seen_kernels import UNSEEN
from atra.light.scattering.spots_kernels import (
    BLACK,
    LAMBERTIAN,
    NO_FRAME,
    NOTHING,
    PER_SPHERE,
    WHITE,
    Matter,
    Spot,
    scatter,
    spot_of,
)
from atra.light.surface_kernels import leaving

DIRECT, INDIRECT, ENVIRONMENT, OPEN, BACK = 0, 3, 6, 9, 10
CHANNELS, RESULTS = 9, 11
"""Results of a sample: three kinds of light with three channels; then 1 or 0 for "nothing near by" and "sees a back
face"."""

SQUARE, HALF, CHANGE, BEFORE = RESULTS, RESULTS + 1, RESULTS + 2, RESULTS + 3
SUMS = RESULTS + 4
"""float64 numbers of a texel: sums of its results and of the squared luminance of all light; its mean luminance when
its samples last were a power of two; and by how much that differed from the mean of half as many, squared, then and one
doubling earlier."""

LUMINANCE = tuple(np.float32(weight) for weight in numbers_kernels.LUMINANCE)
"""Weights of linear RGB (Rec. 709), float32."""

INSET = 2.0
"""Distance of points from a triangle's rim, where another surface may stand, in offsets of rays."""


class Charts(NamedTuple):
    """Where texels lie. vertices: (V, 3) float32. faces: (F, 3) uint32. uv: (F, 3, 2) float64, texels. prim_id: (N,)
    int32, number: (N,) int64, of each texel. width: texels of a row. open_length: distance below which a thing
    occludes. seed: of random numbers."""

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    uv: NDArray[np.float64]
    prim_id: NDArray[np.int32]
    number: NDArray[np.int64]
    width: int
    open_length: np.float32
    seed: np.uint32


@njit
def sequence_key(number, seed):  # type: ignore[no-untyped-def]
    """A uint32 key for the evenly spread numbers of all samples of a texel or probe."""
    return key_of(np.uint32(number), mixed(np.uint32(seed)))


@njit(forceinline=True)
def _white(spot):  # type: ignore[no-untyped-def]
    """The same place of a surface that reflects all light equally to all sides."""
    kind, matter = np.int64(LAMBERTIAN), _white_matter()
    return Spot(spot.point, spot.normal, spot.shaded, kind, spot.material, matter, NO_FRAME, UNSEEN)


@njit(forceinline=True)
def _white_matter():  # type: ignore[no-untyped-def]
    return Matter(WHITE, ZERO, ONE, ZERO, ONE, False, BLACK, ZERO, ZERO, ZERO)


@njit(forceinline=True)
def place_in_texel(charts, surfaces, texel):  # type: ignore[no-untyped-def]
    """What all samples of a texel share: its face, (column, row) in the map, edges, corners, slopes, and the face's
    unit normal, float32."""
    face, number = charts.prim_id[texel], charts.number[texel]
    row = number // charts.width
    edges, corners = edges_of(charts.uv, face), corners_of(charts.vertices, charts.faces, face)
    records = surfaces.records
    normal = np.float32(records[face, 0]), np.float32(records[face, 1]), np.float32(records[face, 2])
    return face, (number - row * charts.width, row), edges, corners, slopes_of(edges), normal


@njit(forceinline=True)
def start_in(surfaces, place, key, sample):  # type: ignore[no-untyped-def]
    """float32 point above a texel, where one of its samples starts. place: of `place_in_texel`."""
    face, (column, row), edges, corners, slopes, normal = place
    x, y = pair_of(key, sample, JITTER)
    v, w = weights_at(edges, slopes, column + np.float64(x), row + np.float64(y))
    inset = INSET * surfaces.records[face, 4]
    return leaving(surfaces, face, point_at(corners, v, w, inset), normal)


@njit(forceinline=True)
def white_spot(surfaces, face, above, down):  # type: ignore[no-untyped-def]
    """The `Spot` of a white face below a point. A map holds light, so the face's own colour does not count."""
    spot, _ = spot_of(surfaces, face, above, down)
    return _white(spot)


@float_kernel
def light_texels(  # type: ignore[no-untyped-def]
    order, first, count, more_samples, samples, charts, surfaces, emitters, limits, scene, packet, free, sums, told
):  # fmt: skip
    """Add `more_samples` to `count` texels from place `first` of the order on, and count them.

    order: (M,) int32, numbers of texels. samples: (N,) int32, so far. scene, packet: of width 1. free: (FREE_ROWS, 1)
    float32, scratch. sums: (N, SUMS) float64. told: (2,) int64, gets the number of rays, and of a texel whose light is
    not finite.
    """
    rays, is_aimed = 0, has_emitters(emitters)
    for at in range(first, first + count):
        texel = order[at]
        place = place_in_texel(charts, surfaces, texel)
        face, down, key = place[0], scaled(-ONE, place[5]), sequence_key(charts.number[texel], charts.seed)
        for sample in range(samples[texel], samples[texel] + more_samples):
            spot = white_spot(surfaces, face, start_in(surfaces, place, key, sample), down)
            direct, sky = BLACK, BLACK
            if is_aimed:
                light, kind, _, traced = aimed(
                    surfaces, emitters, scene, packet, free, spot, face, down, key, sample, 0
                )
                rays += traced
                if kind == FROM_SKY:
                    sky = light
                else:
                    direct = light
            _, origin, direction, _, density = scatter(surfaces, spot, True, face, down, key, sample, 0)
            found = follow(
                surfaces, emitters, scene, packet, free, np.int64(-1), origin, direction, density, (key, sample), 1,
                limits,
            )  # fmt: skip
            rays += found.rays
            direct, sky = more(direct, WHITE, found.emitted), more(sky, WHITE, found.sky)
            is_open = not found.distance < charts.open_length
            if not add_sample(sums, texel, sample, direct, found.later, sky, is_open, found.is_back):
                told[1] = texel
        samples[texel] += more_samples
    told[0] = rays


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


@njit(forceinline=True)
def add_sample(sums, texel, sample, direct, later, sky, is_open, is_back):  # type: ignore[no-untyped-def]
    """Add a texel's sample to its row of sums, (N, SUMS) float64; returns whether its light is finite."""
    luminance = ZERO
    for channel in range(3):
        sums[texel, DIRECT + channel] += direct[channel]
        sums[texel, ENVIRONMENT + channel] += sky[channel]
        sums[texel, INDIRECT + channel] += later[channel]
        luminance += LUMINANCE[channel] * (direct[channel] + sky[channel] + later[channel])
    sums[texel, OPEN] += 1.0 if is_open else 0.0
    sums[texel, BACK] += 1.0 if is_back else 0.0
    sums[texel, SQUARE] += np.float64(luminance) * luminance
    note_doubling(sums, texel, sample + 1)
    return luminance < INFINITY


@njit(forceinline=True)
def project(light, direction, first, sums):  # type: ignore[no-untyped-def]
    """Add light from a direction, times the harmonics, to channels from `first` on of sums, (CHANNELS, HARMONICS)."""
    weights = harmonics_at(np.float64(direction[0]), np.float64(direction[1]), np.float64(direction[2]))
    for channel in range(len(light)):
        for one in range(HARMONICS):
            sums[first + channel, one] += light[channel] * weights[one]


@float_kernel
def light_probes(  # type: ignore[no-untyped-def]
    points, first, count, samples, charts, surfaces, emitters, limits, scene, packet, free, sums, backs, told
):  # fmt: skip
    """Add the light around `count` points from number `first` on, by `samples` paths each.

    points: (P, 3) float32. sums: (P, CHANNELS, HARMONICS) float64. backs: (P,) int64, paths that meet a back face
    first. Other arguments as for `light_texels`.
    """
    rays, is_aimed = 0, has_emitters(emitters)
    nowhere, face = BLACK, np.uint32(0)
    for probe in range(first, first + count):
        place = points[probe, 0], points[probe, 1], points[probe, 2]
        point = np.float64(place[0]), np.float64(place[1]), np.float64(place[2])
        key = sequence_key(probe, charts.seed)
        kind, material = np.int64(NOTHING), np.int64(0)
        spot = Spot(point, nowhere, nowhere, kind, material, _white_matter(), NO_FRAME, UNSEEN)
        for sample in range(samples):
            if is_aimed:
                light, kind, towards, traced = aimed(
                    surfaces, emitters, scene, packet, free, spot, face, nowhere, key, sample, 0
                )
                rays += traced
                project(light, towards, ENVIRONMENT if kind == FROM_SKY else DIRECT, sums[probe])
            u, v = pair_of(key, sample, DIRECTION)
            direction = on_sphere(u, v)
            found = follow(
                surfaces, emitters, scene, packet, free, np.int64(-1), place, direction, PER_SPHERE, (key, sample), 1,
                limits,
            )  # fmt: skip
            rays += found.rays
            project(found.emitted, direction, DIRECT, sums[probe])
            project(found.sky, direction, ENVIRONMENT, sums[probe])
            project(found.later, direction, INDIRECT, sums[probe])
            backs[probe] += 1 if found.is_back else 0
        for channel in range(CHANNELS):
            if not abs(sums[probe, channel, 0]) < INFINITY:
                told[1] = probe
    told[0] = rays
