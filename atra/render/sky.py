"""Skies: what rays see that leave the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from atra.render.checks import Colour, checked_colour, checked_number, checked_texels

WHITE: Colour = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class GradientSky:
    """From `below` to `above`, linear in the height (y) of the unit direction. power: a factor.

    Its defaults are those of "Ray Tracing in One Weekend".
    """

    below: Colour = WHITE
    above: Colour = (0.5, 0.7, 1.0)
    power: float = 1.0

    def __post_init__(self) -> None:
        for name in ("below", "above"):
            object.__setattr__(self, name, checked_colour(f"{name} of a sky", getattr(self, name), 1e12))
        object.__setattr__(self, "power", checked_number("power of a sky", self.power, 0.0, 1e12))


@dataclass(frozen=True, eq=False)
class PanoramaSky:
    """An image all around, in longitude and latitude.

    texels: (H, W, 3) radiance of any size, linear RGB; row 0 is above (+y), the middle column looks along -z, those
    right of it along +x. power: a factor.
    """

    texels: NDArray[np.float32]
    power: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "texels", checked_texels("texels of a sky", self.texels))
        object.__setattr__(self, "power", checked_number("power of a sky", self.power, 0.0, 1e12))


Sky = GradientSky | PanoramaSky


def constant_sky(colour: Colour | float = WHITE, power: float = 1.0) -> GradientSky:
    """The same radiance from everywhere; black: no sky."""
    whole = checked_colour("colour of a sky", colour, 1e12)
    return GradientSky(whole, whole, power)
