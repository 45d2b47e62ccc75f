"""An image plane: where the pixels of a view lie about its axis, and how far apart."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError
from atra.geometry.numbers import as_number
from atra.whole_numbers import is_whole_number


@dataclass(frozen=True)
class ImagePlane:
    """The grid of pixels on the image plane; the view axis may meet it anywhere, and pixels need not be square.

    What lies at sub-pixel offset (ox, oy) of pixel (x, y) is, to the right of the view axis and below it,

        (left + x + ox - axis_x) pitch_x,    (top + y + oy - axis_y) pitch_y

    pitch_x, pitch_y: distance between neighbouring columns and rows, above 0; of a pinhole at depth 1, which makes it 1
    over the focal length in pixels. axis_x, axis_y: where the view axis meets the plane (the principal point), in
    pixels; (0, 0) is a corner and (0.5, 0.5) the centre of a pixel. left, top: the column and row that the image begins
    with, whole numbers; a crop changes nothing else, so that its rays are those of the whole image to the bit.

    Raises InputError for a pitch that is not a finite number above 0, an axis that is not finite, and a left or top
    that is no whole number.
    """

    pitch_x: float
    pitch_y: float
    axis_x: float
    axis_y: float
    left: int = 0
    top: int = 0

    def __post_init__(self) -> None:
        for name in ("pitch_x", "pitch_y"):
            pitch = as_number(getattr(self, name))
            if not (isfinite(pitch) and pitch > 0.0):
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a finite distance above 0")
            object.__setattr__(self, name, pitch)
        for name in ("left", "top"):
            if not is_whole_number(getattr(self, name)):
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a whole number of pixels")
            object.__setattr__(self, name, int(getattr(self, name)))
        for name in ("axis_x", "axis_y"):
            axis = as_number(getattr(self, name))
            if not isfinite(axis):
                raise InputError(f"{name} is {getattr(self, name)!r}, expected a finite number of pixels")
            object.__setattr__(self, name, axis)

    @classmethod
    def centred(cls, pitch: float, width: int, height: int) -> Self:
        """Square pixels, the view axis through the middle of a width x height image."""
        return cls(pitch, pitch, width / 2, height / 2)

    @property
    def axis_in_image(self) -> tuple[float, float]:
        """Where the view axis meets the plane, in pixels from the image's own upper left corner."""
        return self.axis_x - self.left, self.axis_y - self.top

    def columns(self, x: ArrayLike, offset: float = 0.0) -> NDArray[np.float64]:
        """How many pixels right of the view axis the columns `x` of the image are, at sub-pixel `offset`; float64."""
        return np.asarray(x, np.float64) + self.left - self.axis_x + offset

    def rows(self, y: ArrayLike, offset: float = 0.0) -> NDArray[np.float64]:
        """How many pixels below the view axis the rows `y` of the image are, at sub-pixel `offset`; float64."""
        return np.asarray(y, np.float64) + self.top - self.axis_y + offset
