"""Options that several methods have, and what rows are called that were measured with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from inspect import signature
from typing import Any, TypeVar

from experiments.harness.column import WHOLE, Column
from experiments.harness.method import LANES, Tracing
from experiments.harness.options import Settings, option, whole


class MethodOptions(Settings):
    """Options of a method of ours."""

    section = "method"


def keywords_of(make: Callable[..., Any], options: Any, tracing: Tracing) -> dict[str, Any]:
    """The keyword arguments of a tracer's constructor that a method's options, or those of the whole point, have."""
    known = {field.name: getattr(options, field.name) for field in fields(options)} | vars(tracing)
    return {name: known[name] for name in signature(make).parameters if name in known}


def packet_width_option() -> Any:
    """The option `packet_width` of methods on Embree."""
    return option(None, "rays in a packet; 1 = single rays, null = the widest native packets", choices=(1, *LANES))


def robust_option(
    help: str = "no ray slips through between two triangles; off: Embree's fast setting, as in the paper",
) -> Any:
    """The option `robust`. The paper, and all tables without the column, measured Embree's fast setting."""
    return option(False, help)


def say_robust(row: Mapping[str, Any]) -> list[str]:
    """What a row is called that was measured with it: nothing where it was not, or is older than the option."""
    return ["robust"] if row.get("robust") in (True,) else []


_LARGEST_DEFAULT_SPLIT = 128

VERIFIED = Column("packets_verified", WHOLE, "packets of pixels traced again in the second pass of a frame")

Cells = TypeVar("Cells", bound="SplitOptions")


@dataclass(frozen=True)
class SplitOptions(MethodOptions):
    """split_x: None = the largest power of two up to 128 that divides the width. Raises InputError for values no image
    could use."""

    split_x: int | None = whole(None, "columns of cells", 1)
    split_y: int = whole(1, "rows of cells", 1)

    @property
    def split(self) -> tuple[int, int]:
        """The split; the options must be resolved."""
        assert self.split_x is not None
        return self.split_x, self.split_y


@dataclass(frozen=True)
class CellOptions(SplitOptions):
    """Options of methods on Embree that split the image into cells."""

    packet_width: int | None = packet_width_option()
    robust: bool = robust_option()


@dataclass(frozen=True)
class AlignedCellOptions(CellOptions):
    """Options of methods with aligned rays."""

    packet_rows: int | None = option(
        None, "rows of pixels in a packet; null = the best fit for the cell", null="automatic"
    )


def resolve_split(options: Cells, width: int) -> Cells:
    """The options with split_x set; width & -width is the largest power of two that divides the width."""
    if options.split_x is not None:
        return options
    return replace(options, split_x=min(_LARGEST_DEFAULT_SPLIT, width & -width))


def two_cells(options: Any) -> Any:
    """The options with at most two cells along each axis."""
    return replace(options, split_x=min(options.split[0], 2), split_y=min(options.split[1], 2))
