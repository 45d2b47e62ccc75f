"""Kernels of views: what surfaces show without any shading, and the sky."""

from __future__ import annotations

from atra.compiled.store import float_kernel
from atra.embree.packets_kernels import INFINITY
from atra.light.emitters.sky_kernels import sky_colour
from atra.light.surface_kernels import colour_of, emission_at, material_of, opacity_at, vertex_colour, weights_at


@float_kernel
def look_up(surfaces, prim_id, points, albedo, emission, opacity):  # type: ignore[no-untyped-def]
    """Put what fronts of triangles show at (N, 3) float64 points into (N, 3), (N, 3) and (N,) float32. Points that are
    not finite keep what is there."""
    for i in range(len(prim_id)):
        face, point = prim_id[i], (points[i, 0], points[i, 1], points[i, 2])
        if not abs(point[0]) + abs(point[1]) + abs(point[2]) < INFINITY:
            continue
        material = material_of(surfaces, face)
        albedo[i, 0], albedo[i, 1], albedo[i, 2] = colour_of(surfaces, material, face, point)
        if surfaces.materials[material].has_colours:
            tint = vertex_colour(surfaces, face, weights_at(surfaces, face, point))
            for channel in range(3):
                albedo[i, channel] *= tint[channel]
        emission[i, 0], emission[i, 1], emission[i, 2] = emission_at(surfaces, face, point)
        opacity[i] = opacity_at(surfaces, face, point, True, False)


@float_kernel
def look_into_sky(surfaces, ways, colours):  # type: ignore[no-untyped-def]
    """Put the sky's radiance along (N, 3) float32 unit vectors into (N, 3) float32."""
    for i in range(len(ways)):
        way = ways[i, 0], ways[i, 1], ways[i, 2]
        colours[i, 0], colours[i, 1], colours[i, 2] = sky_colour(surfaces, way)
