"""The kernel of layers: base colours and normals of what pixels see first."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from atra.compiled.store import float_kernel
from atra.light.numbers_kernels import ONE, ZERO
from atra.light.pictures.gbuffer_kernels import (
    CHUNK,
    COLOUR,
    NORMAL,
    SEEN,
    STRIDE,
    fetch_ahead,
    find_surfaces,
    find_triangles,
)
from atra.light.pictures.lighting_kernels import look_through

LAYER_PLANES = 6
"""Sums of layers: the base colour, 1 for the sky, then the shading normal, 0 for the sky."""


@cache
def layers_kernel(width: int) -> Callable[..., None]:
    """The kernel that adds a sample to the sums of layers. width: rays of the scene's packets."""

    @float_kernel
    def add_layers(first, count, pixels, surfaces, scene, packet, chunk, sums):  # type: ignore[no-untyped-def]
        """Add what `count` pixels from number `first` on see to sums: (LAYER_PLANES, pixels) float32."""
        floats = chunk.floats
        for start in range(first, first + count, CHUNK):
            some = min(CHUNK, first + count - start)
            fetch_ahead(start + CHUNK, first + count, pixels)
            find_triangles(chunk, start, some, pixels)
            if surfaces.is_looked_through:
                look_through(width, chunk, start, some, pixels, surfaces, scene, packet)
            find_surfaces(chunk, start, some, pixels, surfaces)
            for i in range(some):
                is_seen = floats[SEEN * STRIDE + i] != ZERO
                for axis in range(3):
                    sums[axis, start + i] += floats[(COLOUR + axis) * STRIDE + i] if is_seen else ONE
                    sums[3 + axis, start + i] += floats[(NORMAL + axis) * STRIDE + i] if is_seen else ZERO

    return add_layers
