"""Conventions by which programs store images: where rays pass through pixels, the order of rows, what depth is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View

_LAST = float(np.nextafter(1.0, 0.0))

OFFSETS = {
    (0.5, 0.5): "pixel centres",
    (0.0, 0.0): "the upper left corners of pixels: a shift by half a pixel",
    (_LAST, _LAST): "the lower right corners of pixels: a shift by half a pixel",
    (0.0, 0.5): "the left edges of pixels: a shift by half a pixel",
    (0.5, 0.0): "the upper edges of pixels: a shift by half a pixel",
    (_LAST, 0.5): "the right edges of pixels: a shift by half a pixel",
    (0.5, _LAST): "the lower edges of pixels: a shift by half a pixel",
}
"""Places of rays in their pixels that are looked for, and their names."""


@dataclass(frozen=True)
class Convention:
    """How a program stores an image. The defaults are atra's own; for lenses that see sideways see `own`.

    Parameters
    ----------
    offset : (float, float)
        Place of the rays in their pixels.
    flips_rows, flips_columns : bool
        Row 0 is the bottom; column 0 is the right.
    swaps_axes : bool
        Stored (width, height); undone before rows and columns are flipped.
    along_ray : bool
        Depth is the distance from the eye, not along the view axis.

    Examples
    --------
    >>> import atra
    >>> print(atra.Convention(flips_rows=True))
    rays through pixel centres; rows are flipped: the first is the bottom; depth along the view axis
    """

    offset: tuple[float, float] = (0.5, 0.5)
    flips_rows: bool = False
    flips_columns: bool = False
    swaps_axes: bool = False
    along_ray: bool = False

    @classmethod
    def own(cls, camera: View) -> Self:
        """Atra's own convention for the camera: along the ray where `View.depth_is_along_ray`, else the defaults."""
        return cls(along_ray=camera.depth_is_along_ray)

    def ordered(self, image: NDArray) -> NDArray:
        """The image (H, W) with the top row and the left column first."""
        image = image.T if self.swaps_axes else image
        image = image[::-1] if self.flips_rows else image
        return np.ascontiguousarray(image[:, ::-1] if self.flips_columns else image)

    def __str__(self) -> str:
        said = [f"rays through {OFFSETS.get(self.offset, self.offset)}"]
        said += ["x and y are swapped"] if self.swaps_axes else []
        said += ["rows are flipped: the first is the bottom"] if self.flips_rows else []
        said += ["columns are flipped: the first is the right"] if self.flips_columns else []
        return "; ".join((*said, f"depth along the {'ray' if self.along_ray else 'view axis'}"))
