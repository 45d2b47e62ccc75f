"""Modules beside a method's file that it imports: found there by every process of a run, and part of its version."""

from __future__ import annotations

import ast
import importlib
import sys
from collections.abc import Collection, Iterator, Sequence
from importlib.machinery import EXTENSION_SUFFIXES, SOURCE_SUFFIXES, ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

from atra.errors import InputError

_OF_ATRA = ("atra", "experiments", "scenes")
"""Packages that are no helpers, even where a method's file stands beside them."""

Helpers = dict[str, ModuleSpec]
"""Modules and packages at the top of a file's folder, by name."""


class _Finder:
    """Finds helpers of the files in use. Python asks it last, so a `numpy.py` beside a file hides nothing installed.

    helpers: by file. imported: names of those that were imported through it.
    """

    def __init__(self) -> None:
        self.helpers: dict[Path, Helpers] = {}
        self.imported: set[str] = set()

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Where a module is, None where it is no helper."""
        for file, helpers in self.helpers.items():
            if name in helpers:
                self.imported.add(name)
                return _spec_in(file.parent, name)
        return None

    def forget(self, file: Path) -> None:
        """Let the next import of the file's helpers run them again: they may have changed."""
        for name in self.imported & self.helpers.pop(file, {}).keys():
            self.imported.remove(name)
            for module in [known for known in sys.modules if known == name or known.startswith(f"{name}.")]:
                del sys.modules[module]


_FINDER = _Finder()


def use_helpers(file: Path, in_use: Collection[Path]) -> list[Path]:
    """Let a method's file import the modules beside it, and return their files. in_use: method files of this run.

    A helper is what an `import` anywhere in the file names, and what helpers import in turn; a package is one with all
    its modules. What none of these names is not found, so nothing is imported that does not count.
    Raises InputError where another file has another helper of that name: Python keeps one module a name.
    """
    importlib.invalidate_caches()
    for gone in [known for known in _FINDER.helpers if known == file or known not in in_use]:
        _FINDER.forget(gone)
    helpers = _helpers_of(file)
    for other, of_other in _FINDER.helpers.items():
        for name in sorted(helpers.keys() & of_other.keys()):
            if _places(helpers[name]) != _places(of_other[name]):
                raise InputError(
                    f"method_file {file} and {other} each import a module {name} of their own folder, and Python keeps "
                    "one of a name; call one of them something else, or measure the methods in two runs"
                )
    _FINDER.helpers[file] = helpers
    if _FINDER not in sys.meta_path:
        sys.meta_path.append(_FINDER)
    return sorted({path for spec in helpers.values() for path in _files_of(spec)} - {file})


def _helpers_of(file: Path) -> Helpers:
    helpers: Helpers = {}
    waiting = [file]
    while waiting:
        for name in _imported(waiting.pop()).difference(helpers, _OF_ATRA):
            spec = _spec_in(file.parent, name)
            if spec is not None and not _is_found_before(name, spec):
                helpers[name] = spec
                waiting += [path for path in _files_of(spec) if path.suffix in SOURCE_SUFFIXES]
    return helpers


def _imported(file: Path) -> set[str]:
    """The first parts of names of modules that a source imports, anywhere; none of a source that Python cannot read,
    which its import tells."""
    try:
        nodes = [*ast.walk(ast.parse(file.read_bytes()))]
    except (OSError, SyntaxError, ValueError):
        return set()
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [str(node.module) for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    return {name.partition(".")[0] for name in names}


def _spec_in(folder: Path, name: str) -> ModuleSpec | None:
    return PathFinder.find_spec(name, [str(folder)])


def _is_found_before(name: str, beside: ModuleSpec) -> bool:
    """Whether Python finds another module of this name before it comes to the one beside the file."""
    loaded = None if name in _FINDER.imported else getattr(sys.modules.get(name), "__spec__", None)
    specs = (finder.find_spec(name, None) for finder in sys.meta_path if finder is not _FINDER)
    spec = loaded or next((place for place in specs if place is not None), None)
    return spec is not None and _places(spec) != _places(beside)


def _places(spec: ModuleSpec) -> list[str | None]:
    return [spec.origin, *(spec.submodule_search_locations or ())]


def _files_of(spec: ModuleSpec) -> Iterator[Path]:
    """The file of a module, or every module of a package."""
    folders = spec.submodule_search_locations
    if folders is None:
        yield from filter(Path.is_file, [Path(str(spec.origin))])
    else:
        endings = (*SOURCE_SUFFIXES, *EXTENSION_SUFFIXES)
        for folder in folders:
            yield from (path for path in Path(folder).rglob("*") if path.name.endswith(endings) and path.is_file())
