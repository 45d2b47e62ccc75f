"""Classes of files and installed packages as methods of the harness."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Collection, Iterable, Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType, NoneType, UnionType
from typing import Any, get_args, get_type_hints

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.tracing.tracer import Tracer
from experiments.harness.column import default_of
from experiments.harness.entry_points import METHODS_GROUP, digest_of_files, name_of_file, offers
from experiments.harness.method import Method, Style, Tracing
from experiments.harness.options import NoOptions
from experiments.harness.point import Point
from experiments.methods.outside.beside import use_helpers
from experiments.methods.outside.guarded import Guarded, PreparedGuarded

_COLORS, _MARKERS = ("#8C510A", "#01665E", "#762A83", "#B2182B"), "hpd<>8"

_PLAIN_TYPES = (int, float, str, bool)

_NAME = re.compile(r"[A-Za-z]\w*")


def outside_methods(
    taken: Collection[str], files: Collection[str], names: Iterable[str] | None = None
) -> Iterator[Method]:
    """The methods of wings and installed packages, then those of files. taken: names of the core. names: of those that
    are wanted, None = all.

    A package that cannot be used becomes a method whose points are skipped with the reason. Raises InputError for such
    a file.
    """
    number = 0
    for offer in offers(METHODS_GROUP, names):
        problem = offer.problem
        if isinstance(offer.value, Method) and offer.value.name == offer.name not in taken:
            yield offer.value
            continue
        if problem is None:
            try:
                yield method_of(offer.name, offer.value, offer.version, number, taken)
            except InputError as error:
                problem = str(error)
        if problem is not None and offer.name not in taken and _NAME.fullmatch(offer.name):
            yield _unusable(offer.name, problem, offer.version, number)
        number += 1
    for path in files:
        if names is None or name_of_file(path) in names:
            yield load_file(path, number, taken, files)
        number += 1


def load_file(path: str | Path, number: int, taken: Collection[str], in_use: Collection[str] = ()) -> Method:
    """The method that a file defines: its one class with `prepare`, or the one that it calls `METHOD`. The method is
    called as the file is. Modules beside the file that it imports are part of its version.
    number: of methods from outside before it, for its colour. in_use: the method files of this run.

    Raises InputError for a file that cannot be read or imported, and as `use_helpers` and `method_of`.
    """
    path = _whole(path)
    name = name_of_file(str(path))
    if path.suffix != ".py" or not path.is_file():
        raise InputError(f"method_file is {str(path)!r}, expected a Python file; `atra new-method mine` writes one")
    helpers = use_helpers(path, [_whole(file) for file in in_use])
    try:
        module = _imported(f"atra_method_file_{name}", path)
    except Exception as error:  # whatever the file raises is told
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise InputError(f"method_file {path} cannot be imported, {told}") from error
    version = f"{path.name} sha256:{digest_of_files([path, *helpers])}"
    return method_of(name, _method_class(module, path), version, number, taken)


def _whole(path: str | Path) -> Path:
    return Path(os.path.abspath(Path(path).expanduser()))


def _imported(module_name: str, path: Path) -> ModuleType:
    spec = spec_from_file_location(module_name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[module_name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def _method_class(module: ModuleType, path: Path) -> Any:
    if hasattr(module, "METHOD"):
        return module.METHOD
    own = [kind for kind in vars(module).values() if isinstance(kind, type) and kind.__module__ == module.__name__]
    methods = [kind for kind in own if _is_method(kind)]
    if len(methods) != 1:
        names = ", ".join(kind.__name__ for kind in methods) or "none"
        raise InputError(
            f"method_file {path} has these classes with a function prepare: {names}; expected one, or METHOD = its name"
        )
    return methods[0]


def _is_method(kind: Any) -> bool:
    return isinstance(kind, type) and callable(getattr(kind, "prepare", None))


def method_of(name: str, kind: Any, version: str, number: int, taken: Collection[str]) -> Method:
    """A class with the protocol `atra.Method` as a method; its fields are its options, where it is a dataclass, and
    `label` is its name in figures. Raises InputError for what is no such class, for a name that is taken, and for
    options that no command line could set."""
    if not _NAME.fullmatch(name) or name in taken:
        raise InputError(f"a method from outside is called {name!r}, expected a name of letters that atra does not use")
    if not _is_method(kind):
        raise InputError(f"method {name} is {kind!r:.100}, expected a class with a function prepare")
    options: Any = kind if is_dataclass(kind) else NoOptions
    _check_options(name, options)

    def make(mesh: Mesh, view: View, options: Any, tracing: Tracing) -> Tracer:
        own = options if isinstance(options, kind) else kind()
        return Tracer(mesh, view, Guarded(own), threads=tracing.threads, ties="any")

    def variant(row: Any) -> str:
        defaults = {field.name: field.default for field in fields(options)}
        told = {name: row.get(name, default) for name, default in defaults.items()}
        return ", ".join(f"{name} {value}" for name, value in told.items() if value != defaults[name])

    return Method(
        name, str(getattr(kind, "label", name)), _style(number), options, make, PreparedGuarded.__module__,
        variant=variant, version=partial(str, version), is_ours=False,
    )  # fmt: skip


def _check_options(name: str, options: Any) -> None:
    hints = get_type_hints(options)
    for field in fields(options):
        name_of, hint = f"option {field.name} of method {name}", hints[field.name]
        kinds = set(get_args(hint)) - {NoneType} if _is_union(hint) else {hint}
        if not all(kind in _PLAIN_TYPES or (isinstance(kind, type) and issubclass(kind, Enum)) for kind in kinds):
            raise InputError(f"{name_of} is of type {hint}, expected a plain one")
        is_plain = isinstance(default_of(field), (*_PLAIN_TYPES, Enum, NoneType))
        if field.name in Point.__dataclass_fields__ or not is_plain:
            raise InputError(f"{name_of} needs a default, and a name that no point has")


def _is_union(hint: Any) -> bool:
    return isinstance(hint, UnionType) or type(None) in get_args(hint)


def _unusable(name: str, problem: str, version: str, number: int) -> Method:
    def make(mesh: Mesh, view: View, options: Any, tracing: Tracing) -> Tracer:
        raise InputError(problem)

    return Method(
        name, name, _style(number), NoOptions, make, PreparedGuarded.__module__, problem=partial(str, problem),
        version=partial(str, version), is_ours=False,
    )  # fmt: skip


def _style(number: int) -> Style:
    return Style(_COLORS[number % len(_COLORS)], _MARKERS[number % len(_MARKERS)])
