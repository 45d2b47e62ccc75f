"""The split of an image into equal cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from atra.errors import InputError
from atra.geometry.view import View, check_view
from atra.whole_numbers import is_whole_number


@dataclass(frozen=True)
class Split:
    """The split of an image into nx x ny equal cells; cell (i, j) is column i, row j.

    Parameters
    ----------
    nx, ny : int
        Columns and rows of cells.
    width, height : int
        Of the image, pixels.

    Raises
    ------
    InputError
        Unless all are whole numbers of at least 1, and nx divides width and ny divides height.

    Examples
    --------
    >>> import atra
    >>> split = atra.Split(4, 2, width=64, height=48)
    >>> split.cell_width, split.cell_height
    (16, 24)
    """

    nx: int
    ny: int
    width: int
    height: int

    def __post_init__(self) -> None:
        counts = {"nx": "columns", "ny": "rows", "width": "pixels in a row", "height": "pixels in a column"}
        for name, counted in counts.items():
            count = getattr(self, name)
            if not is_whole_number(count) or count < 1:
                raise InputError(
                    f"split ({self.nx!r}, {self.ny!r}): the number of {counted} is {count!r}, "
                    "expected a whole number of at least 1"
                )
            object.__setattr__(self, name, int(count))  # NumPy's small integers would overflow in products
        if self.width % self.nx or self.height % self.ny:
            raise InputError(
                f"split ({self.nx}, {self.ny}) does not divide image {self.width} x {self.height}; "
                f"split_x must divide {self.width} and split_y must divide {self.height}"
            )

    @classmethod
    def of_image(cls, counts: tuple[int, int], camera: View) -> Self:
        """The split of a camera's image into `counts`, columns and rows, of cells. Raises InputError as `Split`."""
        check_view(camera)
        try:
            nx, ny = counts
        except (TypeError, ValueError):
            raise InputError(
                f"split is {counts!r}, expected two whole numbers, columns and rows of cells, such as (8, 1)"
            ) from None
        return cls(nx, ny, camera.width, camera.height)

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return self.nx * self.ny

    @property
    def cell_width(self) -> int:
        """Width of a cell, pixels."""
        return self.width // self.nx

    @property
    def cell_height(self) -> int:
        """Height of a cell, pixels."""
        return self.height // self.ny
