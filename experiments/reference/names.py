"""How values, types and helps of options are written in the reference."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from inspect import cleandoc, formatannotation
from typing import Any, get_args, get_type_hints


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


def summary(text: str | None) -> str:
    """The first paragraph of a docstring, on one line."""
    blocks = re.split(r"\n\s*\n", cleandoc(text or ""))
    return next((" ".join(block.split()) for block in blocks if block and not block.startswith("    ")), "")


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
