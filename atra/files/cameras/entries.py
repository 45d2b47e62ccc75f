"""Entries of camera files, and the checks that all formats share; every error names file and entry."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import isfinite
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

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


def read_entries(
    files: tuple[Path, ...],
    kind: str,
    entries: Iterable[tuple[Any, str, Callable[[], Kind]]],
    broken: Broken | None,
    memory_per_byte: float | None,
) -> dict[str, Kind]:
    """The cameras of a file's entries, by name.

    files: what is read; the last one has the entries. kind: what it calls an entry. entries: name, place in the file
    and reader of each. broken: receives the errors of unusable entries; None: the first one is raised, naming file and
    place. Raises InputError, too, where there is no camera, a name is there twice, and for more entries than
    memory_per_byte allows.
    """
    path, cameras = files[-1], dict[str, Kind]()
    allowance = Allowance(sum(one.stat().st_size for one in files), memory_per_byte)
    for count, (name, place, read) in enumerate(entries):
        if count % _COUNTED == 0:
            with entry(str(path)):
                allowance.check(f"{count:,} {kind}s and more", (count + _COUNTED) * _BYTES_PER_ENTRY)
        try:
            with entry(f"{path}, {place}"):
                camera = read()
                if name in cameras:
                    raise InputError(f"the name {name!r} is there twice, expected another for every camera")
                cameras[name] = camera
        except InputError as error:
            if broken is None:
                raise
            is_its_own = isinstance(name, str) and name not in cameras and name not in broken
            broken[name if is_its_own else place] = error
    if not cameras:
        first = next(iter((broken or {}).values()), None)
        usable = "" if first is None else " that can be used"
        raise InputError(f"{path} has no {kind}{usable}, expected at least one{'' if first is None else f'; {first}'}")
    return cameras


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


def numbers(name: str, value: Any, count: int | None = None) -> NDArray[np.float64]:
    """The numbers of a list, of a list of rows, or of OpenCV's matrix with its data.

    Raises InputError, naming it, for another count than the one expected, and for what is no number.
    """
    data = value.get("data") if isinstance(value, dict) else value
    rows = data if isinstance(data, list) else [data]
    flat = [one for row in rows for one in (row if isinstance(row, list) else [row])]
    if count is not None and len(flat) != count:
        raise InputError(f"{name} is {value!r:.100}, expected {count} numbers")
    return np.array([number(f"a number of {name}", one) for one in flat], np.float64)


def pixels(name: str, value: Any) -> int:
    """`value` as a number of pixels. Raises InputError, naming it, unless it is a whole number of at least 1."""
    given = number(name, value)
    if given != int(given) or given < 1:
        raise InputError(f"{name} is {value!r}, expected a whole number of pixels of at least 1")
    return int(given)
