"""One record = one measured point with its configuration, environment and every sample; kept as one JSON file."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from atra.errors import printable

FORMAT = 1
"""Version of the file's layout; a file of another version counts as unreadable."""

STATUSES = ("ok", "skipped", "failed")


@dataclass(frozen=True)
class Record:
    """A point's outcome.

    point_id: from `point_id`; also the file's name.
    status: ok = measured; skipped = cannot be measured under this configuration; failed = went wrong, worth a retry.
    error: why, when not ok.
    configuration, environment: plain values; see `experiments.points.Point` and `atra.measure.environment`.
    warmup_samples, samples: seconds by method name; sample r of every method belongs to one round.
    results: everything else that was measured, by name with its unit.

    Raises ValueError for an unknown status, a missing error, or samples of unequal counts.
    """

    point_id: str
    status: str
    error: str | None
    configuration: dict[str, Any]
    environment: dict[str, Any]
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.status not in STATUSES:
            raise ValueError(f"status is {self.status!r}, expected one of {', '.join(STATUSES)}")
        if (self.error is None) != (self.status == "ok"):
            raise ValueError(f"status {self.status} with error {self.error!r}: exactly the records not ok carry one")
        counts = {name: len(values) for name, values in self.samples.items()}
        if len(set(counts.values())) > 1:
            raise ValueError(f"samples per method are {counts}, expected one count for all: they form rounds")
        if any(not (math.isfinite(value) and value > 0) for values in self.samples.values() for value in values):
            raise ValueError("a sample is not a positive, finite number of seconds")

    @property
    def finished(self) -> bool:
        """Whether measuring the point again would tell nothing new."""
        return self.status in ("ok", "skipped")


def point_id(configuration: Mapping[str, Any], stable_environment: Mapping[str, Any]) -> str:
    """Identity of a point: 20 hex digits of the SHA-256 of its whole configuration and its machine.

    The order of keys does not matter. Raises ValueError for a NaN or infinity and TypeError for a value JSON lacks.
    """
    canonical = json.dumps(
        {"configuration": configuration, "environment": stable_environment},
        sort_keys=True,
        allow_nan=False,
        separators=(",", ":"),
    )
    return hashlib.sha256(canonical.encode()).hexdigest()[:20]


def record_path(folder: Path, identity: str) -> Path:
    return folder / f"{identity}.json"


def write_record(folder: Path, record: Record) -> Path:
    """Write `record` into `folder` (made if missing) so that a reader sees all of it or none; returns the path."""
    path = record_path(folder, record.point_id)
    text = json.dumps({"format": FORMAT, **asdict(record)}, indent=1, allow_nan=False) + "\n"
    write_atomically(path, text.encode())
    return path


def read_record(folder: Path, identity: str) -> Record | None:
    """The record of point `identity`, or None if there is none.

    A file that cannot be understood (half-written, edited, of another version) is renamed to `*.corrupt`, with a
    warning, and counts as none: nothing is lost and the point is measured again.
    """
    path = record_path(folder, identity)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except UnicodeDecodeError as error:
        _set_aside(path, error)
        return None
    try:
        fields = json.loads(text)
        if not isinstance(fields, dict) or fields.pop("format", None) != FORMAT:
            raise ValueError(f"not a record of format {FORMAT}")
        record = Record(**fields)
        if record.point_id != identity:
            raise ValueError(f"holds point {record.point_id}")
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        _set_aside(path, error)
        return None
    return record


def _set_aside(path: Path, reason: Exception) -> None:
    aside = path.with_name(path.name + ".corrupt")
    os.replace(path, aside)
    what = printable(str(reason))
    warnings.warn(f"record {path.name} is unreadable ({what}); kept as {aside.name}, measuring again", stacklevel=3)


_UNFINISHED = ".unfinished"


def remove_abandoned_files(folder: Path) -> None:
    """Remove what killed writers left in `folder`; nobody may be writing there."""
    for path in folder.glob(f".*{_UNFINISHED}"):
        path.unlink(missing_ok=True)


def write_atomically(path: Path, content: bytes) -> None:
    """Write `content` to a temporary name beside `path`, flush it to the disk, then rename it onto `path`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=_UNFINISHED)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        # mkstemp files are private; results are for everyone the folder lets in.
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
