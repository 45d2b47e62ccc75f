"""Options: how a tracer traces, whatever it traces; each kind of tracer has its own type of them.

A field says all there is to know of an option: name, type, default, choices, unit and help. Checks, signatures, the
command line of experiments, columns of tables and documents are made from it. Beside each type stands a dictionary of
the same names and types, from which type checkers and editors know the keywords of a tracer; a test holds both equal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import Field, dataclass, field, fields, replace
from functools import cache
from inspect import Parameter, signature
from types import NoneType
from typing import Any, Self, TypedDict, TypeVar, get_args, get_type_hints

import numpy as np

from atra.compiled.instruction_sets import chosen_instruction_set
from atra.compiled.threads import resolve_threads
from atra.embree.library import load_library
from atra.embree.scene import BUILD_QUALITIES, resolve_packet_width
from atra.errors import InputError
from atra.whole_numbers import is_whole_number

TIES = ("lowest", "any")
"""Rules for triangles that tie: the lowest prim_id is stored, or whichever float32 happens to put in front."""

LANES = (4, 8, 16)
"""Numbers of pixels that can be drawn at once, and of rays that can be taken through a tree of ours together."""

_Function = TypeVar("_Function", bound=Callable[..., Any])


def option(default: Any, help: str, *, choices: tuple[Any, ...] = (), unit: str = "", null: str | None = None) -> Any:
    """A field of an options type.

    choices: the values there are, beside None where the type allows it; (): any of its type. unit: of a number. null:
    what tables show for None where it is a choice like any other; without it they show that nothing is known.
    """
    return field(default=default, metadata={"help": help, "choices": choices, "unit": unit, "null": null})


def option_of(kind: type, name: str, **changes: Any) -> Any:
    """A field like that of another options type, but for the arguments of `option` that are named."""
    one = kind.__dataclass_fields__[name]  # type: ignore[attr-defined]
    return option(**{"default": one.default, **one.metadata, **changes})


@dataclass(frozen=True)
class Choices:
    """What all options are: values that are changed by naming fields, and refused where they are none of the choices.

    Raises InputError, with the value, for whatever a field does not allow.
    """

    def __post_init__(self) -> None:
        check_choices(self)

    @classmethod
    def of(cls, owner: str, keywords: Mapping[str, Any]) -> Self:
        """The defaults with the fields that `keywords` names changed; `owner` is who was given them.

        Raises TypeError for other fields, naming those there are.
        """
        return cls().changed(owner, keywords)

    def changed(self, owner: str, keywords: Mapping[str, Any]) -> Self:
        """These with the fields that `keywords` names changed, as `of` the defaults."""
        names = [one.name for one in fields(self)]
        unknown = next((name for name in keywords if name not in names), None)
        if unknown is not None:
            raise TypeError(f"{owner} has no option {unknown!r}; its options are {', '.join(names)}")
        return replace(self, **keywords)

    @classmethod
    def part_of(cls, options: Choices) -> Self:
        """What options that have more fields say of those of this type."""
        return cls(**{one.name: getattr(options, one.name) for one in fields(cls)})

    def keywords(self) -> dict[str, Any]:
        """All fields by name, as tracers take them: `PixelTracer(mesh, camera, **options.keywords())`."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


def types_of(options: type) -> dict[str, Any]:
    """The types of an options type's fields, by name."""
    return _read_types(options)


_read_types = cache(get_type_hints)
"""Reading them takes longer than checking options by them."""


def check_choices(options: Any, section: str = "", null: str = "None") -> None:
    """Raise InputError, with the value, for the first field of a dataclass that is none of its choices, or neither True
    nor False though it has to be. section: what is said before its name. null: how None is written."""
    for one in fields(options):
        check_choice(one, types_of(type(options))[one.name], getattr(options, one.name), section + one.name, null)


def check_choice(one: Field[Any], kind: Any, value: Any, name: str, null: str = "None") -> None:
    """`check_choices` of one field, whose type is `kind`."""
    choices = one.metadata.get("choices", ())
    if kind is bool and not isinstance(value, bool):
        raise InputError(f"{name} is {value!r}, expected True or False")
    may_be_none = NoneType in get_args(kind)
    if not choices or (value is None and may_be_none):
        return
    if not (isinstance(value, str) or is_whole_number(value)) or value not in choices:
        or_none = f", or {null}" if may_be_none else ""
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(str, choices))}{or_none}")


def lists_options(kind: type[Choices], *, as_changes: bool = False) -> Callable[[_Function], _Function]:
    """Have the signature of a function that takes `**options` list those of `kind`, for `help()`, notebooks and
    documents. as_changes: those that are not given stay as they are, so defaults are shown as `...`."""

    def listing(function: _Function) -> _Function:
        plain = signature(function)
        others = [one for one in plain.parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
        listed = [
            Parameter(one.name, Parameter.KEYWORD_ONLY, default=... if as_changes else one.default, annotation=hint)
            for one, hint in ((one, types_of(kind)[one.name]) for one in fields(kind))
        ]
        function.__signature__ = plain.replace(parameters=[*others, *listed])  # type: ignore[attr-defined]
        return function

    return listing


class ThreadKeywords(TypedDict, total=False):
    threads: int | None


class TieKeywords(TypedDict, total=False):
    ties: str


class EmbreeKeywords(ThreadKeywords, total=False):
    packet_width: int | None
    build_quality: str


class PacketKeywords(EmbreeKeywords, total=False):
    robust: bool


class Keywords(PacketKeywords, TieKeywords, total=False):
    pass


@dataclass(frozen=True)
class ThreadOptions(Choices):
    """Options of whatever works in threads.

    Raises InputError for fewer threads than 1 and for more than 1,024, and where `ATRA_ISA` names no instruction set of
    this machine: what has no part in Embree would else run under another.
    """

    threads: int | None = option(None, "threads; null = every core that the process may use")

    def __post_init__(self) -> None:
        super().__post_init__()
        resolve_threads(self.threads)
        chosen_instruction_set()


@dataclass(frozen=True)
class TieOptions(Choices):
    """Options of whatever stores one of several triangles that tie."""

    ties: str = option(
        "lowest",
        "what is stored where triangles of one plane overlap: the lowest prim_id, or any, which float32 put in front",
        choices=TIES,
    )


@dataclass(frozen=True)
class EmbreeOptions(ThreadOptions):
    """Options of everything that may shoot packets of rays into Embree.

    Raises InputError for widths that are not native; EmbreeError where there is no usable Embree to ask.
    """

    packet_width: int | None = option(
        None, "rays in a packet; 1 = single rays, null = the widest native packets", choices=(1, *LANES)
    )
    build_quality: str = option("medium", "Embree's, for its BVH", choices=BUILD_QUALITIES)

    def __post_init__(self) -> None:
        resolve_packet_width(self.packet_width)
        super().__post_init__()


@dataclass(frozen=True)
class PacketOptions(EmbreeOptions):
    """Options of everything that shoots packets of rays into Embree; errors as `EmbreeOptions`."""

    robust: bool = option(
        True, "no ray slips through between two triangles; off: Embree's fast setting, as in the paper"
    )


@dataclass(frozen=True)
class Options(PacketOptions, TieOptions):
    """Options of every tracer on Embree."""


class PixelKeywords(Keywords, total=False):
    packet_rows: int | None
    coherent: bool
    compact: bool
    tile_order: str


@dataclass(frozen=True)
class PixelOptions(Options):
    """Options of `PixelTracer`, those that Embree offers for one ray per pixel. All give the same image, up to ties and
    rims of triangles; `sweep=baselines` compares their times.

    Raises InputError for rows that a packet cannot have.
    """

    packet_rows: int | None = option(
        None, "rows of pixels in a packet; null = the squarest packet, and of two the wider", null="automatic"
    )
    coherent: bool = option(True, "Embree takes the rays of a packet through its tree together")
    compact: bool = option(False, "a BVH that saves memory")
    tile_order: str = option(
        "blocks",
        "which pixels follow each other: blocks of 32 x 16 row by row, rows as wide as the image, or 16 x 16 along a "
        "morton curve",
        choices=("blocks", "rows", "morton"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        width, rows = resolve_packet_width(self.packet_width), self.packet_rows
        if rows is not None and not (is_whole_number(rows) and rows >= 1 and width % rows == 0):
            possible = ", ".join(str(1 << k) for k in range(width.bit_length()))
            raise InputError(f"packet_rows is {rows!r}, expected one of {possible} for packets of {width}, or None")


class CellKeywords(Keywords, total=False):
    memory_budget_bytes: int | None


@dataclass(frozen=True)
class CellOptions(Options):
    """Options of tracers that give Embree copies of triangles, cell by cell.

    Raises InputError for a budget that is no number of bytes.
    """

    memory_budget_bytes: int | None = option(
        None, "plans that need more are refused; null = the memory that is free", unit="bytes"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        budget = self.memory_budget_bytes
        if budget is not None and not (isinstance(budget, (int, float, np.number)) and budget >= 0):
            raise InputError(f"memory_budget_bytes is {budget!r}, expected a number of at least 0, or None for none")


class RasterKeywords(ThreadKeywords, TieKeywords, total=False):
    lanes: int | None


@dataclass(frozen=True)
class RasterOptions(ThreadOptions, TieOptions):
    """Options of `RasterTracer`."""

    lanes: int | None = option(
        None,
        "pixels drawn at once; null = as many as this machine's widest vectors hold; no image differs",
        choices=LANES,
        null="native",
    )


def native_packet_widths() -> tuple[int, ...]:
    """The packet widths that this machine supports natively, 1 first, ascending."""
    return load_library().native_packet_widths
