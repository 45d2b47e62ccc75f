"""Reading files of other people: the bound on what reading one may cost, their bytes, and JSON."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from itertools import chain
from math import inf, isnan
from pathlib import Path
from typing import Any

import psutil

from atra.errors import InputError
from atra.geometry.numbers import as_number

MEMORY_PER_BYTE = 100.0
"""Default bound on the memory that reading a file may take: bytes of memory for each byte of the file.

Meshes as programs write them need less than 30, skies about 20, and one that is half of one colour 40.
"""

LEAST_BYTES = 128 * 2**20
"""Memory that reading may take however small the file is."""

VARIABLE = "ATRA_MEMORY_PER_BYTE"
"""Environment variable that replaces MEMORY_PER_BYTE, for commands that have no option for it."""

_DEEPEST = 100
"""Most levels of nested lists and objects in JSON; a reader that calls itself for each could exhaust its stack."""


@dataclass(frozen=True)
class Allowance:
    """The memory that reading one file may take, by its size; time follows, since what takes time is counted, too.

    file_bytes: of the file and those it names. memory_per_byte: bytes of memory for each of them, above 0, infinite for
    no bound but the memory that is free; None: what the environment variable ATRA_MEMORY_PER_BYTE says, or 100.
    LEAST_BYTES are allowed in any case. Raises InputError for a number that is not above 0.
    """

    file_bytes: int
    memory_per_byte: float | None = None

    def __post_init__(self) -> None:
        name, given = "memory_per_byte", self.memory_per_byte
        if given is None:
            name, given = VARIABLE, os.environ.get(VARIABLE, MEMORY_PER_BYTE)  # type: ignore[assignment]
        number = as_number(given)
        if isnan(number) or number <= 0.0:
            raise InputError(f"{name} is {given!r}, expected a number above 0 (inf: no bound but the free memory)")
        object.__setattr__(self, "memory_per_byte", number)

    def check(self, what: str, needed_bytes: int) -> None:
        """Raise InputError unless reading may take so much memory. what: the content that claims it, with its size."""
        assert self.memory_per_byte is not None
        allowed = max(self.memory_per_byte * self.file_bytes, LEAST_BYTES)
        if needed_bytes > allowed:
            raise InputError(
                f"it claims {what}, which take about {_size(needed_bytes)} to read; its {self.file_bytes:,} bytes are "
                f"allowed {_size(allowed)} (memory_per_byte is {self.memory_per_byte:g}, and {_size(LEAST_BYTES)} are "
                f"allowed in any case). If you trust the file, raise memory_per_byte, or set {VARIABLE}"
            )
        free = psutil.virtual_memory().available
        if needed_bytes > free:
            raise InputError(
                f"it claims {what}, which take about {_size(needed_bytes)} to read, but the machine has only "
                f"{_size(free)} free"
            )


def read_regular_file(path: Path) -> bytes:
    """What a file holds. Raises InputError for a pipe or a device, which may block for ever or never end, and for a
    file larger than the free memory."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path.name} is no regular file")
    size = path.stat().st_size
    Allowance(size, inf).check(f"{size:,} bytes", size)
    return path.read_bytes()


def parse_json(content: bytes | str) -> Any:
    """What JSON says. Raises InputError for text that is none, or nested deeper than 100 levels."""
    try:
        found = json.loads(content)
    except RecursionError:
        raise InputError(f"it is JSON nested too deeply, expected at most {_DEEPEST} levels") from None
    except ValueError as error:
        raise InputError(f"it is no JSON: {error}") from None
    level: list[Any] = [[found]]
    for _ in range(_DEEPEST + 1):
        inside = chain.from_iterable(one.values() if type(one) is dict else one for one in level)
        level = [child for child in inside if type(child) in (dict, list)]
        if not level:
            return found
    raise InputError(f"it is JSON nested too deeply, expected at most {_DEEPEST} levels")


def _size(count: float) -> str:
    for unit in ("bytes", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.3g} {unit}"
        count /= 1024
    return f"{count:,.1f} GiB"
