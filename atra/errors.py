"""The errors `atra` raises on purpose.

Each message carries the offending value, what was expected and, where it is not obvious, what to do. Everything
else that escapes the library is a bug.
"""


class AtraError(Exception):
    """Base of every error raised on purpose; its text is meant for the person at the keyboard."""


class InputError(AtraError, ValueError):
    """A value handed in cannot be used: a split that does not divide the image, a NaN vertex, a missing file."""


class EmbreeError(AtraError, RuntimeError):
    """The Embree library is missing, of an unusable version, or reported a failure."""


class MemoryBudgetError(AtraError, MemoryError):
    """The work would need more memory than its budget; raised before anything is allocated."""


class StorageError(AtraError, OSError):
    """A file could not be written: disk full, read-only folder, a limit of the system. Nothing half-written stays."""


class RecordError(AtraError, ValueError):
    """A record's file is there but cannot be used: damaged, changed after it was written, of another version."""


class ClockError(AtraError, RuntimeError):
    """The clock did not move forward while something was timed, so there is no time to keep."""
