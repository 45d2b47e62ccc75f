"""Entries of camera files, and the checks that all formats share; every error names file and entry."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, Generic, TypeVar

from atra.errors import InputError
from atra.files.reading import Allowance, parse_json, read_regular_file
from atra.geometry.camera import CalibratedCamera, LensCamera
from atra.geometry.numbers import as_number
from atra.geometry.view import View

Cameras = dict[str, CalibratedCamera | LensCamera]
"""Cameras by name, in the order of the file."""

Broken = dict[str, InputError]
"""Errors of entries that cannot be used, by name; by place in the file if an entry has no name of its own."""

Kind = TypeVar("Kind", bound=View)

_BYTES_PER_ENTRY, _COUNTED = 3000, 1000
"""Memory that an entry takes, and the number of entries after which the bound is checked again."""


class Entries(Generic[Kind]):
    """The cameras of a file, added entry by entry.

    kind: what the file calls an entry. broken: receives the errors of unusable entries; None: the first one is raised.
    allowance: the memory that all entries together may take.
    """

    def __init__(self, path: Path, kind: str, broken: Broken | None, allowance: Allowance) -> None:
        self._path, self._kind, self._broken, self._allowance = path, kind, broken, allowance
        self._cameras: dict[str, Kind] = {}
        self._count = 0

    def add(self, name: Any, place: str, read: Callable[[], Kind]) -> None:
        """Add the camera that `read` returns, or keep or raise its InputError, which then names file and place.

        Raises InputError for a name that is there already, and for more entries than the allowance covers.
        """
        if self._count % _COUNTED == 0:
            with entry(str(self._path)):
                needed = (self._count + _COUNTED) * _BYTES_PER_ENTRY
                self._allowance.check(f"{self._count:,} {self._kind}s and more", needed)
        self._count += 1
        try:
            with entry(f"{self._path}, {place}"):
                camera = read()
                if name in self._cameras:
                    raise InputError(f"the name {name!r} is there twice, expected another for every camera")
                self._cameras[name] = camera
        except InputError as error:
            if self._broken is None:
                raise
            is_its_own = isinstance(name, str) and name not in self._cameras and name not in self._broken
            self._broken[name if is_its_own else place] = error

    def all(self) -> dict[str, Kind]:
        """The cameras by name. Raises InputError if there is none."""
        if self._cameras:
            return self._cameras
        if self._broken:
            first = next(iter(self._broken.values()))
            raise InputError(f"{self._path} has no {self._kind} that can be used, expected at least one; {first}")
        raise InputError(f"{self._path} has no {self._kind}, expected at least one")


@contextmanager
def entry(where: str) -> Iterator[None]:
    """Put `where`, a file and an entry of it, in front of the message of every InputError raised inside."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file. Raises InputError, naming the file, if there is none."""
    content = read_file(path)
    with entry(str(path)):
        found = parse_json(content)
    if not isinstance(found, dict):
        raise InputError(f"{path} holds a {type(found).__name__}, expected an object with frames")
    return found


def allowance_of(memory_per_byte: float | None, *paths: Path) -> Allowance:
    """The memory that reading these files together may take."""
    return Allowance(sum(path.stat().st_size for path in paths), memory_per_byte)


def read_file(path: Path) -> bytes:
    """The bytes of a file. Raises InputError, naming it, if it cannot be read or is no regular file."""
    try:
        return read_regular_file(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None


def number(name: str, value: Any) -> float:
    """`value` as a float. Raises InputError, naming it, unless it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(as_number(value)):
        raise InputError(f"{name} is {value!r:.100}, expected a finite number")
    return float(value)


def pixels(name: str, value: Any) -> int:
    """`value` as a number of pixels. Raises InputError, naming it, unless it is a whole number of at least 1."""
    given = number(name, value)
    if given != int(given) or given < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
    return int(given)
