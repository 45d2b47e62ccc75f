"""Reading files that need not be trusted: a bound on the cost, bytes, and JSON."""

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
"""Default bound on the memory that reading may take, in bytes for each byte of the file; usual files need 20 to 40."""

LEAST_BYTES = 128 * 2**20
"""Memory that reading may always take, however small the file."""

VARIABLE = "ATRA_MEMORY_PER_BYTE"
"""Environment variable that replaces MEMORY_PER_BYTE for commands without an option."""

_DEEPEST = 100
"""Upper limit of nested lists and objects in JSON: a recursive reader could exhaust its stack."""


@dataclass(frozen=True)
class Allowance:
    """The memory, and so the time, that reading a file may take.

    file_bytes: size of the file and of those it names. memory_per_byte: bytes of memory for each of them, above 0, as
    for `atra.load_mesh`. LEAST_BYTES are always allowed. Raises InputError for a number that is not above 0.
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
        """Raise InputError if `needed_bytes` are not allowed or not free. what: the content that needs them."""
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
    """The bytes of a file. Raises InputError for a pipe or device, and for a file larger than the free memory."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path.name} is no regular file")
    size = path.stat().st_size
    Allowance(size, inf).check(f"{size:,} bytes", size)
    return path.read_bytes()


def parse_json(content: bytes | str) -> Any:
    """The value of a JSON text. Raises InputError for text that is no JSON, or nested deeper than 100 levels."""
    too_deep = InputError(f"it is JSON nested too deeply, expected at most {_DEEPEST} levels")
    try:
        found = json.loads(content)
    except RecursionError:
        raise too_deep from None
    except ValueError as error:
        raise InputError(f"it is no JSON: {error}") from None
    level: list[Any] = [[found]]
    for _ in range(_DEEPEST + 1):
        inside = chain.from_iterable(one.values() if type(one) is dict else one for one in level)
        level = [child for child in inside if type(child) in (dict, list)]
        if not level:
            return found
    raise too_deep


def _size(count: float) -> str:
    for unit in ("bytes", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.0f} {unit}" if unit == "bytes" else f"{count:.3g} {unit}"
        count /= 1024
    return f"{count:,.1f} GiB"
