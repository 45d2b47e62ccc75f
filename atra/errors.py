"""The errors that `atra` raises on purpose; any other exception is a bug.

A message states the offending value, what was expected and, if that is not obvious, what to do.
"""

from __future__ import annotations

_LONGEST_MESSAGE = 2000


class AtraError(Exception):
    """Base of all errors raised on purpose; the message is for the user.

    Since it may quote files, it is made `printable`, and beyond 2,000 characters its middle is left out.
    """

    def __init__(self, message: str) -> None:
        shown = printable(message)
        if len(shown) > _LONGEST_MESSAGE:
            shown = f"{shown[: _LONGEST_MESSAGE // 2]} … {shown[-_LONGEST_MESSAGE // 2 + 3 :]}"
        super().__init__(shown)


class InputError(AtraError, ValueError):
    """An input cannot be used: a split that does not divide the image, a NaN vertex, a missing file."""


class EmbreeError(AtraError, RuntimeError):
    """The Embree library is missing, has an unsupported version, or reported a failure."""


class ClosedError(AtraError, RuntimeError):
    """A tracer, scene, renderer or baker was used after `close`."""


class MemoryBudgetError(AtraError, MemoryError):
    """A computation would need more memory than its budget; raised before anything is allocated."""


class StorageError(AtraError, OSError):
    """A file could not be written (disk full, read-only folder, a limit of the system); no partial file remains."""


class RecordError(AtraError, ValueError):
    """A record's file is damaged or of another version."""


class ClockError(AtraError, RuntimeError):
    """The clock did not advance during a measurement."""


def printable(text: str) -> str:
    """`text` as one line, with every character that is not printable as a Python escape.

    Control characters could move a terminal's cursor or change its colours; direction marks could reverse the text.
    """
    if text.isprintable():
        return text
    return "".join(sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii") for sign in text)
