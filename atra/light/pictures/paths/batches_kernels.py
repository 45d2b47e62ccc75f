"""Kernels between two batches of rays: what is aimed at emitters, and the light that arrives."""

from __future__ import annotations

from atra.compiled.store import float_kernel
from atra.light.emitters.emitters_kernels import aim
from atra.light.numbers_kernels import ZERO, set_vector, vector
from atra.light.pictures.path_kernels import add_light, path_key
from atra.light.pictures.paths.waves_kernels import DIRECTION, ORIGIN, WEIGHT
from atra.light.scattering.spots_kernels import spot_of

AIM_ORIGIN, AIM_DIRECTION, AIM_LIGHT, AIM_LENGTH = 0, 3, 6, 9
AIM_ROWS = 10
"""float32 numbers of an aimed ray: origin, unit direction, the light it carries (three each); its length, 0 = none."""


@float_kernel
def aim_paths(paths, chosen, surfaces, emitters, sample, aimed):  # type: ignore[no-untyped-def]
    """Aim a ray from each path at an emitter. chosen: (K,) int64, numbers of paths. aimed: (AIM_ROWS, K)."""
    for k in range(len(chosen)):
        i = chosen[k]
        aimed[AIM_LENGTH, k] = ZERO
        if paths.is_passing[i]:
            continue
        prim_id, direction = paths.prim_id[i], vector(paths.floats, DIRECTION, i)
        spot, _ = spot_of(surfaces, prim_id, vector(paths.floats, ORIGIN, i), direction)
        length, origin, towards, light, _ = aim(
            surfaces, emitters, spot, prim_id, direction, path_key(paths.pixel[i]), sample, paths.bounce[i]
        )
        aimed[AIM_LENGTH, k] = length
        set_vector(aimed, AIM_ORIGIN, k, origin)
        set_vector(aimed, AIM_DIRECTION, k, towards)
        set_vector(aimed, AIM_LIGHT, k, light)


@float_kernel
def add_aimed(paths, chosen, aimed, sums):  # type: ignore[no-untyped-def]
    """Add the light of rays that nothing blocked to `sums`; returns whether it was finite."""
    is_finite = True
    for k in range(len(chosen)):
        i = chosen[k]
        weight, light = vector(paths.floats, WEIGHT, i), vector(aimed, AIM_LIGHT, k)
        is_finite &= add_light(sums, paths.pixel[i], weight, light)
    return is_finite
