"""`atra new-method mine`: writes mine.py, a method that works, with its test."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from importlib.machinery import PathFinder
from pathlib import Path

from atra.errors import InputError, StorageError
from experiments.commands.program import COMMAND
from experiments.methods import METHODS

USAGE = f"{COMMAND} new-method mine"

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def _is_module(name: str) -> bool:
    """Whether `import NAME` finds a module, which a file of that name would hide."""
    spec = PathFinder.find_spec(name)
    # A folder without code, such as one of results, is a package to Python, too.
    return name in sys.stdlib_module_names or (spec is not None and spec.origin is not None)


def run_new_method(arguments: Sequence[str]) -> Path:
    """Write the file into this folder and say what to do next; returns its path. Raises InputError for a name that is
    taken, that of a module or no name, and for a file that is there."""
    if len(arguments) != 1:
        raise InputError(f"expected: {USAGE}")
    name = arguments[0].removesuffix(".py")
    if not _NAME.fullmatch(name) or name in {method.name for method in METHODS}:
        raise InputError(
            f"a method cannot be called {name!r}, expected small letters that no method has; expected: {USAGE}"
        )
    path = Path(f"{name}.py")
    if not path.exists() and _is_module(name):
        raise InputError(
            f"a method cannot be called {name!r}: Python has a module of that name, in whose place {path} would be "
            f"imported; expected another name, as in {USAGE}"
        )
    template = Path(__file__).with_name("new_method_template.txt").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(template.replace("NAME", name))
    except FileExistsError:
        raise InputError(f"{path} is there already; choose another name") from None
    except OSError as error:
        raise StorageError(f"{path} cannot be written: {error}") from None
    print(f"written: {path}")
    print(f"test: python {path}")
    print(f"measure: {COMMAND} method_file={path} scene=cornell_box width=256 height=256")
    print(
        f"beside ours, with figures: {COMMAND} sweep=methods method_file={path} scene=cornell_box width=256 height=256"
    )
    return path
