"""Run a study: `python -m experiments.studies NAME ARGUMENT... option=value...`; the study's file says which."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from atra.errors import AtraError, InputError

STUDIES = {
    **{name: f"experiments.studies.{name}" for name in ("candidates", "first_image", "lens_speed", "paired")},
    **{name: f"experiments.light.{name}" for name in ("equal_error", "equal_error_blocks")},
}
"""By name, the file of each; those of light lie in their own wing."""


def run(arguments: Sequence[str]) -> None:
    """Run the study that the first argument names. Raises InputError for a name or an option that there is not."""
    name, *rest = arguments or ("",)
    if name not in STUDIES:
        raise InputError(f"the study is {name!r}, expected one of {', '.join(STUDIES)}")
    module = import_module(STUDIES[name])
    options = {key: _value(value) for key, _, value in (word.partition("=") for word in rest if "=" in word)}
    given = [word for word in rest if "=" not in word]
    try:
        inspect.signature(module.study).bind(*given, **options)
    except TypeError as error:
        raise InputError(f"{name}: {error}\n{inspect.signature(module.study)}\n{module.__doc__}") from None
    module.study(*given, **options)


def _value(text: str) -> Any:
    """A number, a truth or a text; with a comma in it, a tuple of these, as in `1,2` or `1,`."""
    if "," in text:
        return tuple(_value(part) for part in text.split(",") if part)
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


if __name__ == "__main__":
    try:
        run(sys.argv[1:])
    except AtraError as error:
        sys.exit(str(error))
