"""Method: one way to find what the rays through a pixel grid see, as a value the harness can measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from experiments.harness.column import Column

if TYPE_CHECKING:
    from atra.geometry.mesh import Mesh
    from atra.geometry.view import View
    from atra.tracing.tracer import Tracer

# Stated again, as the help of the command line has no time for the library; a test holds them equal to it.
LANES = (4, 8, 16)
BUILD_QUALITIES = ("low", "medium", "high")
TIES = ("lowest", "any")

TIES_HELP = (
    "prim_id stored where triangles of one plane overlap: lowest, or any (whichever float32 rounding puts in front)"
)


@dataclass(frozen=True)
class Tracing:
    """What holds for everything that is traced at a point, baselines included: keyword arguments of our tracers."""

    threads: int | None = 1
    build_quality: str = "medium"
    ties: str = "lowest"
    memory_budget_bytes: int | None = None

    @property
    def ours(self) -> dict[str, Any]:
        """What every tracer of atra that uses Embree takes of it, and, as baselines do, the fast setting."""
        return {"threads": self.threads, "build_quality": self.build_quality, "ties": self.ties, "robust": False}


@dataclass(frozen=True)
class Style:
    """How a method looks in every figure."""

    color: str
    marker: str


def always_available() -> str | None:
    """No problem."""
    return None


Make = Callable[["Mesh", "View", Any, Tracing], "Tracer"]


@dataclass(frozen=True)
class Method:
    """A method.

    name: as configured. label: as shown. module: `__name__` of the module that defines it. options: its own typed
    settings, with defaults.
    make: mesh, view, options and what holds for the whole point -> a tracer, neither planned nor built; raises
    InputError and MemoryBudgetError. resolve: options and the image's width -> options without a choice left open.
    variant: a row's options -> what distinguishes it but split and packets, in words, or "". words: width of the
    packets -> the name of such a series, where it is not "<label>, packets of <width>". counters: columns of its own,
    read from its tracer's `counters`. problem: why it cannot run here, None = it can. version: of a foreign package,
    part of a record's identity. is_ours: a method of atra, no other people's tracer. is_peer: a tracer of other
    people that is installed beside atra, such as trimesh; methods of a file are neither. make_rays: mesh, options and
    what holds for the whole point -> what traces batches of rays that come from no camera; None where the method does
    not.
    """

    name: str
    label: str
    style: Style
    options: type
    make: Make
    module: str
    resolve: Callable[[Any, int], Any] = lambda options, width: options
    variant: Callable[[Mapping[str, Any]], str] = lambda row: ""
    words: Callable[[int | None], str] | None = None
    counters: tuple[Column, ...] = ()
    problem: Callable[[], str | None] = always_available
    version: Callable[[], str | None] = always_available
    is_ours: bool = True
    is_peer: bool = False
    make_rays: Callable[[Mesh, Any, Tracing], Any] | None = None

    def has(self, name: str) -> bool:
        """Whether its options have a field of this name."""
        return name in {spec.name for spec in fields(self.options)}

    @property
    def has_cells(self) -> bool:
        """Whether the image is split for it."""
        return self.has("split_x")

    @property
    def has_packets(self) -> bool:
        """Whether the width of its packets is ours to choose; other people's tracers choose theirs."""
        return self.has("packet_width")
