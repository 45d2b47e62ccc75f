"""Kernels for finished pictures: sRGB encoding, and pixels to rows of an image."""

from __future__ import annotations

import numpy as np

from atra.compiled.store import kernel

_STARTS = 4096
"""Entries of the table of starting levels over [0, 1]."""


_BOUNDS = (np.arange(1, 256) - 0.5) / 255

_FIRST_OF_LEVEL = np.append(np.where(_BOUNDS <= 0.04045, _BOUNDS / 12.92, ((_BOUNDS + 0.055) / 1.055) ** 2.4), np.inf)
"""The least linear light of the sRGB (IEC 61966-2-1) levels 1, 2, ... 255; then inf."""

_LEVEL_AT = np.searchsorted(_FIRST_OF_LEVEL, np.arange(_STARTS + 1) / _STARTS, side="right").astype(np.uint8)


@kernel
def encode_srgb(linear, levels):  # type: ignore[no-untyped-def]
    """linear: (N,) float. levels: (N,) uint8, written: nearest sRGB level; 255 above 1, 0 for NaN."""
    for number in range(len(linear)):
        light = np.float64(linear[number])
        if not light > 0.0:
            levels[number] = 0
        elif light >= 1.0:
            levels[number] = 255
        else:
            level = np.int64(_LEVEL_AT[np.int64(light * _STARTS)])
            while light >= _FIRST_OF_LEVEL[level]:
                level += 1
            levels[number] = level


@kernel
def place_pixels(places, planes, image):  # type: ignore[no-untyped-def]
    """planes: (P, pixels), in the order of places: (pixels,) uint32, x + y 2^16. image: (H, W, P), written."""
    for pixel in range(len(places)):
        x, y = np.int64(places[pixel] & 0xFFFF), np.int64(places[pixel] >> 16)
        for plane in range(len(planes)):
            image[y, x, plane] = planes[plane, pixel]
