"""Options of the methods that split the image into cells."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

from atra.errors import InputError
from experiments.harness.column import WHOLE, Column
from experiments.harness.options import option
from experiments.methods.common_options import check_packet_width, robust_option

_LARGEST_DEFAULT_SPLIT = 128

VERIFIED = Column("packets_verified", WHOLE, "packets of pixels traced again in the second pass of a frame")

Cells = TypeVar("Cells", bound="CellOptions")


@dataclass(frozen=True)
class CellOptions:
    """split_x: columns of cells; None = the largest power of two up to 128 that divides the width. packet_width: None =
    the widest native packets. Raises InputError for values no image could use."""

    split_x: int | None = option(None, "columns of cells")
    split_y: int = option(1, "rows of cells")
    packet_width: int | None = option(None, "rays in a packet; 1 = single rays, null = the widest native packets")
    robust: bool = robust_option()

    def __post_init__(self) -> None:
        for name in ("split_x", "split_y"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"method.{name} is {value}, expected a whole number of at least 1")
        check_packet_width(self.packet_width)

    @property
    def split(self) -> tuple[int, int]:
        """Of resolved options."""
        assert self.split_x is not None
        return self.split_x, self.split_y


@dataclass(frozen=True)
class AlignedCellOptions(CellOptions):
    """packet_rows: rows of pixels in a packet of aligned rays; None = what suits the cell."""

    packet_rows: int | None = option(None, "rows of pixels in a packet; null = what suits the cell", "automatic")


def default_split_x(width: int) -> int:
    """The largest power of two, at most 128, that divides `width`."""
    return min(_LARGEST_DEFAULT_SPLIT, width & -width)


def resolve_split(options: Cells, width: int) -> Cells:
    """The options with a split."""
    return options if options.split_x is not None else replace(options, split_x=default_split_x(width))


def two_cells(options: Any) -> Any:
    """The options with at most two cells along each axis."""
    return replace(options, split_x=min(options.split[0], 2), split_y=min(options.split[1], 2))
