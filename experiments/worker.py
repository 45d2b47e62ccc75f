"""Measures one point in a process of its own: `python -m experiments.worker`, a JSON job on standard input.

Of whatever it prints nothing is read as a result: the result goes to the path named in the job.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from atra.errors import AtraError, MemoryBudgetError
from atra.records import write_atomically
from experiments.point import Point
from experiments.quantities import measure_point


@dataclass(frozen=True)
class Job:
    """point: what to measure. result_path: where the outcome goes, whole or not at all."""

    point: Point
    result_path: str

    def to_json(self) -> str:
        return json.dumps({"point": self.point.configuration(), "result_path": self.result_path})

    @classmethod
    def from_json(cls, text: str) -> Job:
        fields = json.loads(text)
        return cls(Point.from_fields(fields["point"]), fields["result_path"])


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    status, error, samples, results: as in `atra.records.Record`.
    on_purpose: the error is one of `atra`'s own, meant for the person at the keyboard; otherwise it is a bug.
    """

    status: str
    error: str | None = None
    on_purpose: bool = False
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)


@contextmanager
def _reporting(result_path: Path) -> Iterator[list[Outcome]]:
    """Whatever happens inside becomes an outcome in `result_path`."""
    outcomes: list[Outcome] = []
    try:
        yield outcomes
    except MemoryBudgetError as error:
        outcomes.append(Outcome("skipped", str(error), on_purpose=True))
    except AtraError as error:
        outcomes.append(Outcome("failed", str(error), on_purpose=True))
    except Exception as error:
        traceback.print_exc()
        outcomes.append(Outcome("failed", f"{type(error).__name__}: {error}"))
    write_atomically(result_path, json.dumps(asdict(outcomes[-1]), allow_nan=False).encode())


def main() -> None:
    job = Job.from_json(sys.stdin.read())
    with _reporting(Path(job.result_path)) as outcomes:
        measured = measure_point(job.point)
        outcomes.append(Outcome("ok", None, True, measured.warmup_samples, measured.samples, measured.results))


if __name__ == "__main__":
    main()
