"""What a triangle shows whatever light falls on it: its emission, and the share of light that its holes let through."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO
from atra.light.surface_kernels import (
    BACKS,
    COLOURS_EMIT,
    CUTOFF,
    EMISSION,
    HAS_COLOURS,
    IMAGES,
    OF_COLOUR,
    OF_EMISSION,
    OPACITY,
    first_uv,
    material_of,
    meet,
    textured,
    vertex_colour,
    weights_at,
)

_BLACK = ZERO, ZERO, ZERO


@njit
def emitted(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(r, g, b) of a triangle that shines, seen by a ray; its back is black."""
    point, _, is_front = meet(surfaces, prim_id, origin, direction)
    return emission_at(surfaces, prim_id, point) if is_front else _BLACK


@njit
def emission_at(surfaces, prim_id, point):  # type: ignore[no-untyped-def]
    """(r, g, b) that the front of a triangle emits at a point."""
    material = material_of(surfaces, prim_id)
    row = surfaces.materials[material]
    light = np.float32(row[EMISSION]), np.float32(row[EMISSION + 1]), np.float32(row[EMISSION + 2])
    has_image, has_colours = row[IMAGES + OF_EMISSION] >= 0.0, row[HAS_COLOURS] == COLOURS_EMIT
    if not (has_image or has_colours):
        return light
    weights = weights_at(surfaces, prim_id, point)
    if has_image:
        s, t = first_uv(surfaces, prim_id, weights)
        texel = textured(surfaces, material, OF_EMISSION, prim_id, point, s, t)
        light = light[0] * texel[0], light[1] * texel[1], light[2] * texel[2]
    if has_colours:
        colour = vertex_colour(surfaces, prim_id, weights)
        light = light[0] * colour[0], light[1] * colour[1], light[2] * colour[2]
    return light


@njit
def opacity_at(surfaces, prim_id, point, is_front, is_seen):  # type: ignore[no-untyped-def]
    """The share of light that meets a triangle with HOLES at a point; the rest passes. is_seen: by the eye."""
    row = surfaces.materials[material_of(surfaces, prim_id)]
    if is_seen and not is_front and row[BACKS] == 0.0:
        return ZERO
    cutoff = row[CUTOFF]
    if cutoff > 1.0:
        return ONE
    opacity = np.float32(row[OPACITY])
    has_image = row[IMAGES + OF_COLOUR] >= 0.0
    if has_image or row[HAS_COLOURS] != 0.0:
        weights = weights_at(surfaces, prim_id, point)
        if has_image:
            s, t = first_uv(surfaces, prim_id, weights)
            opacity *= textured(surfaces, material_of(surfaces, prim_id), OF_COLOUR, prim_id, point, s, t)[3]
        if row[HAS_COLOURS] != 0.0:
            opacity *= vertex_colour(surfaces, prim_id, weights)[3]
    if cutoff < 0.0:
        return opacity
    return ONE if opacity >= cutoff else ZERO
