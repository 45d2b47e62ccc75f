"""Public names: what the packages of the library offer, with signatures and the first paragraph of each docstring."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from functools import cached_property
from importlib import import_module
from inspect import cleandoc, formatannotation
from types import FunctionType
from typing import Any, get_args, get_type_hints

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
            code(member.name),
            code(say_type(member.type)),
            "required" if say_default(member) == "required" else code(say_default(member)),
            ", ".join(map(code, choices_of(hints[member.name], member))),
            help_of(kind, member),
        )
        for member in fields(kind)
        if member.init and not member.name.startswith("_")
    ]
    if rows:
        yield table(("field", "type", "default", "choices", "meaning"), rows)


def _members(kind: type) -> Iterator[str]:
    """A line for each public property and method that the library defines, a base class's included."""
    own = [ancestor for ancestor in kind.__mro__ if ancestor.__module__.partition(".")[0] == "atra"]
    names = sorted({name for ancestor in own for name in vars(ancestor) if not name.startswith("_")})
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
    for parameter in parameters:
        if parameter.kind is parameter.VAR_POSITIONAL:
            starred = True
        elif parameter.kind is parameter.KEYWORD_ONLY and not starred:
            starred = True
            yield "*"
        stars = (
            "*"
            if parameter.kind is parameter.VAR_POSITIONAL
            else "**"
            if parameter.kind is parameter.VAR_KEYWORD
            else ""
        )
        kind = "" if parameter.annotation is parameter.empty else f": {say_type(parameter.annotation)}"
        value, sign = parameter.default, " = " if kind else "="
        default = "" if value is parameter.empty else f"{sign}{say_value(value)}"
        yield f"{stars}{parameter.name}{kind}{default}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown, or "" without rows."""
    lines = [" | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *(f"| {line} |" for line in lines)]) + "\n"


def code(text: str) -> str:
    """Text set as code; "" stays "". A table would take a bar in it for the end of a cell, so types use "or"."""
    return f"`{text}`" if text else ""


def say_type(annotation: Any) -> str:
    """An annotation as it is written in code, with "or" in place of "|"; an Enum is named."""
    text = annotation if isinstance(annotation, str) else formatannotation(annotation)
    # Private aliases of modules say nothing to readers: `atra.geometry.mesh.Mesh` is Mesh.
    return re.sub(r"\b(?:[a-z_]\w*\.)+(?=[A-Z])", "", text).replace(" | ", " or ")


def say_value(value: Any) -> str:
    """A default as it is written in code, and in configuration."""
    if isinstance(value, Enum):
        return str(value.value)
    if value is ...:  # an option that stays as it is unless it is given
        return "..."
    return value.__name__ if callable(value) and hasattr(value, "__name__") else repr(value)


def say_default(field: Field[Any]) -> str:
    """The default of a field; "required" where it has none, and "" where it is a section of its own."""
    if field.default is not MISSING:
        return "required" if field.default == "???" else say_value(field.default)
    if field.default_factory is MISSING:
        return "required"
    made = field.default_factory()
    return "" if is_dataclass(made) else say_value(made)


def choices_of(hint: Any, field: Field[Any] | None = None) -> tuple[str, ...]:
    """The values to choose from: those that the field's metadata lists, or those of an Enum, or none."""
    listed = field.metadata.get("choices") if field is not None else None
    enums = [
        candidate
        for candidate in (hint, *get_args(hint))
        if isinstance(candidate, type) and issubclass(candidate, Enum)
    ]
    return tuple(map(str, listed or ())) or tuple(str(member.value) for enum in enums for member in enum)


def paragraphs(text: str | None) -> list[str]:
    """The paragraphs of a docstring, each on one line; code blocks are left out."""
    blocks = re.split(r"\n\s*\n", cleandoc(text or ""))
    return [" ".join(block.split()) for block in blocks if block and not block.startswith("    ")]


def summary(text: str | None) -> str:
    """The first paragraph of a docstring, on one line."""
    return next(iter(paragraphs(text)), "")


def help_of(owner: type, field: Field[Any]) -> str:
    """What a field means: the help in its metadata, what the docstring of its class says behind its name, or what that
    of its Enum says."""
    given = field.metadata.get("help")
    if given:
        return str(given)
    for kind in owner.__mro__:
        if is_dataclass(kind) and (text := _said_of(kind, field.name)):
            return text
    hint = get_type_hints(owner)[field.name]
    return summary(hint.__doc__) if isinstance(hint, type) and issubclass(hint, Enum) else ""


def _said_of(kind: type, name: str) -> str:
    """What a docstring says of one name: under it in NumPy's form, or behind it, up to the next name, in one like
    "width, height: pixels. fov: degrees. Raises ..."."""
    under = re.search(rf"^(?:\w+, )*{name}(?:, \w+)* :.*\n((?: +.*\n)+)", cleandoc(kind.__doc__ or "") + "\n", re.M)
    if under:
        return " ".join(under[1].split())
    names = "|".join(re.escape(spec.name) for spec in fields(kind))
    text = " ".join(cleandoc(kind.__doc__ or "").split())
    pieces = re.split(rf"(?<![\w`.])((?:{names})(?:, (?:{names}))*): ", text)
    said = next(
        (after for before, after in zip(pieces[1::2], pieces[2::2], strict=True) if name in before.split(", ")), ""
    )
    return re.split(r"\s(?=Raises )", said)[0].strip()
