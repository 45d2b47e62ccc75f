"""Kernels that take paths on by one bounce, and aim a ray at an emitter from each."""

from __future__ import annotations

from atra.compiled.store import float_kernel
from atra.embree.packets_kernels import MISS
from atra.light.emitters.emitters_kernels import aim, has_emitters
from atra.light.numbers_kernels import ZERO, set_vector, unit, vector
from atra.light.pictures.path_kernels import path_key, pixel_line, seen_by
from atra.light.scattering.spots_kernels import scatter, spot_of
from atra.light.surface_kernels import ENDS

PATH_ROWS = 6
"""float32 numbers of a path: origin and unit direction."""

_DIRECTION = 3


@float_kernel
def start_paths(pixels, paths, prim_id):  # type: ignore[no-untyped-def]
    """The rays of all pixels, and what they see. paths: (PATH_ROWS, N) float32. prim_id: (N,) uint32. Both are
    written."""
    for pixel in range(len(prim_id)):
        origin, direction = pixel_line(pixels, pixel)
        set_vector(paths, 0, pixel, origin)
        set_vector(paths, _DIRECTION, pixel, unit(direction))
        prim_id[pixel] = seen_by(pixels, pixel)


@float_kernel
def bounce_paths(paths, prim_id, pixel, bounce, surfaces, emitters, aimed, lengths, goes_on):  # type: ignore[no-untyped-def]
    """Scatter paths where they meet triangles, in the first sample of a picture.

    paths: (PATH_ROWS, N) float32, replaced. prim_id: (N,) uint32, MISS = the sky. pixel: (N,) int32. bounce: surfaces
    met so far. aimed: (PATH_ROWS, N) float32, gets rays to emitters; lengths: (N,) float32, theirs, 0 = none. goes_on:
    (N,) bool, gets whether the path does.
    """
    for i in range(len(prim_id)):
        lengths[i], goes_on[i] = ZERO, False
        if prim_id[i] == MISS or surfaces.flags[prim_id[i]] & ENDS:
            continue
        key, direction = path_key(pixel[i]), vector(paths, _DIRECTION, i)
        spot, is_front = spot_of(surfaces, prim_id[i], vector(paths, 0, i), direction)
        if has_emitters(emitters):
            lengths[i], start, towards, _, _ = aim(surfaces, emitters, spot, prim_id[i], direction, key, 0, bounce)
            set_vector(aimed, 0, i, start)
            set_vector(aimed, _DIRECTION, i, towards)
        goes_on[i], start, direction, _, _ = scatter(surfaces, spot, is_front, prim_id[i], direction, key, 0, bounce)
        set_vector(paths, 0, i, start)
        set_vector(paths, _DIRECTION, i, direction)
