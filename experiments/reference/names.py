"""Public names: what the packages of the library offer, with signatures and the first paragraph of each docstring."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cached_property
from importlib import import_module
from types import FunctionType
from typing import Any, get_type_hints

from experiments.reference.writing import (
    choices_of,
    code,
    help_of,
    say_default,
    say_type,
    say_value,
    summary,
    table,
)

PACKAGES = ("atra", "atra.light")
"""Packages whose `__all__` is public: what rays see, and the light of pictures and lightmaps."""


def public_names() -> str:
    """A section for each package, and in it one for each name."""
    parts = ["## Public names\n"]
    for package in PACKAGES:
        module = import_module(package)
        parts.append(f"### Package `{package}`\n\n{summary(module.__doc__)}\n")
        parts += [_entry(package, name, getattr(module, name)) for name in sorted(module.__all__)]
    return "\n".join(parts)


def _entry(package: str, name: str, value: Any) -> str:
    title = f"#### `{package}.{name}`\n"
    if inspect.isclass(value):
        return "\n".join([title, *_class(name, value)])
    if callable(value):
        return "\n".join([title, f"{code(f'{name}{_signature(value)}')}\n", f"{summary(value.__doc__)}\n"])
    return "\n".join([title, f"{code(f'{name} = {value!r}')}\n"])


def _class(name: str, kind: type) -> Iterator[str]:
    """Signature, summary, fields of a dataclass or members of an Enum, then properties and methods."""
    if issubclass(kind, Enum):
        yield f"{summary(kind.__doc__)}\n"
        yield f"Members: {', '.join(code(f'{one.name} = {one.value!r}') for one in kind)}\n"
        return
    if issubclass(kind, Exception):
        yield f"{code(f'{name}({kind.__mro__[1].__name__})')}\n"
    elif not getattr(kind, "_is_protocol", False):
        yield f"{code(f'{name}{_signature(kind.__init__)}')}\n"
    yield f"{summary(kind.__doc__)}\n"
    yield from _fields(kind)
    members = list(_members(kind))
    if members:
        yield "\n".join(members) + "\n"


def _fields(kind: type) -> Iterator[str]:
    if not is_dataclass(kind):
        return
    hints = get_type_hints(kind)
    rows = [
        (
            code(one.name),
            code(say_type(one.type)),
            "required" if say_default(one) == "required" else code(say_default(one)),
            ", ".join(map(code, choices_of(hints[one.name], one))),
            help_of(kind, one),
        )
        for one in fields(kind)
        if one.init and not one.name.startswith("_")
    ]
    if rows:
        yield table(("field", "type", "default", "choices", "meaning"), rows)


def _members(kind: type) -> Iterator[str]:
    """A line for each public property and method that the library defines, a base class's included."""
    own = [one for one in kind.__mro__ if one.__module__.partition(".")[0] == "atra"]
    names = sorted({name for one in own for name in vars(one) if not name.startswith("_")})
    for name in names:
        value = inspect.getattr_static(kind, name)
        text = summary(inspect.getdoc(getattr(kind, name, None)))
        if isinstance(value, property | cached_property):
            yield f"- {code(name)}: {summary(inspect.getdoc(value))}".rstrip(": ")
        elif isinstance(value, classmethod | staticmethod | FunctionType):
            function = value if isinstance(value, FunctionType) else value.__func__
            bound = not isinstance(value, staticmethod)
            yield f"- {code(f'{name}{_signature(function, bound)}')}: {text}".rstrip(": ")


def _signature(function: Any, bound: bool = True) -> str:
    """Parameters and the type of what is returned, written alike by every Python."""
    parameters = list(inspect.signature(function).parameters.values())
    if bound and parameters and parameters[0].name in ("self", "cls"):
        del parameters[0]
    written = list(_parameters(parameters))
    returned = inspect.signature(function).return_annotation
    arrow = "" if returned in (inspect.Signature.empty, None, "None") else f" -> {say_type(returned)}"
    return f"({', '.join(written)}){arrow}"


def _parameters(parameters: list[inspect.Parameter]) -> Iterator[str]:
    starred = False
    for one in parameters:
        if one.kind is one.VAR_POSITIONAL:
            starred = True
        elif one.kind is one.KEYWORD_ONLY and not starred:
            starred = True
            yield "*"
        stars = "*" if one.kind is one.VAR_POSITIONAL else "**" if one.kind is one.VAR_KEYWORD else ""
        kind = "" if one.annotation is one.empty else f": {say_type(one.annotation)}"
        default = "" if one.default is one.empty else f"{' = ' if kind else '='}{say_value(one.default)}"
        yield f"{stars}{one.name}{kind}{default}"
