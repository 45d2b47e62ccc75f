"""Column of the table: its name, type, unit and help, and how it is read from the records of a point."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import MISSING, Field, dataclass, fields
from functools import cache
from types import NoneType, UnionType
from typing import Any, get_args, get_type_hints

from experiments.harness.records import Record

TEXT, WHOLE, REAL, TRUTH = "string", "Int64", "Float64", "boolean"
"""Types of columns, as pandas calls them; each has a missing value."""

_SHOWN = {"s": ("ms", 1e3), "bytes": ("MiB", 2.0**-20)}

_UNITS = {"_per_s": "", "_s": "s", "_bytes": "bytes", "_gib": "GiB", "_degrees": "degrees"}


def middle(values: Sequence[Any]) -> Any:
    """The middle one of some values, the lower of two; what all have alike is itself."""
    return sorted(values)[(len(values) - 1) // 2]


@dataclass(frozen=True)
class Column:
    """A column of the table.

    help: what it holds, for people. read: its value of a record, None = missing; by default the result of its name.
    over: the values of several processes, at least one -> that of the point.
    """

    name: str
    dtype: str
    help: str = ""
    read: Callable[[Record], Any] | None = None
    over: Callable[[Sequence[Any]], Any] = middle

    def value(self, records: Sequence[Record]) -> Any:
        """The value of a point, of each of whose processes there is a record; None where none of them has one."""
        values = [record.results.get(self.name) if self.read is None else self.read(record) for record in records]
        values = [value for value in values if value is not None]
        return self.over(values) if values else None

    @property
    def shown(self) -> tuple[str, float]:
        """The unit that people are shown its numbers in, and the factor that leads to it."""
        return _SHOWN.get(self.unit, (self.unit, 1.0))

    @property
    def unit(self) -> str:
        """What its name ends with: "s", "bytes", "GiB", "degrees", or "" for a plain number or a text."""
        return next((unit for end, unit in _UNITS.items() if self.name.endswith(end)), "")


@cache
def option_columns(options: type, section: str) -> tuple[Column, ...]:
    """A column for every field of an options type, read from `section` of a record's configuration.

    A field's metadata holds its "help" and, where null is a value like any other, the text for "null".
    """
    hints = get_type_hints(options)
    return tuple(_option_column(field, hints[field.name], section) for field in fields(options))


def _option_column(field: Field[Any], hint: Any, section: str) -> Column:
    name, null = field.name, field.metadata.get("null")
    dtype = dtype_of(hint) if null is None else TEXT

    def read(record: Record) -> Any:
        options = record.configuration.get(section, {})
        value = options.get(name)
        if value is None:
            return null if name in options else None
        return str(value) if dtype == TEXT else value

    return Column(name, dtype, field.metadata.get("help", ""), read)


def dtype_of(hint: Any) -> str:
    kinds = set(get_args(hint)) - {NoneType} if isinstance(hint, UnionType) else {hint}
    if kinds == {bool}:
        return TRUTH
    if kinds == {int}:
        return WHOLE
    return REAL if kinds == {float} else TEXT


def default_of(field: Field[Any]) -> Any:
    """The default of a dataclass field, made again where it is made by a function."""
    return field.default if field.default_factory is MISSING else field.default_factory()
