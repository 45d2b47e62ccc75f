"""Entries of camera files: named in every error, each name once, and without lens distortion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, Generic, TypeVar

from atra.errors import InputError
from atra.files.reading import Allowance, parse_json, read_regular_file
from atra.geometry.camera import CalibratedCamera
from atra.geometry.numbers import as_number
from atra.geometry.view import View

Cameras = dict[str, CalibratedCamera]
"""By name, in the order of the file."""

Broken = dict[str, InputError]
"""Why an entry of a file cannot be used, by its name; by its place where it has none, or one that is there already."""

Kind = TypeVar("Kind", bound=View)


_BYTES_PER_ENTRY, _COUNTED = 3000, 1000
"""Memory for an entry, used or broken; entries are counted in steps of so many."""


class Entries(Generic[Kind]):
    """The cameras of a file, taken entry by entry.

    kind: what the file calls an entry. broken: takes those that cannot be used; None: the first of them is refused.
    allowance: of the file, which all entries together keep.
    """

    def __init__(self, path: Path, kind: str, broken: Broken | None, allowance: Allowance) -> None:
        self._path, self._kind, self._broken, self._allowance = path, kind, broken, allowance
        self._cameras: dict[str, Kind] = {}
        self._count = 0

    def add(self, name: Any, place: str, read: Callable[[], Kind]) -> None:
        """Raises what `read` refuses, naming file and place, and InputError for a name that is there already, and for
        more entries than the file may have by its size."""
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
        """The cameras by name. Raises InputError for a file without one that can be used."""
        if self._cameras:
            return self._cameras
        if self._broken:
            first = next(iter(self._broken.values()))
            raise InputError(f"{self._path} has no {self._kind} that can be used, expected at least one; {first}")
        raise InputError(f"{self._path} has no {self._kind}, expected at least one")


@contextmanager
def entry(where: str) -> Iterator[None]:
    """What is refused inside is refused as part of `where`: the file, and the entry in it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def distorted(what: str, colmap: bool = False) -> InputError:
    """The refusal of a lens that bends rays. what: the model or number that says so."""
    undistort = "`colmap image_undistorter`" if colmap else "`cv2.undistort(image, K, distortion)`"
    return InputError(
        f"{what}, but rays are straight here: images must be undistorted first, by {undistort}, and their new "
        "cameras read"
    )


def read_json(path: Path) -> dict[str, Any]:
    """The object in a file. Raises InputError, naming the file, where there is none."""
    try:
        found = parse_json(read_file(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if not isinstance(found, dict):
        raise InputError(f"{path} holds a {type(found).__name__}, expected an object with frames")
    return found


def allowance_of(memory_per_byte: float | None, *paths: Path) -> Allowance:
    """What reading these files may take."""
    return Allowance(sum(path.stat().st_size for path in paths), memory_per_byte)


def read_file(path: Path) -> bytes:
    """What a file holds. Raises InputError, naming it, where it cannot be read or is no regular file."""
    try:
        return read_regular_file(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from None


def number(name: str, value: Any) -> float:
    """A finite number. Raises InputError, naming it, for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not isfinite(as_number(value)):
        raise InputError(f"{name} is {value!r:.100}, expected a finite number")
    return float(value)


def pixels(name: str, value: Any) -> int:
    """A whole number of at least 1. Raises InputError, naming it, for anything else."""
    given = number(name, value)
    if given != int(given) or given < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
    return int(given)
