"""Scattering: how a path continues from a surface, by the kind of its material."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atra.compiled.store import njit
from atra.light.numbers_kernels import ONE, ZERO, along, around, dot, on_sphere, scaled, unit
from atra.light.scattering.bending_kernels import bump_of, bumped, on_side, passed_within, through_glass
from atra.light.scattering.coat_kernels import coated_clear_light, coated_direction, coated_value
from atra.light.scattering.facets_kernels import fresnel
from atra.light.scattering.sampler_kernels import DIRECTION, LOBE, PAIRS, pair_of
from atra.light.scattering.seen_kernels import UNSEEN, Seen, is_clear_pane, passes_straight, seen_from, times
from atra.light.surface_kernels import (
    OF_METAL,
    OF_NORMALS,
    OF_TRANSMISSION,
    colour_of,
    first_uv,
    leaving,
    material_of,
    meet,
    shading_normal,
    textured,
    three,
    vertex_colour,
    weights_at,
)

LAMBERTIAN, METAL, DIELECTRIC, EMISSIVE, PHYSICAL, NOTHING = 0, 1, 2, 3, 4, 5
"""Kinds of material; NOTHING: a point in the open. Their parameter: a metal's fuzz, an index of refraction."""

BLACK = ZERO, ZERO, ZERO
WHITE = ONE, ONE, ONE
_MINUS_TWO = np.float32(-2.0)
_PER_PI, PER_SPHERE = np.float32(1.0 / np.pi), np.float32(0.25 / np.pi)


class Matter(NamedTuple):
    """The material at a point. All fields serve `MetallicRoughness`; others use `colour` and `ior`, their parameter.

    ior: of the far side over the near side. alpha: squared roughness. least, most: what a dielectric reflects at a
    right angle and where it is grazing. coat: share of the surface; coat_alpha: squared roughness of the coat.
    """

    colour: tuple[np.float32, np.float32, np.float32]
    metallic: np.float32
    alpha: np.float32
    transmission: np.float32
    ior: np.float32
    is_thin: bool
    least: tuple[np.float32, np.float32, np.float32]
    most: np.float32
    coat: np.float32
    coat_alpha: np.float32


class Spot(NamedTuple):
    """Where a path meets a surface: `meet`'s point and normal, the shading normal, kind and number of the material.
    frame: two vectors orthogonal to the shading normal. seen: from the path, in that frame; UNSEEN of other kinds than
    PHYSICAL."""

    point: tuple[np.float64, np.float64, np.float64]
    normal: tuple[np.float32, np.float32, np.float32]
    shaded: tuple[np.float32, np.float32, np.float32]
    kind: np.int64
    material: np.int64
    matter: Matter
    frame: tuple[tuple[np.float32, np.float32, np.float32], tuple[np.float32, np.float32, np.float32]]
    seen: Seen


NO_FRAME = BLACK, BLACK


@njit(forceinline=True)
def spot_of(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(`Spot`, is_front) where a ray meets a triangle."""
    point, normal, shaded, material, matter, is_front = _met(surfaces, prim_id, origin, direction)
    kind = surfaces.materials[material].kind
    frame, seen = NO_FRAME, UNSEEN
    if kind == PHYSICAL:
        frame = _frame(shaded)
        seen = seen_from(matter, _local(frame, shaded, scaled(-ONE, direction)))
    return Spot(point, normal, shaded, kind, material, matter, frame, seen), is_front


@njit(forceinline=True)
def _met(surfaces, prim_id, origin, direction):  # type: ignore[no-untyped-def]
    """(point, normal, shading normal, number of the material, `Matter`, is_front) where a ray meets a triangle."""
    point, normal, is_front = meet(surfaces, prim_id, origin, direction)
    material = material_of(surfaces, prim_id)
    row = surfaces.materials[material]
    kind = row.kind
    shaded = shading_normal(surfaces, prim_id, point, normal, is_front, direction)
    colour = colour_of(surfaces, material, prim_id, point) if kind != DIELECTRIC else WHITE
    metallic, roughness, transmission = row.metallic, row.roughness, row.transmission
    ior, is_thin = row.parameter, row.is_thin
    if kind == PHYSICAL and len(surfaces.weights) > 0:
        weights = weights_at(surfaces, prim_id, point)
        if row.has_colours:
            tint = vertex_colour(surfaces, prim_id, weights)
            colour = colour[0] * tint[0], colour[1] * tint[1], colour[2] * tint[2]
        if row.images[OF_METAL] >= 0 or row.images[OF_NORMALS] >= 0 or row.images[OF_TRANSMISSION] >= 0:
            s, t = first_uv(surfaces, prim_id, weights)
            texel = textured(surfaces, material, OF_METAL, prim_id, point, s, t)
            metallic, roughness = metallic * texel[2], roughness * texel[1]
            transmission *= textured(surfaces, material, OF_TRANSMISSION, prim_id, point, s, t)[0]
            if row.images[OF_NORMALS] >= 0:
                texel = textured(surfaces, material, OF_NORMALS, prim_id, point, s, t)
                bump = bump_of(texel, row.normal_scale)
                shaded = bumped(surfaces, prim_id, shaded, bump, is_front, direction)
    far = ONE / ior if kind == PHYSICAL and not (is_front or is_thin) else ior
    bare = (ior - ONE) / (ior + ONE)
    bare *= bare
    red, green, blue = three(row.specular_colour)
    most, coating = row.specular, row.coat_roughness * row.coat_roughness
    least = scaled(most, (min(ONE, bare * red), min(ONE, bare * green), min(ONE, bare * blue)))
    glass = transmission, far, is_thin
    matter = Matter(colour, metallic, roughness * roughness, *glass, least, most, row.coat, coating)
    return point, normal, shaded, material, matter, is_front


@njit(error_model="numpy")
def straight_light(surfaces, prim_id, origin, direction, length, is_lamp):  # type: ignore[no-untyped-def]
    """(r, g, b) that passes a surface straight on: through a clear pane; and that of lamps, which no bent ray finds,
    through clear glass of any form, less what that absorbs. length: of the way within a solid to its back."""
    _, _, shaded, material, matter, is_front = _met(surfaces, prim_id, origin, direction)
    kind, cosine = surfaces.materials[material].kind, -dot(direction, shaded)
    if kind == DIELECTRIC and is_lamp:
        return scaled(ONE - fresnel(cosine, max(matter.ior, ONE / matter.ior)), WHITE)
    if kind == PHYSICAL and (is_clear_pane(matter) or (is_lamp and not matter.is_thin and passes_straight(matter))):
        light = coated_clear_light(matter, cosine)
        return light if is_front or matter.is_thin else times(light, passed_within(surfaces, material, length))
    return BLACK


@njit(forceinline=True)
def _frame(normal):  # type: ignore[no-untyped-def]
    """Two unit vectors orthogonal to a unit vector and each other.

    Source: T. Duff et al., "Building an orthonormal basis, revisited", 2017.
    """
    sign = ONE if normal[2] >= ZERO else -ONE
    a = -ONE / (sign + normal[2])
    b = normal[0] * normal[1] * a
    return (
        (ONE + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0]),
        (b, sign + normal[1] * normal[1] * a, -normal[1]),
    )


@njit(forceinline=True)
def _local(frame, normal, way):  # type: ignore[no-untyped-def]
    return dot(frame[0], way), dot(frame[1], way), dot(normal, way)


@njit(forceinline=True)
def scatter(surfaces, spot, is_front, prim_id, direction, key, sample, bounce):  # type: ignore[no-untyped-def]
    """(goes_on, origin, direction, weight, density): the next ray of a path, the (r, g, b) weight of its light, and how
    often its direction is chosen, per solid angle; 0 where no other direction was possible, or nothing is aimed.

    Where a shading normal scatters light to the wrong side of the triangle, it is mirrored at the triangle's plane.

    direction: unit vector. key, sample, bounce: select the random numbers. goes_on: False if the path is absorbed.
    """
    normal, shaded, kind = spot.normal, spot.shaded, spot.kind
    u, v = pair_of(key, sample, bounce * PAIRS + DIRECTION)
    side, weight, density = ONE, spot.matter.colour, ZERO
    if kind == PHYSICAL:
        frame = spot.frame
        lobe, _ = pair_of(key, sample, bounce * PAIRS + LOBE)
        way, weight, density = coated_direction(spot.matter, spot.seen, u, v, lobe)
        onward = unit(along(along(scaled(way[0], frame[0]), way[1], frame[1]), way[2], shaded))
        side = ONE if way[2] > ZERO else -ONE
        if not weight[0] + weight[1] + weight[2] > ZERO:
            return False, direction, direction, BLACK, ZERO
        facing = dot(onward, normal)
        twin = along(onward, _MINUS_TWO * facing, normal)
        if density > ZERO and dot(twin, shaded) * side > ZERO:
            density += coated_value(spot.matter, spot.seen, _local(frame, shaded, twin))[1]
        onward = onward if facing * side > ZERO else twin
    elif kind == DIELECTRIC:
        is_schlick = surfaces.materials[spot.material].is_schlick
        onward, passes = through_glass(direction, shaded, is_front, spot.matter.ior, is_schlick, u)
        side = -ONE if passes else ONE
        onward = on_side(onward, normal, side)
    else:
        sphere = on_sphere(u, v)
        if kind == METAL:
            mirrored = along(direction, _MINUS_TWO * dot(direction, shaded), shaded)
            onward = unit(along(mirrored, spot.matter.ior, sphere))
            if not dot(onward, shaded) > ZERO:
                return False, direction, direction, BLACK, ZERO
        else:
            onward = around(shaded, sphere)
        onward = on_side(onward, normal, side)
        density = _by_cosine(shaded, normal, onward) if kind == LAMBERTIAN else ZERO
    return True, leaving(surfaces, prim_id, spot.point, scaled(side, normal)), onward, weight, density


@njit
def _by_cosine(shaded, normal, onward):  # type: ignore[no-untyped-def]
    """How often a direction on the side of `normal` is chosen by the cosine, per solid angle. The direction that
    `on_side` mirrors there counts, too."""
    cosine = max(ZERO, dot(onward, shaded))
    mirrored = max(ZERO, dot(along(onward, _MINUS_TWO * dot(onward, normal), normal), shaded))
    return (cosine + mirrored) * _PER_PI


@njit(forceinline=True)
def scattered_light(spot, onward):  # type: ignore[no-untyped-def]
    """((r, g, b), density): what a surface scatters of light from the unit vector `onward`, per solid angle, and the
    density with which `scatter` chooses it. 0 for mirrors and glass, whose light only scattering finds, and for light
    from the other side of what lets none through."""
    if spot.kind == NOTHING:
        return scaled(PER_SPHERE, WHITE), PER_SPHERE
    facing = dot(onward, spot.normal)
    if spot.kind == LAMBERTIAN and facing > ZERO:
        density = _by_cosine(spot.shaded, spot.normal, onward)
        return scaled(density, spot.matter.colour), density
    if spot.kind == PHYSICAL:
        way = _local(spot.frame, spot.shaded, onward)
        twin = _local(spot.frame, spot.shaded, along(onward, _MINUS_TWO * facing, spot.normal))
        value, density = coated_value(spot.matter, spot.seen, way) if way[2] * facing > ZERO else (BLACK, ZERO)
        if twin[2] * facing > ZERO:
            more, chosen = coated_value(spot.matter, spot.seen, twin)
            value, density = along(value, ONE, more), density + chosen
        return value, density
    return BLACK, ZERO
