"""What installed packages offer: their entry points of one group, loaded, and the version they are of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

_NO_CODE = {"__pycache__", ".git"}


@dataclass(frozen=True)
class Offer:
    """An entry point. value: what it names, None if it cannot be loaded. problem: why, in one line. version: package,
    version, and hash of the files."""

    name: str
    value: Any
    problem: str | None
    version: str


def offers(group: str) -> Iterator[Offer]:
    """The entry points of a group, by name. Whatever loading one raises becomes its `problem`."""
    for one in sorted(entry_points(group=group), key=lambda one: one.name):
        value, problem = None, None
        try:
            value = one.load()
        except Exception as error:  # a foreign package may raise anything
            told = f"{type(error).__name__}: {' '.join(str(error).split())}"
            problem = f"entry point {one.name} of {group} cannot be loaded from {one.value}, {told}"
        yield Offer(one.name, value, problem, _version(one))


def _version(one: EntryPoint) -> str:
    package = "unknown package" if one.dist is None else f"{one.dist.name} {one.dist.version}"
    return f"{package} sha256:{digest_of_module(one.module)}"


def digest_of_module(module: str) -> str:
    """Hash of all files of the package that holds a module, or of the file of a module without a package."""
    try:
        spec = find_spec(module.partition(".")[0])
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return "unknown"
    folders = [Path(place) for place in spec.submodule_search_locations or ()]
    files = [path for folder in folders for path in folder.rglob("*") if path.is_file() and not _is_cache(path)]
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


def _is_cache(path: Path) -> bool:
    return not _NO_CODE.isdisjoint(path.parts)
