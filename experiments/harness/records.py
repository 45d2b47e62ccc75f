"""One record = one measured point with its configuration, environment and every sample; kept as one JSON file."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from atra.errors import RecordError, StorageError, printable
from atra.files import write_atomically

FORMAT = 2
"""Version of the file's layout; 2 added the digest. A file of another version is not used."""

STATUSES = ("ok", "skipped", "failed")


@dataclass(frozen=True)
class Record:
    """A point's outcome.

    point_id: from `point_id`; also the file's name.
    status: ok = measured; skipped = cannot be measured under this configuration; failed = went wrong, worth a retry.
    error: why, when not ok.
    configuration, environment: plain values; see `experiments.harness.point.Point` and
    `experiments.harness.environment`. warmup_samples, samples: seconds by method name; sample r of every method belongs
    to one round. results: everything else that was measured, by name with its unit.

    Raises ValueError for an unknown status, a missing error, a field of another type, and samples as `check_samples`
    does.
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
        for name in ("configuration", "environment", "results"):
            if not isinstance(getattr(self, name), dict):
                raise ValueError(f"{name} is {getattr(self, name)!r:.40}, expected values by name")
        check_status(self.status, self.error)
        check_samples(self.warmup_samples)
        check_samples(self.samples)

    @property
    def finished(self) -> bool:
        """Whether measuring the point again would tell nothing new."""
        return self.status in ("ok", "skipped")


def check_status(status: object, error: object) -> None:
    """Raise ValueError for an unknown status, and unless exactly what is not ok carries an error."""
    if status not in STATUSES:
        raise ValueError(f"status is {status!r:.40}, expected one of {', '.join(STATUSES)}")
    if not isinstance(error, str | None) or (error is None) != (status == "ok"):
        raise ValueError(f"status {status} with error {error!r:.40}: exactly the records not ok carry one, a text")


def check_samples(samples: object) -> None:
    """Raise ValueError unless `samples` are seconds by method name, positive and finite, equally many of each."""
    if not isinstance(samples, dict) or not all(isinstance(values, list | tuple) for values in samples.values()):
        raise ValueError(f"samples are {samples!r:.40}, expected lists of seconds by method name")
    for name, values in samples.items():
        for value in values:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0 < value <= sys.float_info.max:
                raise ValueError(f"a sample of {name} is {value!r:.40}, expected a positive, finite number of seconds")
    counts = {name: len(values) for name, values in samples.items()}
    if len(set(counts.values())) > 1:
        raise ValueError(f"samples per method are {counts}, expected one count for all: they form rounds")


def point_id(configuration: Mapping[str, Any], stable_environment: Mapping[str, Any]) -> str:
    """Identity of a point: 20 hex digits of the SHA-256 of its whole configuration and its machine.

    The order of keys does not matter. Raises ValueError for a NaN or infinity and TypeError for a value JSON lacks.
    """
    return _sha256({"configuration": configuration, "environment": stable_environment})[:20]


def _sha256(value: Mapping[str, Any]) -> str:
    """Of the value itself: neither the order of keys nor how a file lays them out matters."""
    canonical = json.dumps(value, sort_keys=True, allow_nan=False, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()


def record_path(folder: Path, identity: str) -> Path:
    return folder / f"{identity}.json"


def write_record(folder: Path, record: Record) -> Path:
    """Write `record` into `folder` (made if missing) so that a reader sees all of it or none; returns the path.

    A digest of its content goes with it: `load_record` knows by it what was changed since. Raises StorageError.
    """
    path = record_path(folder, record.point_id)
    fields = asdict(record)
    text = json.dumps({"format": FORMAT, "sha256": _sha256(fields), **fields}, indent=1, allow_nan=False) + "\n"
    write_atomically(path, text.encode())
    return path


def load_record(folder: Path, identity: str) -> Record | None:
    """The record of point `identity`, or None if there is none.

    Raises RecordError, naming the file and what to do, for one that cannot be used: half-written, changed after it was
    written, of another version or another point.
    """
    path = record_path(folder, identity)
    try:
        return _parse(path.read_bytes(), identity)
    except FileNotFoundError:
        return None
    except OSError as error:
        reason = f"cannot be read: {error.strerror or error}"
    except (ValueError, TypeError, RecursionError) as error:
        reason = printable(str(error))
    raise RecordError(f"record {path} {reason}; start its sweep again, which measures the point anew")


def _parse(content: bytes, identity: str) -> Record:
    """Raises ValueError, TypeError or RecursionError for content that is no record of this point."""
    try:
        fields = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"is damaged ({error})") from None
    version = fields.pop("format", None) if isinstance(fields, dict) else None
    if version != FORMAT:
        raise ValueError(f"is of format {version!r:.40}, this version of atra reads format {FORMAT}")
    if fields.pop("sha256", None) != _sha256(fields):
        raise ValueError("was changed after it was written: its content does not match its sha256")
    try:
        record = Record(**fields)
    except (ValueError, TypeError) as error:
        raise ValueError(f"makes no sense ({error})") from None
    if record.point_id != identity:
        raise ValueError(f"holds point {record.point_id}")
    return record


def read_record(folder: Path, identity: str) -> Record | None:
    """The record of point `identity`, or None if there is none that can be used, so that the point is to be measured.

    A file that `load_record` refuses is renamed to `*.corrupt`, with a warning: its numbers are nobody's measurement,
    but it may be all that is left of one.
    """
    try:
        return load_record(folder, identity)
    except RecordError as error:
        path = record_path(folder, identity)
        aside = path.with_name(path.name + ".corrupt")
        try:
            os.replace(path, aside)
        except OSError as obstacle:
            raise StorageError(f"{error}. It cannot be set aside: {obstacle.strerror}; remove it") from None
        reason = str(error).partition("; start its sweep")[0]
        warnings.warn(f"{reason}; kept as {aside.name}, measuring the point again", stacklevel=2)
        return None
