"""What packages offer, installed ones and the wings of this project: their entry points, and their versions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

METHODS_GROUP = "atra.methods"
"""`mine = "my_package.tracing:MyTracer"`: a class with build, trace and close, or a `Method` of that name."""

WORKLOADS_GROUP = "atra.workloads"
"""`mine = "my_package.measuring:MY_WORKLOAD"`: a `Workload` of that name."""

VERBS_GROUP = "atra.verbs"
"""`mine = "my_package.making:run_mine"`: a function that takes the words behind `python run.py mine`."""

FORECASTS_GROUP = "atra.forecasts"
"""`slow_points`: what predicts which points of a scene are slow (`sweep.skip_slower`)."""

_NO_CODE = {"__pycache__", ".git"}

_OURS = "experiments."
"""Code of this project, which a record's identity tells apart from other code; it has no version of its own."""


def name_of_file(path: str) -> str:
    """What the method of a file is called."""
    return Path(path).stem.replace("-", "_")


@dataclass(frozen=True)
class Offer:
    """An entry point. value: what it names, None if it cannot be loaded. problem: why, in one line. version: package,
    version, and hash of the files."""

    name: str
    value: Any
    problem: str | None
    version: str


@cache
def offered(group: str) -> dict[str, EntryPoint]:
    """The entry points of a group by name, in the order of names; none is loaded."""
    return {entry.name: entry for entry in sorted(entry_points(group=group), key=lambda entry: entry.name)}


def offers(group: str, names: Iterable[str] | None = None) -> Iterator[Offer]:
    """The entry points of a group, by default all, loaded. Whatever loading one raises becomes its `problem`."""
    known = offered(group)
    for entry in known.values() if names is None else [known[name] for name in names if name in known]:
        value, problem = None, None
        try:
            value = entry.load()
        except Exception as error:  # a foreign package may raise anything
            told = f"{type(error).__name__}: {' '.join(str(error).split())}"
            problem = f"entry point {entry.name} of {group} cannot be loaded from {entry.value}, {told}"
        yield Offer(entry.name, value, problem, "" if entry.module.startswith(_OURS) else _version(entry))


def _version(entry: EntryPoint) -> str:
    """The package of an entry point, its version, and a hash of its files."""
    package = "unknown package" if entry.dist is None else f"{entry.dist.name} {entry.dist.version}"
    return f"{package} sha256:{digest_of_module(entry.module)}"


def digest_of_module(module: str) -> str:
    """Hash of all files of the package that holds a module, or of the file of a module without a package."""
    try:
        spec = find_spec(module.partition(".")[0])
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return "unknown"
    folders = [Path(place) for place in spec.submodule_search_locations or ()]
    found = (path for folder in folders for path in folder.rglob("*") if _NO_CODE.isdisjoint(path.parts))
    files = [path for path in found if path.is_file()]
    if not folders and spec.origin is not None and Path(spec.origin).is_file():
        files = [Path(spec.origin)]
    return digest_of_files(sorted(files))


def digest_of_files(files: list[Path]) -> str:
    """20 hex digits of the SHA-256 of names and contents."""
    digest = sha256()
    for path in files:
        digest.update(f"{path.name}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:20]
