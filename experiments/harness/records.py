"""One record = one measured point with its configuration, environment and every sample; kept as one JSON file."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from atra.errors import InputError, RecordError, StorageError
from atra.files.paths import UNFINISHED, write_atomically

FORMAT = 2
"""Version of the file's layout. A file of another version is not used."""

LACKED_MEMORY = "lacked_memory"
"""The result of a point that was skipped because it needed more memory than it was given."""

UNPROMISING = "unpromising"
"""The result of a point that was skipped because it was predicted to be slow."""

LIMITS = ("time_limit_s", "memory_budget_gib")
"""Fields of a configuration that say when to give a point up; what a point that is not given up comes to is the same
with all of them."""


@dataclass(frozen=True)
class Record:
    """What became of a point. Its worker leaves `point_id`, `configuration` and `environment` to the run that asked.

    point_id: from `point_id`; also the file's name.
    status: ok = measured; skipped = cannot be measured under this configuration, or for want of memory, or predicted to
    be slow; failed = went wrong, worth a retry.
    error: why, when not ok.
    configuration, environment: plain values; see `experiments.harness.point.Point` and
    `experiments.harness.environment`. warmup_samples, samples: seconds by method name; sample r of every method belongs
    to one round. results: everything else that was measured, by name with its unit. files: whose code measured it; a
    worker tells the hash of each (`experiments.harness.identity`).
    """

    point_id: str
    status: str
    error: str | None = None
    configuration: dict[str, Any] = field(default_factory=dict)
    environment: dict[str, Any] = field(default_factory=dict)
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)
    files: list[str] | dict[str, str] = field(default_factory=list)

    @property
    def finished(self) -> bool:
        """Whether measuring the point again would tell nothing new. More memory may be free the next time, and slow
        points may be wanted."""
        may_change = self.results.get(LACKED_MEMORY) or self.results.get(UNPROMISING)
        return self.status == "ok" or (self.status == "skipped" and not may_change)

    def to_json(self) -> bytes:
        """Raises ValueError for a NaN or an infinity."""
        return json.dumps({"format": FORMAT, **asdict(self)}, indent=1, allow_nan=False).encode() + b"\n"

    @classmethod
    def from_json(cls, content: bytes) -> Record:
        """Raises ValueError, TypeError or AttributeError for what is no record, or of another version."""
        fields = json.loads(content)
        version = fields.pop("format", None)
        if version != FORMAT:
            raise ValueError(f"it is of format {version}, expected {FORMAT}")
        fields.pop("sha256", None)  # earlier versions of atra wrote a digest
        return cls(**fields)


def without_limits(configuration: Mapping[str, Any]) -> dict[str, Any]:
    """What of a configuration tells one point from another: all but `LIMITS`."""
    return {name: value for name, value in configuration.items() if name not in LIMITS}


def point_id(configuration: Mapping[str, Any], stable_environment: Mapping[str, Any]) -> str:
    """Identity of a point: 20 hex digits of the SHA-256 of its configuration, `without_limits`, and its machine.

    The order of keys does not matter. Raises ValueError for a NaN or infinity and TypeError for a value JSON lacks.
    """
    fields = {"configuration": without_limits(configuration), "environment": stable_environment}
    canonical = json.dumps(fields, sort_keys=True, allow_nan=False, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:20]


def record_path(folder: Path, identity: str) -> Path:
    return folder / f"{identity}.json"


def write_record(folder: Path, record: Record) -> Path:
    """Write `record` into `folder` (made if missing) so that a reader sees all of it or none; returns the path.

    Raises StorageError.
    """
    path = record_path(folder, record.point_id)
    write_atomically(path, record.to_json())
    return path


def load_record(folder: Path, identity: str) -> Record | None:
    """The record of point `identity`, or None if there is none.

    Raises RecordError, naming the file and what to do, for one that is damaged or of another version.
    """
    path = record_path(folder, identity)
    try:
        return Record.from_json(path.read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise RecordError(
            f"record {path} cannot be read ({error}); start its sweep again, which measures the point again"
        ) from None


def read_record(folder: Path, identity: str, warn: Callable[[str], object] = warnings.warn) -> Record | None:
    """The record of point `identity`, or None if there is none that can be used, so that the point is to be measured.

    A file that `load_record` refuses is renamed to `*.corrupt`, and `warn` is told: it may be all that is left of a
    measurement.
    """
    try:
        return load_record(folder, identity)
    except RecordError as error:
        path = record_path(folder, identity)
        aside = path.with_name(path.name + ".corrupt")
        os.replace(path, aside)
        warn(f"{str(error).partition('; start its sweep')[0]}; kept as {aside.name}, measuring the point again")
        return None


def check_writable(folder: Path) -> None:
    """Make `folder` if it is missing; raises InputError if nothing can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(
            f"results cannot be written to {folder}: {error.strerror}; choose another results_dir"
        ) from None


@contextmanager
def exclusive(results: Path, *folders: Path) -> Iterator[None]:
    """Hold the results folder for this run; the system lets go of it when the process ends, however it ends.

    What a killed run left half-written there and in `folders` is removed. Raises InputError if another run holds it,
    and StorageError if it cannot be locked.
    """
    from filelock import FileLock, Timeout  # here, as workers lock nothing

    lock = FileLock(results / ".lock")
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise InputError(
            f"{results} is in use by another run; wait for it to end or choose another results_dir"
        ) from None
    except OSError as error:  # a file system that knows no locks
        raise StorageError(f"{results} cannot be locked: {error}; choose another results_dir") from None
    try:
        for folder in (results, *folders):
            _remove_abandoned_files(folder)
        yield
    finally:
        lock.release()


def _remove_abandoned_files(folder: Path) -> None:
    """Remove unfinished files that killed writers left in `folder`, in which nobody may be writing."""
    for path in folder.glob(f".*{UNFINISHED}"):
        with suppress(OSError):  # on Windows another program may have it open
            path.unlink()
