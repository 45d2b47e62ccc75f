"""The identity of a record: configuration, machine and version of the method. Whether it is as old as the code that
measured it, tell the files that its worker had loaded in the end.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from atra.compiled.instruction_sets import chosen_instruction_set
from atra.embree.library import embree_version
from experiments.harness.environment import read_environment, stable_fields
from experiments.harness.point import Point
from experiments.harness.records import Record, point_id

_ROOT = Path(__file__).resolve().parents[2]
_OURS = ("atra", "experiments", "scenes")

_DECIDES_NOTHING = (
    "experiments/drawing/style.py", "experiments/results/", "experiments/registry.py",
    "experiments/methods/__init__.py", "experiments/workloads/__init__.py", "scenes/",
)  # fmt: skip
"""Files that no measured number depends on. Figures alone read the style of a method. Statistics and columns are made
of a record when it is there. Registries list what others define. A mesh is known by its hash and a camera by its
numbers, both fields of the point, however a scene was built, found or read."""

_LIGHT = "scenes/lit/"
"""Lights and materials of scenes, which no hash of a mesh tells."""


def current_environment() -> dict[str, Any]:
    """This machine now, with the version Embree reports.

    Raises EmbreeError if there is no usable Embree, and InputError for an instruction set that this machine lacks.
    """
    return read_environment(embree_version(), chosen_instruction_set())


def identity(point: Point, environment: Mapping[str, Any]) -> str:
    """The point's identity on a machine: its configuration, the machine, and the version of its method."""
    return point_id(point.configuration() | {"version": point.method.version()}, stable_fields(environment))


def loaded_files(point: Point) -> dict[str, str]:
    """The files with code of this project, and of the packages of the point's method and workload, that this process
    has loaded and that decide what it measures: below their package's folder, each with the hash of its bytes."""
    packages = {*_OURS, *(name.partition(".")[0] for name in (point.method.module, point.workload.package))}
    files = {}
    for name, module in list(sys.modules.items()):
        path = Path(str(getattr(module, "__file__", None) or ""))
        if name.partition(".")[0] in packages and path.suffix == ".py":
            depth = name.count(".") + (path.stem == "__init__")
            file = path.relative_to(path.parents[depth]).as_posix()
            if file.startswith(_LIGHT) or not file.startswith(_DECIDES_NOTHING):
                files[file] = hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""
    return files


def code_sha256(files: Iterable[str]) -> str:
    """Hash of what these files run, as this process first read them: comments and docstrings do not count."""
    told = "\n".join(f"{file} {_source(file)[1]}" for file in sorted(files))
    return hashlib.sha256(told.encode()).hexdigest()


def code_of_worker(files: Mapping[str, str]) -> str:
    """`code_sha256` of a worker's `loaded_files`; "" where a file has changed since this run first read it, so that the
    next run measures again."""
    return code_sha256(files) if all(_source(file)[0] == sha256 for file, sha256 in files.items()) else ""


def is_current(record: Record) -> bool:
    """Whether the files that measured a point still are what they were. Where nothing was measured there are none."""
    return not record.files or code_sha256(record.files) == record.environment.get("code_sha256")


@cache
def _source(file: str) -> tuple[str, str]:
    """Hashes of a file's bytes and of what it runs; of no file, where it has gone."""
    path = next((found for place in (str(_ROOT), *sys.path) if (found := Path(place, file)).is_file()), None)
    if path is None:
        return "", ""
    content = path.read_bytes()
    tree = ast.parse(content)
    for node in ast.walk(tree):
        if isinstance(body := getattr(node, "body", None), list):
            node.body = [statement for statement in body if not _is_text(statement)]  # type: ignore[attr-defined]
    return hashlib.sha256(content).hexdigest(), hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
