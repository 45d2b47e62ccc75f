"""The memory of a bake."""

from __future__ import annotations

from atra.light.lightmaps.sums_kernels import SUMS

_TEXEL_BYTES = 2 * 8 * SUMS + 144
"""Peak memory of a texel: its sums and their means, and the arrays of `Texels` and `Lightmap`."""


def needed_bytes(texels: int) -> int:
    """Peak memory of a map of so many texels, all of them lit."""
    return texels * _TEXEL_BYTES
