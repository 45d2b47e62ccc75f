"""Checks of arguments that have to be one of a few values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from atra.errors import InputError
from atra.whole_numbers import is_whole_number


def check_choice(name: str, value: Any, choices: Sequence[Any], *, or_none: bool = False) -> None:
    """Raise InputError, with the value, for an argument that is none of the choices: texts or whole numbers.

    or_none: None is allowed, too.
    """
    if value is None and or_none:
        return
    if not (isinstance(value, str) or is_whole_number(value)) or value not in choices:
        expected = f"{', '.join(map(str, choices))}{', or None' * or_none}"
        raise InputError(f"{name} is {value!r}, expected one of {expected}")


def check_flags(**flags: Any) -> None:
    """Raise InputError for the first argument that is neither True nor False."""
    for name, value in flags.items():
        if not isinstance(value, bool):
            raise InputError(f"{name} is {value!r}, expected True or False")
