"""Kernels of path tracing, one path after the other."""

from __future__ import annotations

from atra.compiled.store import float_kernel, njit
from atra.embree.packets_kernels import INFINITY, MISS, START, hit_distance, hit_prim_id, intersect, set_no_hit
from atra.light.emitters.emitters_kernels import aim, has_emitters
from atra.light.numbers_kernels import ZERO, scaled, unit, vector
from atra.light.pictures.path_kernels import (
    FREE_LAMP,
    FREE_LIGHT,
    add_light,
    arriving,
    load_ray,
    passed,
    passes_of,
    path_key,
    pixel_line,
    seen_by,
    shadows,
    survival,
)
from atra.light.scattering.spots_kernels import WHITE, scatter, spot_of
from atra.light.surface_kernels import ENDS, SHINES


@njit(forceinline=True)
def _hit_of_ray(scene, packet, origin, direction, near):  # type: ignore[no-untyped-def]
    """What one ray hits beyond a distance, and how far away, by a packet of 1."""
    load_ray(packet, 1, 0, origin, direction, INFINITY, near)
    packet.valid[0] = -1
    set_no_hit(packet, 1, 0)
    intersect(1, packet.valid, scene, packet)
    return hit_prim_id(packet, 1, 0), hit_distance(packet, 1, 0)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, emitters, sums, free, max_depth, roulette):  # type: ignore[no-untyped-def]
    """All stages for one path after the other, with a packet of 1; the alternative to waves. Arguments as for the
    stages. free: (FREE_ROWS, 1) float32, scratch.

    Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays = True, 0
    is_aimed, sample = has_emitters(emitters), pixels.sample
    for pixel in range(first, first + count):
        key = path_key(pixel)
        origin, direction = pixel_line(pixels, pixel)
        direction = unit(direction)
        weight, density, near = WHITE, ZERO, START
        bounce = passes = 0
        is_known = len(pixels.prim_id) > 0
        while True:
            if is_known:
                prim_id, distance = seen_by(pixels, pixel), START
                is_known = False
            else:
                rays += 1
                prim_id, distance = _hit_of_ray(scene, packet, origin, direction, near)
            flags = surfaces.flags[prim_id] if prim_id != MISS else ENDS | SHINES
            if flags & passes_of(bounce):
                near, weight = passed(
                    surfaces, prim_id, origin, direction, distance, weight, bounce == 0, (key, sample, passes + bounce)
                )
                if near > ZERO:
                    passes += 1
                    continue
            if flags & SHINES:
                light = arriving(surfaces, emitters, prim_id, origin, direction, density)
                is_finite &= add_light(sums, pixel, weight, light)
            if flags & ENDS or bounce == max_depth - 1:
                break
            spot, is_front = spot_of(surfaces, prim_id, origin, direction)
            if is_aimed:
                length, start, towards, light, free[FREE_LAMP, 0] = aim(
                    surfaces, emitters, spot, prim_id, direction, key, sample, bounce
                )
                if length > ZERO:
                    rays += 1
                    load_ray(packet, 1, 0, start, towards, length)
                    packet.valid[0] = -1
                    shadows(1, surfaces, scene, packet, free)
                    red, green, blue = vector(free, FREE_LIGHT, 0)
                    if red + green + blue > ZERO:
                        is_finite &= add_light(sums, pixel, weight, (red * light[0], green * light[1], blue * light[2]))
            goes_on, origin, direction, factor, density = scatter(
                surfaces, spot, is_front, prim_id, direction, key, sample, bounce
            )
            if not goes_on:
                break
            weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
            if bounce >= roulette:
                factor = survival(weight, key, sample, bounce)
                if factor == ZERO:
                    break
                weight = scaled(factor, weight)
            near = START
            bounce += 1
    return rays if is_finite else -1
