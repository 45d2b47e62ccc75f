"""Method: one way to find what the rays through a pixel grid see, as a value the harness can measure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from atra.bvh.scene import BvhScene
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracers.tracer import Tracer
from experiments.harness.column import Column

PACKET_WIDTHS = (1, 4, 8, 16)


@dataclass(frozen=True)
class Tracing:
    """What holds for everything that is traced at a point, baselines included.

    threads: None = every core. build_quality: Embree's. ties: see `atra.judge.ties`.
    """

    threads: int | None = 1
    build_quality: str = "medium"
    ties: str = "lowest"
    memory_budget_bytes: int | None = None

    @property
    def ours(self) -> dict[str, Any]:
        """What every tracer of atra that uses Embree takes of it, and, as baselines do, the fast setting."""
        return {"threads": self.threads, "build_quality": self.build_quality, "ties": self.ties, "robust": False}


WATERTIGHT = {"robust": True}
"""What is shown to people, unlike what is measured, is traced with."""


@dataclass(frozen=True)
class Style:
    """How a method looks in every figure."""

    color: str
    marker: str


def option(default: Any, help: str, null: str | None = None) -> Any:
    """A field of an options type, with the help that table, report and documents show.

    null: what the table says for null, where that stays open to the end; it would pass for an option that is missing.
    """
    return field(default=default, metadata={"help": help, "null": null})


def robust_option() -> Any:
    """The field `robust` of a method of ours. It is off unless a sweep asks for it: what the paper measured, and what
    all tables without the column were measured with, is Embree's fast setting."""
    return option(False, "no ray slips through between two triangles; off: Embree's fast setting, as in the paper")


def say_robust(row: Mapping[str, Any]) -> list[str]:
    """What a row is called that was measured with it: nothing where it was not, or is older than the option."""
    return ["robust"] if row.get("robust") in (True,) else []


def check_packet_width(width: int | None) -> None:
    """Raise InputError for a width Embree has no packets of; whether it is native is asked later."""
    if width is not None and width not in PACKET_WIDTHS:
        widths = ", ".join(str(width) for width in PACKET_WIDTHS)
        raise InputError(f"method.packet_width is {width}, expected one of {widths} or null")


@dataclass(frozen=True)
class NoOptions:
    """Of a method that leaves nothing to choose."""


def always_available() -> str | None:
    """No problem."""
    return None


Make = Callable[[Mesh, View, Any, Tracing], Tracer]


@dataclass(frozen=True)
class Method:
    """A method.

    name: as configured. label: as shown. options: its own typed settings, with defaults; what it has not, it has not.
    make: mesh, view, options and what holds for the whole point -> a tracer, neither planned nor built; raises
    InputError and MemoryBudgetError. resolve: options and the image's width -> options without a choice left open.
    variant: a row's options -> what distinguishes it but split and packets, in words, or "". words: width of the
    packets -> the name of such a series, where it is not "<label>, packets of <width>". counters: columns of its own,
    read from its tracer's `counters`. problem: why it cannot run here, None = it can. version: of a foreign package,
    part of a record's identity. is_ours: a method of atra, no other people's tracer. make_rays: mesh, options and what
    holds for the whole point -> what traces batches of rays that come from no camera; None where the method does not.
    """

    name: str
    label: str
    style: Style
    options: type
    make: Make
    resolve: Callable[[Any, int], Any] = lambda options, width: options
    variant: Callable[[Mapping[str, Any]], str] = lambda row: ""
    words: Callable[[int | None], str] | None = None
    counters: tuple[Column, ...] = ()
    problem: Callable[[], str | None] = always_available
    version: Callable[[], str | None] = always_available
    is_ours: bool = True
    make_rays: Callable[[Mesh, Any, Tracing], BvhScene] | None = None

    def has(self, name: str) -> bool:
        """Whether its options have a field of this name."""
        return name in {one.name for one in fields(self.options)}

    @property
    def has_cells(self) -> bool:
        """Whether the image is split for it."""
        return self.has("split_x")

    @property
    def has_packets(self) -> bool:
        """Whether the width of its packets is ours to choose; other people's tracers choose theirs."""
        return self.has("packet_width")
