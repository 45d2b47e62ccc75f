"""Which code a module runs: the files of this project that it imports, directly or not. A hash tells whether they
changed; comments and docstrings do not count.

A module counts whole, wherever its import stands. Only a name that is taken from the `__init__` of a package, which
has it from elsewhere, leads on to where it is defined.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from atra.errors import InputError


class Import(NamedTuple):
    """module: the one imported. taken: the name taken from it, None = the module itself. bound: what it is called."""

    module: str
    taken: str | None
    bound: str


@dataclass(frozen=True)
class Source:
    """The source of a module. is_package: whether it is the `__init__` of a package."""

    module: str
    text: str
    is_package: bool = False

    @cached_property
    def tree(self) -> ast.Module:
        """Its syntax without docstrings, and without what only type checkers import."""
        tree = ast.parse(self.text)
        for node in ast.walk(tree):
            if isinstance(body := getattr(node, "body", None), list):
                kept = [statement for statement in body if not (_is_text(statement) or _is_for_types(statement))]
                node.body = kept  # type: ignore[attr-defined]
        return tree

    @cached_property
    def imports(self) -> list[Import]:
        """All of it, also in functions."""
        return [given for node in ast.walk(self.tree) for given in self._imports(node)]

    @cached_property
    def sha256(self) -> str:
        """Hash of what runs, however it is written."""
        return hashlib.sha256(ast.dump(self.tree).encode()).hexdigest()

    def _imports(self, node: ast.AST) -> Iterator[Import]:
        if isinstance(node, ast.Import):
            yield from (Import(alias.name, None, alias.asname or alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            around = self.module.split(".")
            base = around[: len(around) - node.level + self.is_package] if node.level else []
            module = ".".join([*base, *filter(None, [node.module])])
            yield from (Import(module, alias.name, alias.asname or alias.name) for alias in node.names)


class Code:
    """Sources that can be followed. read: a module's name -> its source; None where it has none or does not count."""

    def __init__(self, read: Callable[[str], Source | None]) -> None:
        self._read = read
        self._sources: dict[str, Source | None] = {}

    def sha256(self, roots: Iterable[str]) -> str:
        """Hash of all modules that the roots run. Raises as `modules`."""
        digest = hashlib.sha256()
        for module in sorted(self.modules(roots)):
            source = self._source(module)
            assert source is not None
            digest.update(f"{module} {source.sha256}\n".encode())
        return digest.hexdigest()

    def modules(self, roots: Iterable[str]) -> set[str]:
        """The roots and all that they import, directly or not. Raises InputError for a root without a source."""
        waiting = list(roots)
        for module in waiting:
            if self._source(module) is None:
                raise InputError(f"module {module!r} has no source, so nobody could tell when what it measures changes")
        reached: set[str] = set()
        while waiting:
            module = waiting.pop()
            source = self._source(module)
            if source is not None and module not in reached:
                reached.add(module)
                waiting += [name for given in source.imports for name in self.homes(given)]
        return reached

    def homes(self, given: Import) -> set[str]:
        """The modules that an import leads to."""
        source, below = self._source(given.module), f"{given.module}.{given.taken}"
        if given.taken is not None and self._source(below) is not None:
            return {below}
        if given.taken is not None and source is not None and source.is_package:
            elsewhere = [
                reexport
                for reexport in source.imports
                if reexport.bound == given.taken and reexport.module != given.module
            ]
            if elsewhere:
                return {name for reexport in elsewhere for name in self.homes(reexport)}
        return {given.module}

    def _source(self, module: str) -> Source | None:
        if module not in self._sources:
            self._sources[module] = self._read(module)
        return self._sources[module]


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
