"""Options: how a tracer traces, whatever it traces; each kind of tracer has its own type of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from atra.compiled.threads import resolve_threads
from atra.embree.library import load_library
from atra.embree.scene import check_build_quality, resolve_packet_width
from atra.errors import InputError
from atra.whole_numbers import is_whole_number

TIES = ("lowest", "any")
"""What a tracer stores where triangles tie: the lowest prim_id, or whichever float32 happens to put in front."""

TILE_ORDERS = ("blocks", "rows", "morton")
"""Which pixels are traced one after the other: see `PixelOptions`."""

GEOMETRIES = ("copied", "instanced")
"""How the cells' sheared geometry comes into the scene."""

LANES = (4, 8, 16)
"""Numbers of pixels that can be drawn at once, and of rays that can be taken through a tree of ours together."""

TRAVERSALS = ("push", "pop")
"""When a node's box is tested: before it is put on the stack, or when it is taken from there."""


@dataclass(frozen=True)
class Choices:
    """What all options are: values that are changed by naming fields."""

    @classmethod
    def of(cls, owner: str, options: Choices | None, changes: Mapping[str, Any]) -> Self:
        """`options`, or the defaults, with the fields `changes` names changed; `owner` is who was given them.

        Raises TypeError for other fields, naming those there are, and for options that lack fields of this type.
        """
        names = [field.name for field in fields(cls)]
        unknown = next((name for name in changes if name not in names), None)
        if unknown is not None:
            raise TypeError(f"{owner} has no option {unknown!r}; its options are {', '.join(names)}")
        if options is None:
            return cls(**changes)
        if not isinstance(options, cls):
            raise TypeError(f"options of {owner} are {options!r}, expected {cls.__name__}, or fields of it by name")
        return replace(options, **changes)

    @classmethod
    def part_of(cls, options: Choices) -> Self:
        """What options that have more fields say of those of this type."""
        return cls(**{field.name: getattr(options, field.name) for field in fields(cls)})


@dataclass(frozen=True)
class PacketOptions(Choices):
    """What everything that shoots packets of rays into Embree can be told.

    packet_width: rays of a packet; 1 is the paper's way, None takes the widest the machine supports natively.
    threads: None takes every core the process may use. build_quality: of the BVH, "low", "medium" or "high". robust: no
    ray slips through between two triangles that share an edge; False is Embree's fast setting, the paper's, in which
    some do (docs/trust.md).
    Raises InputError, with the value, for widths that are not native, threads below 1 or beyond 1,024 and unknown build
    qualities; EmbreeError where there is no usable Embree to ask.
    """

    packet_width: int | None = None
    threads: int | None = None
    build_quality: str = "medium"
    robust: bool = True

    def __post_init__(self) -> None:
        check_build_quality(self.build_quality)
        check_robust(self.robust)
        resolve_packet_width(self.packet_width)
        resolve_threads(self.threads)


@dataclass(frozen=True)
class Options(PacketOptions):
    """What every tracer can be told.

    ties: where triangles of one plane overlap, "lowest" stores the lowest prim_id of them (`atra.exact.ties`), "any"
    what float32 put in front. Raises InputError, with the value, for another rule.
    """

    ties: str = "lowest"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_ties(self.ties)


@dataclass(frozen=True)
class PixelOptions(Options):
    """Options of `PixelTracer`: those Embree offers to whoever traces one ray per pixel. All give the same image, up to
    ties and rims of triangles; `sweep=baselines` compares their times.

    packet_rows: rows of pixels in a packet, so that packets of 8 are 8 x 1, 4 x 2, 2 x 4 or 1 x 8 pixels; None: the
    squarest, and of two the wider. coherent: Embree takes the rays of a packet through its tree together. compact: a
    tree that saves memory. tile_order: pixels are traced in tiles;
    "blocks" of 32 x 16 pixels row by row, "rows" as wide as the image, or 16 x 16 pixels along a "morton" curve.
    Raises InputError for rows that a packet cannot have, and for an unknown order.
    """

    packet_rows: int | None = None
    coherent: bool = True
    compact: bool = False
    tile_order: str = "blocks"

    def __post_init__(self) -> None:
        super().__post_init__()
        width, rows = resolve_packet_width(self.packet_width), self.packet_rows
        if rows is not None and not (is_whole_number(rows) and rows >= 1 and width % rows == 0):
            possible = ", ".join(str(1 << k) for k in range(width.bit_length()))
            raise InputError(f"packet_rows is {rows!r}, expected one of {possible} for packets of {width}, or None")
        if self.tile_order not in TILE_ORDERS:
            raise InputError(f"tile_order is {self.tile_order!r}, expected one of {', '.join(TILE_ORDERS)}")


@dataclass(frozen=True)
class RayOptions(PacketOptions):
    """Options of `RayScene`: those of `PacketOptions`.

    With `robust=False` rays also slip past meshes far from the world's origin, where float32 is coarse: of 200,000 rays
    in a closed box that lies a hundred times its size away 2 are lost, at a thousand times 43.
    """


@dataclass(frozen=True)
class CellOptions(Options):
    """Options of tracers that give Embree copies of triangles, cell by cell.

    memory_budget_bytes: refuse plans that need more; None: the memory that is free.
    Raises InputError for a budget that is no number of bytes.
    """

    memory_budget_bytes: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        budget = self.memory_budget_bytes
        if budget is not None and not (isinstance(budget, (int, float, np.number)) and budget >= 0):
            raise InputError(f"memory_budget_bytes is {budget!r}, expected a number of at least 0, or None for none")


@dataclass(frozen=True)
class ReferenceRayOptions(CellOptions):
    """Options of tracers whose packets lie in one cell.

    packet_rows: rows of pixels in a packet, so that packets of 8 are 8 x 1, 4 x 2, 2 x 4 or 1 x 8 pixels; None: what
    suits the cell. A packet or a cell that has no such rows is refused where the cell is known.
    """

    packet_rows: int | None = None


@dataclass(frozen=True)
class AlignedOptions(ReferenceRayOptions):
    """Options of `AlignedTracer` and `FramesTracer`.

    culling: keep of each cell's copy only what its frustum meets. geometry: "copied" shears a copy of the triangles for
    every cell; "instanced" gives the triangles to Embree once and an instance of them per cell, with the shear as its
    transform. An instance is always the whole mesh, so it needs `culling=False`.
    Raises InputError for an unknown geometry, and for instances with culling.
    """

    culling: bool = True
    geometry: str = "copied"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.geometry not in GEOMETRIES:
            raise InputError(f"geometry is {self.geometry!r}, expected one of {', '.join(GEOMETRIES)}")
        if self.geometry == "instanced" and self.culling:
            raise InputError(
                "geometry is 'instanced' and culling is on, but an instance is all of the mesh or nothing; "
                "set culling=False"
            )


@dataclass(frozen=True)
class RasterOptions(Choices):
    """Options of `RasterTracer`.

    threads, ties: as in `Options`. lanes: pixels drawn at once, 4, 8 or 16; None takes as many as the widest vectors of
    this machine hold. The image is the same with all of them.
    Raises InputError, with the value, for other numbers of lanes, for threads and for ties.
    """

    threads: int | None = None
    ties: str = "lowest"
    lanes: int | None = None

    def __post_init__(self) -> None:
        resolve_threads(self.threads)
        check_ties(self.ties)
        if self.lanes is not None and not (is_whole_number(self.lanes) and self.lanes in LANES):
            raise InputError(f"lanes is {self.lanes!r}, expected one of {', '.join(map(str, LANES))}, or None")


@dataclass(frozen=True)
class BvhOptions(Choices):
    """Options of `BvhTracer`.

    threads, ties: as in `Options`. packet_width: rays taken through the tree together, 1, 4, 8 or 16. traversal: "push"
    tests both children of a node when it is entered, and the nearer one comes next; "pop" tests a node when its turn
    comes. The hits are the same. robust: no ray slips through between two triangles that share an edge or a corner
    (Woop, Benthin, Wald 2013); False is a faster test of triangles, with which some do.
    Raises InputError, with the value, for other widths and traversals, for threads and for ties.
    """

    threads: int | None = None
    ties: str = "lowest"
    packet_width: int = 1
    traversal: str = "push"
    robust: bool = True

    def __post_init__(self) -> None:
        check_robust(self.robust)
        resolve_threads(self.threads)
        check_ties(self.ties)
        if self.packet_width not in (1, *LANES):
            raise InputError(f"packet_width is {self.packet_width!r}, expected one of 1, {', '.join(map(str, LANES))}")
        if self.traversal not in TRAVERSALS:
            raise InputError(f"traversal is {self.traversal!r}, expected one of {', '.join(TRAVERSALS)}")


def check_ties(ties: str) -> None:
    """Raise InputError for anything but "lowest" and "any"."""
    if ties not in TIES:
        raise InputError(f"ties is {ties!r}, expected one of {', '.join(TIES)}")


def check_robust(robust: bool) -> None:
    """Raise InputError for anything but True and False."""
    if not isinstance(robust, bool):
        raise InputError(f"robust is {robust!r}, expected True or False")


def native_packet_widths() -> tuple[int, ...]:
    """The packet widths that this machine supports natively, 1 first, ascending."""
    return load_library().native_packet_widths
