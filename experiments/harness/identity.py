"""The identity of a record: configuration, machine, and the code that made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from atra.compiled.instruction_sets import chosen_instruction_set
from atra.embree.library import embree_version
from experiments.harness.environment import Environment, read_environment, stable_fields
from experiments.harness.point import Point
from experiments.harness.processes.launching import run_worker
from experiments.harness.records import Record, point_id
from experiments.harness.sources import Code, Source

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("atra", "experiments", "scenes")
"""Packages whose code is followed. The versions of others are part of the machine, or of the method that uses them."""

_DECIDES_NOTHING = ("experiments.drawing.style", "experiments.results", "scenes.directory", "scenes.loading")
"""Modules, and packages with all below them, whose code is not followed, since no outcome of a worker depends on it.

Figures alone read the style of a method. Statistics and columns are made of a record when it is there. A mesh is known
by its hash and a camera by its numbers, both fields of the point, however a scene was built, found or read; light is
not, so `scenes.lit` counts where it is used.
"""

_REGISTRIES = ("experiments.methods", "experiments.workloads")
"""Lists of all that there is, by which everything would lead to everything; what lies below them counts."""


def current_environment() -> Environment:
    """This machine now, with the version Embree reports.

    Raises EmbreeError if there is no usable Embree, and InputError for an instruction set that this machine lacks.
    """
    return read_environment(embree_version(), chosen_instruction_set())


def identity(point: Point, environment: Environment) -> str:
    """The point's identity: its configuration, the machine, and the code that measures it."""
    return _identity(point, asdict(environment))


def identity_of(record: Record, point: Point) -> str:
    """The identity that `record` has if this very code has measured `point`, wherever that was."""
    return _identity(point, record.environment)


def _identity(point: Point, environment: Mapping[str, Any]) -> str:
    measured_by = {"code_sha256": code_sha256(point), "version": point.method.version()}
    return point_id(point.configuration() | measured_by, stable_fields(environment))


def code_sha256(point: Point) -> str:
    """Hash of the code that measures the point: that of its method, of its workload and of the harness."""
    return _sha256(code_roots(point))


def code_roots(point: Point) -> tuple[str, ...]:
    """Modules where that code begins: the method's, and what its file uses; the workload's; what starts a worker, and
    with it what runs there."""
    used = (module for given in point.method.uses for module in _code(frozenset(_OURS)).homes(given))
    counted = (module for module in used if decides(module) and read_source(module) is not None)
    return tuple(dict.fromkeys([point.method.module, *counted, *point.workload.modules, run_worker.__module__]))


@cache
def _sha256(roots: tuple[str, ...]) -> str:
    """The sources are read once: what is changed while a sweep runs has no part in what that sweep has loaded."""
    return _code(frozenset([*_OURS, *(module.partition(".")[0] for module in roots)])).sha256(roots)


@cache
def _code(packages: frozenset[str]) -> Code:
    """The code of these packages, less what decides nothing."""

    def read(module: str) -> Source | None:
        return read_source(module) if module.partition(".")[0] in packages and decides(module) else None

    return Code(read)


def decides(module: str) -> bool:
    """Whether the outcome of a worker may depend on the code of a module."""
    below = tuple(f"{name}." for name in _DECIDES_NOTHING)
    return module not in _REGISTRIES and not f"{module}.".startswith(below)


def read_source(module: str) -> Source | None:
    """The source of a module of this project, or of a package that can be imported; None if there is none."""
    package, *below = module.split(".")
    place = _place(package).joinpath(*below)
    for path in (place.with_suffix(".py"), place / "__init__.pyi", place / "__init__.py"):  # a stub names lazy imports
        if path.is_file():
            return Source(module, path.read_text(encoding="utf-8"), path.stem == "__init__")
    return None


@cache
def _place(package: str) -> Path:
    """The folder of a package, or the file of a module without one, less its suffix."""
    if package in _OURS:
        return _ROOT / package
    spec = find_spec(package)
    origin = Path(package if spec is None or spec.origin is None else spec.origin)
    return origin.parent if origin.name == "__init__.py" else origin.with_suffix("")
