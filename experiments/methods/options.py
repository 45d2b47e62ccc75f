"""Options that several methods have, and what rows are called that were measured with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

from atra.tracing import options as library
from atra.tracing.options import Choices
from experiments.harness.column import WHOLE, Column
from experiments.harness.method import Tracing
from experiments.harness.options import Settings, Type, taking_all, whole

WATERTIGHT = {"robust": True}
"""Options for pictures that are shown and not measured."""

MEASURED = {"robust": False}
"""Defaults that differ from the library's. The paper, and all tables without the column `robust`, measured Embree's
fast setting."""


class MethodOptions(Settings):
    """Options of a method of ours. library: the type that its tracer has. names: what options of that are called here,
    where that is another name."""

    section = "method"
    library: ClassVar[type[Choices]]
    names: ClassVar[Mapping[str, str]]

    def keywords(self, tracing: Tracing, kind: type[Choices] | None = None) -> dict[str, Any]:
        """What the tracer takes beside what is traced. kind: the options of another tracer, which are some of these."""
        of_point = vars(tracing)
        return {
            one.name: of_point[one.name] if one.name in of_point else getattr(self, self.names.get(one.name, one.name))
            for one in fields(kind or self.library)
        }


def options_of(kind: type[Choices], names: Mapping[str, str] | None = None) -> Callable[[Type], Type]:
    """Makes a class the options of a method: those of the library's type, but for those that hold for the whole point,
    and then its own."""
    named = names or {}

    def made(cls: Type) -> Type:
        cls.library, cls.names = kind, named  # type: ignore[attr-defined]
        return taking_all(kind, (one.name for one in fields(Tracing)), named, MEASURED)(cls)

    return made


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


@options_of(library.CellOptions)
class CellOptions(SplitOptions):
    """Options of the cells' culling."""


def resolve_split(options: Cells, width: int) -> Cells:
    """The options with split_x set; width & -width is the largest power of two that divides the width."""
    if options.split_x is not None:
        return options
    return replace(options, split_x=min(_LARGEST_DEFAULT_SPLIT, width & -width))


def two_cells(options: Any) -> Any:
    """The options with at most two cells along each axis."""
    return replace(options, split_x=min(options.split[0], 2), split_y=min(options.split[1], 2))
