"""Options of the methods that split the image into cells."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from atra.alignment import options as of_alignment
from atra.errors import InputError
from atra.tracing import options as library
from atra.tracing.options import option
from experiments.harness.column import WHOLE, Column
from experiments.methods.common_options import MethodOptions, options_of

_LARGEST_DEFAULT_SPLIT = 128

VERIFIED = Column("packets_verified", WHOLE, "packets of pixels traced again in the second pass of a frame")

Cells = TypeVar("Cells", bound="SplitOptions")


@dataclass(frozen=True)
class SplitOptions(MethodOptions):
    """split_x: None = the largest power of two up to 128 that divides the width. Raises InputError for values no image
    could use."""

    split_x: int | None = option(None, "columns of cells")
    split_y: int = option(1, "rows of cells")

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("split_x", "split_y"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"method.{name} is {value}, expected a whole number of at least 1")

    @property
    def split(self) -> tuple[int, int]:
        """Of resolved options."""
        assert self.split_x is not None
        return self.split_x, self.split_y


@options_of(library.CellOptions)
class CellOptions(SplitOptions):
    """Options of the cells' culling."""


@options_of(of_alignment.ReferenceRayOptions)
class AlignedCellOptions(CellOptions):
    """Options of aligned rays."""


def resolve_split(options: Cells, width: int) -> Cells:
    """The options with split_x set; width & -width is the largest power of two that divides the width."""
    if options.split_x is not None:
        return options
    return replace(options, split_x=min(_LARGEST_DEFAULT_SPLIT, width & -width))


def two_cells(options: Any) -> Any:
    """The options with at most two cells along each axis."""
    return replace(options, split_x=min(options.split[0], 2), split_y=min(options.split[1], 2))
