"""Options as typed values, as plain values for JSON, and as types that Hydra knows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields, make_dataclass
from enum import Enum
from functools import partial
from typing import Any, Protocol, TypeVar, get_args, get_type_hints

from atra.errors import InputError
from experiments.harness.column import default_of


class Named(Protocol):
    """A method or a workload."""

    @property
    def name(self) -> str: ...

    @property
    def options(self) -> type: ...


@dataclass(frozen=True)
class NoOptions:
    """Of a method or a workload that leaves nothing to choose."""


def option(default: Any, help: str, null: str | None = None) -> Any:
    """A field of an options type, with the help that table, report and documents show.

    null: what the table says for null, where that stays open to the end; it would pass for an option that is missing.
    """
    return field(default=default, metadata={"help": help, "null": null})


Kind = TypeVar("Kind", bound=Named)


def plain_options(options: Any) -> dict[str, Any]:
    """An options value as JSON has it: enums by name, tuples as lists."""
    return {name: plain(value) for name, value in asdict(options).items()}


def plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Enum):
        return value.value
    return [plain(one) for one in value] if isinstance(value, list | tuple) else value


def typed_options(kind: type, values: dict[str, Any]) -> Any:
    """The reverse of `plain_options`. Raises InputError for values that the options refuse."""
    hints = get_type_hints(kind)
    return kind(**{name: _typed(hints[name], value) for name, value in values.items()})


def _typed(hint: Any, value: Any) -> Any:
    enum = next((one for one in (hint, *get_args(hint)) if isinstance(one, type) and issubclass(one, Enum)), None)
    if enum is not None and value is not None:
        return value if isinstance(value, enum) else enum(value)
    return tuple(_typed(None, one) for one in value) if isinstance(value, list | tuple) else value


def schema(group: str, named: Named) -> type:
    """The options with the name before them, as a dataclass that Hydra can fill: not frozen, and without checks.

    Lists stand for tuples, which OmegaConf does not know. It is called what chooses it on the command line.
    """
    hints = get_type_hints(named.options)
    own = [
        (one.name, hints[one.name], field(default_factory=partial(default_of, one))) for one in fields(named.options)
    ]
    return make_dataclass(f"{group}={named.name}", [("name", str, field(default=named.name)), *own])


def say_unknown_field(kind: type, path: str) -> str:
    """That `kind` has no such field, and which it has. path: with those it stands in, as "method.split_x"."""
    section, _, name = path.rpartition(".")
    is_schema = "=" in kind.__name__
    owner = kind.__name__ if is_schema else section
    names = [one.name for one in fields(kind)][is_schema:]  # the first of a schema is its name
    expected = f"expected {'one of ' * (len(names) > 1)}{', '.join(names)}" if names else "which has none"
    return f"unknown field {name!r}{' of ' * bool(owner)}{owner}, {expected}"


def find_named(what: str, kinds: Iterable[Kind], name: str) -> Kind:
    """The one called `name`. what: "method" or "workload". Raises InputError, naming those there are, for others."""
    known = {one.name: one for one in kinds}
    if name not in known:
        raise InputError(f"unknown {what} {name!r}, expected one of {', '.join(known)}")
    return known[name]
