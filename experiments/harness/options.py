"""Options as typed values with help and choices, and as plain values for JSON."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import Field, asdict, dataclass, field, fields
from difflib import get_close_matches
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

from atra.errors import InputError
from atra.whole_numbers import is_whole_number


def option(
    default: Any, help: str, *, choices: tuple[Any, ...] = (), unit: str = "", null: str | None = None,
    ends: tuple[int, int | None] | None = None,
) -> Any:  # fmt: skip
    """A field of an options type.

    default: a value, or the type of one that each has of its own, such as dict. choices: the values there are, beside
    None where the type allows it; (): any of its type. unit: of a number. null: what tables show for None where it is a
    choice like any other; without it they show that nothing is known. ends: as of `whole`.
    """
    metadata = {"help": help, "choices": choices, "unit": unit, "null": null, "ends": ends}
    made: dict[str, Any] = {"default_factory" if isinstance(default, type) else "default": default}
    return field(metadata=metadata, **made)


types_of: Callable[[type], dict[str, Any]] = cache(get_type_hints)
"""The types of an options type's fields, by name; reading them takes longer than checking options by them."""


def whole(default: Any, help: str, least: int, most: int | None = None) -> Any:
    """An option that is a whole number from the least to the most that it may be, None = any, or null where its type
    allows that."""
    return option(default, help, ends=(least, most))


class Settings:
    """Options of a method or of a workload, or another section of the configuration.

    section: where they stand on the command line. Raises InputError, naming a field as it is written there, for a value
    that is none of its choices or outside its range. Lists become tuples.
    """

    section: ClassVar[str] = "workload"

    def __post_init__(self) -> None:
        path = f"{self.section}." if self.section else ""
        for name, spec in self.__dataclass_fields__.items():
            value, told = getattr(self, name), spec.metadata
            if isinstance(value, list):
                object.__setattr__(self, name, tuple(tuple(item) if isinstance(item, list) else item for item in value))
            _check_choice(value, types_of(type(self))[name], told.get("choices", ()), path + name)
            if told.get("ends") and value is not None:
                check_whole_number(path + name, value, *told["ends"])

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Any]]


def _check_choice(value: Any, kind: Any, choices: tuple[Any, ...], name: str) -> None:
    """Raise InputError for a value that is none of the choices."""
    may_be_none = NoneType in get_args(kind)
    if not choices or (value is None and may_be_none):
        return
    if not (isinstance(value, str) or is_whole_number(value)) or value not in choices:
        or_none = ", or null" if may_be_none else ""
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(map(str, choices))}{or_none}")


def check_whole_number(name: str, value: Any, least: int, most: int | None = None) -> None:
    """Raise InputError for what is no whole number from the least to the most that it may be, None = any. name: as on
    the command line."""
    if not is_whole_number(value) or value < least or (most is not None and value > most):
        expected = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise InputError(f"{name} is {value!r}, expected a whole number {expected}")


@dataclass(frozen=True)
class NoOptions:
    """The options of a method or a workload that has none."""


Kind = TypeVar("Kind", bound=Any)  # a method or a workload


def plain_options(options: Any) -> dict[str, Any]:
    """An options value as JSON has it: enums by name, tuples as lists."""
    return {name: plain(value) for name, value in asdict(options).items()}


def plain(value: Any) -> Any:
    """A value as JSON has it."""
    if isinstance(value, Enum):
        return value.value
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


_EXPECTED = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    list: "a list, as in '[0,1,3]'",
    dict: "values by name",
}


def typed(kind: type, values: Mapping[str, Any], path: str = "") -> Any:
    """Plain values, as YAML and JSON have them, as a value of the dataclass `kind`: the reverse of `plain_options`.

    path: where they stand on the command line, such as "method.". Raises InputError, naming field and value, for what
    is of another type, and as the dataclass does.
    """
    hints = types_of(kind)
    return kind(**{name: _of_type(value, hints[name], path + name) for name, value in values.items()})


def _of_type(value: Any, hint: Any, name: str) -> Any:
    """The value as its type has it: whole numbers are numbers, and numbers are texts, where these are expected."""
    hints = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    if hint is Any or (value is None and NoneType in hints):
        return value
    for kind in hints:
        origin = get_origin(kind) or kind
        if issubclass(origin, Enum):
            for member in origin:
                if value in (member.value, member.name):
                    return member
        if type(value) is origin or (origin is list and isinstance(value, tuple)):
            (item,) = get_args(kind)[-1:] or (Any,)
            if origin is dict:
                return {str(key): _of_type(part, item, f"{name}.{key}") for key, part in value.items()}
            return [_of_type(part, item, name) for part in value] if origin is list else value
    if float in hints and is_whole_number(value):
        return float(value)
    if str in hints and isinstance(value, int | float):
        return str(value)
    raise InputError(f"{name} is {value!r}, expected {say_type(hint)}")


def say_type(hint: Any) -> str:
    """The values of a type, in words."""
    if get_origin(hint) in (Union, UnionType):
        return " or ".join(map(say_type, get_args(hint)))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return f"one of {', '.join(str(member.value) for member in hint)}"
    return "null" if hint is NoneType else _EXPECTED.get(get_origin(hint) or hint, "a text")


def say_option(spec: Field[Any]) -> str:
    """The help of an option, with its choices and its unit."""
    told = spec.metadata
    choices = f"one of {', '.join(map(str, told['choices']))}" if told.get("choices") else ""
    return "; ".join(filter(None, [told.get("help"), choices, told.get("unit")]))


def say_options(group: str, named: Any) -> str:
    """The options with their help, a line each, as they are written on the command line."""
    lines = [f"{group}.{spec.name}: {say_option(spec)}" for spec in fields(named.options)]
    return "\n".join(lines) or f"{group}={named.name} has none"


def find_named(what: str, kinds: Iterable[Kind], name: str, beside: Iterable[str] = ()) -> Kind:
    """The one called `name`. what: "method" or "workload". Raises InputError for others, naming those there are: the
    names `beside`, then those of `kinds`."""
    known = {kind.name: kind for kind in kinds}
    if name not in known:
        raise InputError(say_unknown_choice(what, name, dict.fromkeys([*beside, *known])))
    return known[name]


def say_unknown_choice(what: str, name: str, names: Iterable[str]) -> str:
    """That no `what` is called `name`, which names there are, and the nearest of them where one is near."""
    names = list(names)
    near = get_close_matches(name, names, 1)
    meant = f"; did you mean {near[0]}?" if near else ""
    return f"unknown {what} {name!r}, expected one of {', '.join(names)}{meant}"
