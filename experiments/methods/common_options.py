"""Options that several methods have, and what rows are called that were measured with them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, ClassVar

from atra.tracing.options import Choices
from experiments.harness.method import Tracing
from experiments.harness.options import Settings, Type, taking_all

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
