"""Which code a module runs: its own and all that it imports, read from the sources. A hash tells whether it changed.

An imported module counts whole, wherever the import stands. The `__init__` of a package, its face, often imports all
that lies below it, so only the names taken from it count: an imported name leads to the module that defines it; a name
defined there counts with its statement and what that uses. A face run only on the way to a module does not count.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from atra.errors import InputError

_BY_NAME = {repr("__getattr__"), repr("import_module")}
"""A module that uses one of these imports modules whose names are string constants in it."""


class Part(NamedTuple):
    """A module, or, with a name, the statements of a package's `__init__` that define this name."""

    module: str
    name: str | None = None


class Import(NamedTuple):
    """module: the one imported. taken: the name taken from it, None = the module itself. bound: what it is called."""

    module: str
    taken: str | None
    bound: str


@dataclass
class Statement:
    """A statement at the top of a module.

    said: the statement without comments, docstrings and the places of lines; text: the same in one. imports: all of it,
    also in functions.
    texts: string constants. entries: of dictionaries, those whose keys are texts -> the texts of their values. uses:
    names. defines: names that it gives a value to, apart from those it imports.
    """

    said: list[str] = field(default_factory=list)
    text: str = ""
    imports: list[Import] = field(default_factory=list)
    texts: set[str] = field(default_factory=set)
    entries: dict[str, set[str]] = field(default_factory=dict)
    uses: set[str] = field(default_factory=set)
    defines: set[str] = field(default_factory=set)


@dataclass(frozen=True)
class Source:
    """The source of a module. is_face: whether it is the `__init__` of a package."""

    module: str
    text: str
    is_face: bool = False

    @cached_property
    def statements(self) -> list[Statement]:
        """Those at its top; strings that stand alone, as docstrings do, are left out everywhere."""
        return [self._read(node) for node in ast.parse(self.text).body if not _is_text(node)]

    @cached_property
    def loads_by_name(self) -> bool:
        """Whether it imports modules whose names are texts."""
        return any(not _BY_NAME.isdisjoint(one.said) for one in self.statements)

    @cached_property
    def names(self) -> set[str]:
        """What its statements define or import."""
        return {name for one in self.statements for name in one.defines | {given.bound for given in one.imports}}

    def _read(self, node: ast.stmt) -> Statement:
        statement = Statement(defines=_defined(node))
        self._say(node, statement)
        statement.text = "\0".join(statement.said)
        return statement

    def _say(self, node: ast.AST, into: Statement) -> None:
        """Node by node: its type, and its fields in their order."""
        into.said.append(type(node).__name__)
        if isinstance(node, ast.Import):
            into.imports += [Import(one.name, None, one.asname or one.name.partition(".")[0]) for one in node.names]
        elif isinstance(node, ast.ImportFrom):
            module = self._absolute(node)
            into.imports += [Import(module, one.name, one.asname or one.name) for one in node.names]
        elif isinstance(node, ast.Name):
            into.uses.add(node.id)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            into.texts.add(node.value)
        elif isinstance(node, ast.Dict):
            for key, entry in zip(node.keys, node.values, strict=True):
                into.entries.update({text: _texts(entry) for text in (_texts(key) if key is not None else ())})
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                self._say(value, into)
            elif isinstance(value, list):
                into.said.append("[")
                for one in value:
                    if not isinstance(one, ast.AST):
                        into.said.append(repr(one))
                    elif not _is_text(one):
                        self._say(one, into)
                into.said.append("]")
            else:
                into.said.append(repr(value))

    def _absolute(self, node: ast.ImportFrom) -> str:
        """The module that a name is imported from, where that is given relative to this one, too."""
        around = self.module.split(".")
        base = around[: len(around) - node.level + self.is_face] if node.level else []
        return ".".join([*base, *filter(None, [node.module])])


class Code:
    """Sources that can be followed. read: a module's name -> its source; None where it has none or is not ours."""

    def __init__(self, read: Callable[[str], Source | None]) -> None:
        self._read = read
        self._sources: dict[str, Source | None] = {}
        self._edges: dict[Part, set[Part]] = {}

    def sha256(self, roots: Iterable[tuple[str, str | None]]) -> str:
        """Hash of all that the roots run. A root is a module with None, or a module and one of its names.

        Raises InputError for a root without a source.
        """
        digest = hashlib.sha256()
        for module, name in sorted(self.parts(roots), key=str):
            said = (one.text for one in self._statements(Part(module, name)))
            digest.update("\0".join([module, str(name), *said, ""]).encode())
        return digest.hexdigest()

    def parts(self, roots: Iterable[tuple[str, str | None]]) -> set[Part]:
        """The roots and all that they import, directly or not. Raises as `sha256`."""
        waiting: set[Part] = set()
        for module, name in roots:
            if self._source(module) is None:
                raise InputError(f"module {module!r} has no source, so nobody could tell when what it measures changes")
            waiting |= {Part(module)} if name is None else self._taken(module, name)
        found: set[Part] = set()
        while waiting:
            part = waiting.pop()
            if part not in found:
                found.add(part)
                waiting |= self._imported(part)
        return found

    def _source(self, module: str) -> Source | None:
        if module not in self._sources:
            self._sources[module] = self._read(module)
        return self._sources[module]

    def _statements(self, part: Part) -> list[Statement]:
        source = self._source(part.module)
        assert source is not None
        every = source.statements
        return every if part.name is None else [one for one in every if part.name in one.defines]

    def _imported(self, part: Part) -> set[Part]:
        """What a part imports, in one step."""
        if part not in self._edges:
            source = self._source(part.module)
            assert source is not None
            statements = self._statements(part)
            found = {found for one in statements for given in one.imports for found in self._followed(given)}
            if source.loads_by_name:
                texts = {text for one in statements for text in one.texts}
                found |= {
                    found for text in texts for name in self._named(text, part.module) for found in self._whole(name)
                }
            if part.name is not None:  # names that the statement has from elsewhere in the face
                used = {name for one in statements for name in one.uses} & source.names
                found |= {found for name in used for found in self._taken(part.module, name)}
            self._edges[part] = found
        return self._edges[part]

    def _followed(self, given: Import) -> set[Part]:
        return self._whole(given.module) if given.taken is None else self._taken(given.module, given.taken)

    def _whole(self, module: str) -> set[Part]:
        return set() if self._source(module) is None else {Part(module)}

    def _named(self, text: str, within: str) -> list[str]:
        """The modules that a text names: "package.module", "package.module:function", or ".module" of a package."""
        module = text.partition(":")[0]
        names = [f"{within}{module}"] if module.startswith(".") else [module]
        return [one for one in names if "." in one and all(map(str.isidentifier, one.split("."))) and self._source(one)]

    def _taken(self, module: str, name: str) -> set[Part]:
        """What `from module import name` leads to."""
        source = self._source(module)
        if source is None or not source.is_face:
            return self._whole(module)
        found = self._whole(f"{module}.{name}")
        is_known = bool(found)
        for statement in source.statements:
            is_known |= name in statement.defines or name in {given.bound for given in statement.imports}
            if name in statement.defines:
                found.add(Part(module, name))
            for given in statement.imports:
                itself = given.module == module and given.taken == name  # a module below, which is found already
                if given.bound == name and not itself:
                    found |= self._followed(given)
            if source.loads_by_name:
                for text in statement.entries.get(name, ()):
                    found |= {part for lazy in self._named(text, module) for part in self._taken(lazy, name)}
        # A name that is made in some other way, as by `__getattr__`: the face counts whole.
        return found if found or is_known else {Part(module)}


def _texts(node: ast.AST) -> set[str]:
    return {one.value for one in ast.walk(node) if isinstance(one, ast.Constant) and isinstance(one.value, str)}


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)


def _defined(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return {node.name}
    if isinstance(node, ast.Assign | ast.AnnAssign | ast.AugAssign):
        targets: list[ast.AST] = list(node.targets) if isinstance(node, ast.Assign) else [node.target]
    else:
        targets = [node]
    names = (one for target in targets for one in ast.walk(target) if isinstance(one, ast.Name))
    return {one.id for one in names if isinstance(one.ctx, ast.Store)}
