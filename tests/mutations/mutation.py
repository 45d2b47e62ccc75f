"""A mutation: a small fault put into the code, and the tests that must notice it."""

from __future__ import annotations

import re
from dataclasses import dataclass


class ListError(Exception):
    """The list of mutations does not fit the code or the tests; says which entry, and what to do."""


@dataclass(frozen=True)
class Mutation:
    """One fault.

    name: unique, in small letters with underscores. file: path from the root of the project. old: text that occurs in
    the file exactly once, as short as that allows, since code around it changes. new: what replaces it.
    breaks: what is wrong then, in one line. caught_by: the tests that must fail, each as "tests/test_x.py::test_name",
    of which all cases run, or with the parameters of one case behind it, in brackets.
    Raises ListError for a field that cannot be used.
    """

    name: str
    file: str
    old: str
    new: str
    breaks: str
    caught_by: tuple[str, ...]

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[a-z0-9_]+", self.name):
            raise ListError(f"a mutation is called {self.name!r}, expected small letters, digits and underscores")
        if not self.old or self.old == self.new:
            raise ListError(f"mutation {self.name}: it replaces {self.old!r} by {self.new!r}, expected another text")
        if not self.caught_by or not all("::" in test for test in self.caught_by):
            raise ListError(
                f"mutation {self.name}: caught_by is {self.caught_by!r}, expected tests such as "
                "tests/geometry/test_mesh.py::test_name"
            )

    def applied(self, source: str) -> str:
        """The text of `file` with the fault. Raises ListError unless `old` occurs in it exactly once."""
        count = source.count(self.old)
        if count != 1:
            raise ListError(
                f"mutation {self.name}: {self.file} holds {self.old!r} {count} times, expected once; "
                "bring its entry under tests/mutations/ up to date"
            )
        return source.replace(self.old, self.new)
