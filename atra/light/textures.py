"""Textures: colours over uv, of a checkerboard or an image."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.errors import InputError
from atra.geometry.numbers import Vector, checked_vector
from atra.light.checks import Colour, check_fields, checked_colour, checked_image, set_fields

MOST_TEXELS = 1 << 26
"""Most texels of an image; they take 768 MiB."""

WRAPS = ("repeat", "mirror", "clamp")


def linear_of_srgb(codes: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear light of sRGB numbers in [0, 1]."""
    return np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)


_STEPS = np.arange(256) / 255.0
CURVES = np.array([_STEPS, linear_of_srgb(_STEPS)], np.float32)
"""What bytes stand for: as they are, and as sRGB codes."""


@dataclass(frozen=True)
class Checker:
    """A checkerboard over uv.

    first: colour of the square just above u = v = 0. second: the other colour. scale: squares per unit of uv.
    """

    first: Colour
    second: Colour
    scale: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, first=1.0, second=1.0, scale=(0.0, inf, True))


@dataclass(frozen=True, eq=False)
class Image:
    """An image over uv, with bilinear filtering in linear light.

    texels: (H, W, 3) or (H, W, 4), copied; float32 in [0, 1], or uint8 (0 to 255 stand for 0 to 1). The fourth channel
    is opacity. Row 0 is at v = 1, column 0 at u = 0. is_coded: whether the first three channels of uint8 are sRGB
    codes. factor: linear RGB and opacity that multiply the texels. second_uv: whether the scene's `second_uv` is used.
    placement: ((a, b, c), (d, e, f)): u, v of the image are a u + b v + c and d u + e v + f of the vertices'. wrap:
    what lies outside [0, 1] in u and in v, "repeat", "mirror" or "clamp". is_nearest: without filtering.
    """

    texels: NDArray[Any]
    is_coded: bool = False
    factor: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    second_uv: bool = False
    placement: tuple[Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    wrap: tuple[str, str] = ("repeat", "repeat")
    is_nearest: bool = False

    def __post_init__(self) -> None:
        texels = checked_image("texels of an image", self.texels)
        if texels.shape[0] * texels.shape[1] > MOST_TEXELS:
            raise InputError(f"an image has {texels.shape[:2]} texels, expected at most {MOST_TEXELS}; make it smaller")
        red, green, blue, opacity = self.factor
        factor = (*checked_colour("factor of an image", (red, green, blue), 1e12), opacity)
        first, second = (checked_vector("placement of an image", row) for row in self.placement)
        for wrap in self.wrap:
            check_choice("wrap of an image", wrap, WRAPS)
        set_fields(self, texels=texels, factor=factor, placement=(first, second))


Texture = Colour | Checker | Image
"""A colour is linear RGB, or one number for a grey."""


def linear(texels: NDArray[Any], is_coded: bool) -> NDArray[np.float32]:
    """Texels (..., channels) of an `Image` as float32 in linear light."""
    if texels.dtype != np.uint8:
        return texels
    found = CURVES[0][texels]
    if is_coded:
        found[..., :3] = CURVES[1][texels[..., :3]]
    return found
