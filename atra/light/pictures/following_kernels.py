"""Kernels that follow a path of light from where it starts to its end, one ray after the other."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY, MISS, START, hit_distance, hit_prim_id, intersect, set_no_hit
from atra.geometry.view import View
from atra.light.emitters.emitters_kernels import aim, has_emitters
from atra.light.numbers_kernels import ONE, ZERO, along, circle, dot, scaled, unit, vector
from atra.light.pictures.path_kernels import (
    FREE_KIND,
    FREE_LIGHT,
    add_light,
    arriving,
    behind,
    load_ray,
    passed,
    passes_of,
    path_key,
    pixel_line,
    seen_by,
    shadows,
    survival,
)
from atra.light.scattering.bending_kernels import passed_within
from atra.light.scattering.sampler_kernels import APERTURE, pair_of
from atra.light.scattering.spots_kernels import BLACK, WHITE, scatter, spot_of
from atra.light.surface_kernels import ENDS, SHINES, meet

_NEVER = 1 << 30

ALPHA = 3
"""Plane of the film that holds the share of a pixel which is not sky."""

_THIRDS = np.float32(1.0 / 3.0), np.float32(1.0 / 3.0), np.float32(1.0 / 3.0)


class Limits(NamedTuple):
    """Where paths end. max_depth: surfaces that they meet at most, or, of texels, one more. roulette: surfaces after
    which they may end by chance. clamp: most that each emitter may add at once by more than one reflection."""

    max_depth: int
    roulette: int
    clamp: np.float32


def limits_of(bounces: int, roulette_from: int | None, clamp: float | None, first: int = 0) -> Limits:
    """Limits of paths of at most so many reflections between an emitter and where they start. roulette_from:
    reflections after which they may end by chance, None = never. clamp: as of `Limits`, None = no limit. first: 1 for
    paths that start on a surface."""
    most = INFINITY if clamp is None else np.float32(clamp)
    return Limits(bounces + 1 + first, _NEVER if roulette_from is None else roulette_from, most)


class Found(NamedTuple):
    """What a path has found: (r, g, b) that the first surface it meets emits, that the sky sends straight, and all
    light that reaches it later. seen_through: (r, g, b), the share of the sky's light that arrives straight. distance:
    to the first surface. is_back: whether it is its back. rays: traced."""

    emitted: tuple[np.float32, np.float32, np.float32]
    sky: tuple[np.float32, np.float32, np.float32]
    later: tuple[np.float32, np.float32, np.float32]
    seen_through: tuple[np.float32, np.float32, np.float32]
    distance: np.float32
    is_back: bool
    rays: int


@njit(forceinline=True)
def more(total, weight, light):  # type: ignore[no-untyped-def]
    """Add weighted light, (r, g, b) each."""
    return total[0] + weight[0] * light[0], total[1] + weight[1] * light[1], total[2] + weight[2] * light[2]


@njit(forceinline=True)
def _clamped(weight, light, most):  # type: ignore[no-untyped-def]
    """(r, g, b) of light, scaled so that, weighted, no channel is above `most`."""
    greatest = max(weight[0] * light[0], max(weight[1] * light[1], weight[2] * light[2]))
    return scaled(most / greatest, light) if most < greatest < INFINITY else light


@njit(forceinline=True)
def aimed(surfaces, emitters, scene, packet, free, spot, prim_id, direction, key, sample, bounce):  # type: ignore[no-untyped-def]
    """((r, g, b), kind, direction, rays): light that reaches a path from an emitter at which a ray is aimed; kind and
    direction as of `aim`. free: (FREE_ROWS, 1) float32, scratch."""
    length, start, towards, light, kind = aim(surfaces, emitters, spot, prim_id, direction, key, sample, bounce)
    if not length > ZERO:
        return BLACK, kind, towards, 0
    free[FREE_KIND, 0] = kind
    load_ray(packet, 1, 0, start, towards, length)
    packet.valid[0] = -1
    shadows(1, surfaces, scene, packet, free)
    red, green, blue = vector(free, FREE_LIGHT, 0)
    return (red * light[0], green * light[1], blue * light[2]), kind, towards, 1


@njit
def follow(surfaces, emitters, scene, packet, free, known, origin, direction, density, random, bounce, limits):  # type: ignore[no-untyped-def]
    """`Found` by the path that starts with a ray.

    known: what the ray meets, where that is known; -1: not yet. density: of the direction, as of `scatter`; 0 where
    nothing was aimed. random: (key, sample). bounce: 0 for rays of the eye, 1 for rays that a surface scatters. scene,
    packet: of width 1.
    """
    key, sample = random
    start, is_aimed = bounce, has_emitters(emitters)
    emitted, sky, later, seen_through, weight = BLACK, BLACK, BLACK, BLACK, WHITE
    near, first, is_back, before = START, INFINITY, False, MISS
    rays = passes = 0
    while True:
        if known >= 0:
            prim_id, distance = np.uint32(known), START
            known = np.int64(-1)
        else:
            rays += 1
            load_ray(packet, 1, 0, origin, direction, INFINITY, near)
            packet.valid[0] = -1
            set_no_hit(packet, 1, 0)
            intersect(1, packet.valid, scene, packet)
            prim_id, distance = hit_prim_id(packet, 1, 0), hit_distance(packet, 1, 0)
            if prim_id == before and prim_id != MISS:
                near = behind(distance)
                continue
        flags = surfaces.flags[prim_id] if prim_id != MISS else ENDS | SHINES
        if flags & passes_of(bounce):
            goes_on, weight = passed(
                surfaces, prim_id, origin, direction, weight, bounce == 0, (key, sample, passes + bounce)
            )
            if goes_on:
                near, before = behind(distance), prim_id
                passes += 1
                continue
        if bounce == start and start > 0:
            first = distance
            is_back = prim_id != MISS and not meet(surfaces, prim_id, origin, direction)[2]
        if flags & SHINES:
            light = arriving(surfaces, emitters, prim_id, origin, direction, density)
            if bounce > start:
                later = more(later, weight, _clamped(weight, light, limits.clamp) if bounce > 1 else light)
            elif prim_id == MISS:
                sky, seen_through = more(sky, weight, light), weight
            else:
                emitted = more(emitted, weight, light)
        if flags & ENDS or bounce == limits.max_depth - 1:
            break
        spot, is_front = spot_of(surfaces, prim_id, origin, direction)
        if not (is_front or spot.matter.is_thin):
            way = spot.point[0] - origin[0], spot.point[1] - origin[1], spot.point[2] - origin[2]
            left = passed_within(surfaces, spot.material, np.sqrt(dot(way, way)))
            weight = weight[0] * left[0], weight[1] * left[1], weight[2] * left[2]
        if is_aimed:
            light, _, _, traced = aimed(
                surfaces, emitters, scene, packet, free, spot, prim_id, direction, key, sample, bounce
            )
            rays += traced
            later = more(later, weight, _clamped(weight, light, limits.clamp) if bounce > 0 else light)
        goes_on, origin, direction, factor, density = scatter(
            surfaces, spot, is_front, prim_id, direction, key, sample, bounce
        )
        if not goes_on:
            break
        weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
        if bounce >= limits.roulette:
            share = survival(weight, key, sample, bounce)
            if share == ZERO:
                break
            weight = scaled(share, weight)
        near, before = START, MISS
        bounce += 1
    return Found(emitted, sky, later, seen_through, first, is_back, rays)


class Aperture(NamedTuple):
    """Where rays start. axes: (2, 3) float32, its radius to the right and down, in the world; none of a pinhole.
    nearness: of what is in focus, 1 over its depth."""

    axes: NDArray[np.float32]
    nearness: np.float32


def aperture_of(camera: View, radius: float, focus_distance: float) -> Aperture:
    """The aperture of a camera. radius, focus_distance: scene units."""
    axes = (radius * camera.axes[:2]).astype(np.float32)
    return Aperture(axes if radius > 0.0 else axes[:0], np.float32(1.0 / focus_distance))


@njit(forceinline=True)
def _through(aperture, key, sample, origin, direction):  # type: ignore[no-untyped-def]
    """(origin, direction) from a point of the aperture to the point that the ray given has in focus. direction: of
    depth 1, as is the one returned."""
    square, turns = pair_of(key, sample, APERTURE)
    axes, radius, (right, down) = aperture.axes, np.sqrt(square), circle(turns)
    shift = (
        radius * (right * axes[0, 0] + down * axes[1, 0]),
        radius * (right * axes[0, 1] + down * axes[1, 1]),
        radius * (right * axes[0, 2] + down * axes[1, 2]),
    )
    return along(origin, ONE, shift), along(direction, -aperture.nearness, shift)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, emitters, sums, free, limits, aperture):  # type: ignore[no-untyped-def]
    """Add a sample of `count` pixels from number `first` on, one path after the other.

    scene, packet: of width 1. sums: (3 or 4, pixels) float32 of a `Film`. free: (FREE_ROWS, 1) float32, scratch.
    limits: `Limits`. aperture: `Aperture`. Where `sums` have a plane ALPHA, the sky that the eye sees is left out, and
    the share of it that is hidden is added there. Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays, is_known = True, 0, len(pixels.prim_id) > 0
    for pixel in range(first, first + count):
        origin, direction = pixel_line(pixels, pixel)
        known = np.int64(seen_by(pixels, pixel)) if is_known else np.int64(-1)
        random = path_key(pixel), pixels.sample
        if len(aperture.axes) > 0:
            origin, direction = _through(aperture, random[0], random[1], origin, direction)
        found = follow(
            surfaces, emitters, scene, packet, free, known, origin, unit(direction), ZERO, random, 0, limits
        )  # fmt: skip
        rays += found.rays
        light = more(found.emitted, WHITE, found.later)
        if sums.shape[0] > ALPHA:
            sums[ALPHA, pixel] += ONE - dot(found.seen_through, _THIRDS)
        else:
            light = more(light, WHITE, found.sky)
        is_finite &= add_light(sums, pixel, WHITE, light)
    return rays if is_finite else -1
