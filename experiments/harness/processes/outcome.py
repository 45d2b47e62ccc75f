"""The outcome of a worker's job, as the worker hands it back."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from typing import Any

from atra.errors import AtraError, InputError, MemoryBudgetError
from experiments.harness.point import Point
from experiments.harness.records import LACKED_MEMORY, UNPROMISING


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    status, error, samples, results: as in `experiments.harness.records.Record`.
    on_purpose: the error is one of `atra`'s own, meant for the person at the keyboard; otherwise it is a bug.
    files: the files whose code measured it, with their hashes (`experiments.harness.identity.loaded_files`).
    """

    status: str
    error: str | None = None
    on_purpose: bool = False
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)

    def to_json(self) -> bytes:
        """Raises ValueError for a NaN or an infinity."""
        return json.dumps(asdict(self), allow_nan=False).encode()

    @classmethod
    def from_json(cls, content: bytes, point: Point) -> Outcome:
        """The outcome of `point` from what its worker has written.

        Raises ValueError or TypeError for what is no outcome, and ValueError for status ok without all that the point's
        workload measures.
        """
        outcome = cls(**json.loads(content))
        missing = _missing(outcome, point) if outcome.status == "ok" else []
        if missing:
            raise ValueError(f"status ok without {', '.join(missing)}")
        return outcome


class Unpromising(InputError):
    """A point that need not be measured, as a frame was predicted to be slow."""


MAY_CHANGE = {MemoryBudgetError: LACKED_MEMORY, Unpromising: UNPROMISING}
"""Problems without which another run may measure the point, and the results that tell of them."""


def skipped(problem: AtraError) -> Outcome:
    """The outcome of a point that cannot be measured, with the reason."""
    results = {name: True for kind, name in MAY_CHANGE.items() if isinstance(problem, kind)}
    return Outcome("skipped", str(problem), on_purpose=True, results=results)


def _missing(outcome: Outcome, point: Point) -> list[str]:
    """Results and series that a measured point must hold and this one does not."""
    workload = point.workload
    missing = [name for name in workload.needs if name not in outcome.results]
    if workload.samples is not None:
        missing += sorted(workload.samples(point) - set(outcome.samples))
    if workload.optional and workload.optional.isdisjoint(outcome.samples):
        missing.append(f"one of {', '.join(sorted(workload.optional))}")
    return missing
