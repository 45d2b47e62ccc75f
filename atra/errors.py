"""The errors `atra` raises on purpose.

Each message carries the offending value, what was expected and, where it is not obvious, what to do. Everything
else that escapes the library is a bug.
"""

from __future__ import annotations

_LONGEST_MESSAGE = 2000


class AtraError(Exception):
    """Base of every error raised on purpose; its text is meant for the person at the keyboard.

    It may quote a file or its name, so it is made `printable` and, beyond 2,000 characters, cut in the middle: whoever
    shows it need not think of that again.
    """

    def __init__(self, message: str) -> None:
        shown = printable(message)
        if len(shown) > _LONGEST_MESSAGE:
            shown = f"{shown[: _LONGEST_MESSAGE // 2]} … {shown[-_LONGEST_MESSAGE // 2 + 3 :]}"
        super().__init__(shown)


class InputError(AtraError, ValueError):
    """A value handed in cannot be used: a split that does not divide the image, a NaN vertex, a missing file."""


class EmbreeError(AtraError, RuntimeError):
    """The Embree library is missing, of an unusable version, or reported a failure."""


class ClosedError(AtraError, RuntimeError):
    """A tracer, scene, renderer or baker was used after `close`."""


class MemoryBudgetError(AtraError, MemoryError):
    """The work would need more memory than its budget; raised before anything is allocated."""


class StorageError(AtraError, OSError):
    """A file could not be written: disk full, read-only folder, a limit of the system. Nothing half-written stays."""


class RecordError(AtraError, ValueError):
    """A record's file is there but cannot be used: damaged, or of another version."""


class ClockError(AtraError, RuntimeError):
    """The clock did not move forward while something was timed, so there is no time to keep."""


def printable(text: str) -> str:
    """`text` with every character that has no picture of its own as a Python escape.

    Control characters move a terminal's cursor, change its colours and title; marks of direction reverse what is read.
    Line breaks are escaped, too: what comes back is one line.
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)
