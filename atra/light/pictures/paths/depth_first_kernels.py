"""Kernels of path tracing, one path after the other."""

from __future__ import annotations

from atra.compiled.store import float_kernel, njit
from atra.embree.layout import RAY_TFAR
from atra.embree.packets_kernels import (
    INFINITY,
    MISS,
    hit_prim_id,
    intersect,
    occluded,
    set_no_hit,
)
from atra.light.emitters.emitters_kernels import aim
from atra.light.numbers_kernels import ZERO, key_of, unit
from atra.light.pictures.path_kernels import add_light, arriving, load_ray, pixel_line, seen_by
from atra.light.scattering_kernels import WHITE, scatter


@njit(forceinline=True)
def _prim_id_of_ray(scene, packet, origin, direction):  # type: ignore[no-untyped-def]
    """What one ray hits, by a packet of 1."""
    load_ray(packet, 1, 0, origin, direction, INFINITY)
    set_no_hit(packet, 1, 0)
    intersect(1, packet.valid, scene, packet)
    return hit_prim_id(packet, 1, 0)


@float_kernel
def follow_depth_first(first, count, pixels, scene, packet, surfaces, emitters, sums, max_depth):  # type: ignore[no-untyped-def]
    """All stages for one path after the other, with a packet of 1; the alternative to waves. Arguments as for the
    stages.

    Returns the number of rays traced, -1 if light was not finite.
    """
    is_finite, rays = True, 0
    is_aimed = len(emitters.prim_ids) > 0 or len(emitters.sky_densities) > 0
    for pixel in range(first, first + count):
        key = key_of(pixel, pixels.sample_key)
        origin, direction = pixel_line(pixels, pixel)
        direction = unit(direction)
        weight, density = WHITE, ZERO
        for bounce in range(max_depth):
            if bounce == 0 and len(pixels.prim_id) > 0:
                prim_id = seen_by(pixels, pixel)
            else:
                rays += 1
                prim_id = _prim_id_of_ray(scene, packet, origin, direction)
            if prim_id == MISS or surfaces.flags[prim_id] != 0:
                light = arriving(surfaces, emitters, prim_id, origin, direction, density)
                is_finite &= add_light(sums, pixel, weight, light)
                break
            if bounce == max_depth - 1:
                break
            if is_aimed:
                length, start, towards, light = aim(surfaces, emitters, prim_id, origin, direction, key, bounce)
                if length > ZERO:
                    rays += 1
                    load_ray(packet, 1, 0, start, towards, length)
                    occluded(1, packet.valid, scene, packet)
                    if packet.floats[RAY_TFAR] >= ZERO:
                        is_finite &= add_light(sums, pixel, weight, light)
            goes_on, origin, direction, factor, density = scatter(surfaces, prim_id, origin, direction, key, bounce)
            if not goes_on:
                break
            weight = weight[0] * factor[0], weight[1] * factor[1], weight[2] * factor[2]
    return rays if is_finite else -1
