"""What became of a worker's job, and the checks its result passes before a number of it is believed."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from experiments.harness.point import Point
from experiments.harness.records import check_samples, check_status
from experiments.harness.rounds import MINIMUM_ROUNDS
from experiments.workloads import find_workload
from experiments.workloads.images import PIXELS

_COUNTS = (*PIXELS, "triangles_traced", "packet_width", "threads", "rounds")
_LARGEST_WHOLE = 2**63 - 1


@dataclass(frozen=True)
class Outcome:
    """What became of a job.

    status, error, samples, results: as in `experiments.harness.records.Record`.
    on_purpose: the error is one of `atra`'s own, meant for the person at the keyboard; otherwise it is a bug.
    """

    status: str
    error: str | None = None
    on_purpose: bool = False
    warmup_samples: dict[str, list[float]] = field(default_factory=dict)
    samples: dict[str, list[float]] = field(default_factory=dict)
    results: dict[str, Any] = field(default_factory=dict)

    def to_json(self, point: Point) -> bytes:
        """With the point it belongs to. Raises ValueError for a NaN or an infinity."""
        return json.dumps({"point": point.configuration(), **asdict(self)}, allow_nan=False).encode()

    @classmethod
    def from_json(cls, content: bytes, point: Point) -> Outcome:
        """The outcome of `point` from what its worker has written.

        Raises ValueError for anything that cannot be that: no JSON, other fields, a result of another point, a time
        that is not positive and finite, samples or counts that do not add up, status ok without results. RecursionError
        for what is nested too deeply.
        """
        told = json.loads(content, parse_constant=_refuse)
        expected = {"point", *(one.name for one in fields(cls))}
        if not isinstance(told, dict) or set(told) != expected:
            raise ValueError(f"expected a JSON object with {', '.join(sorted(expected))}")
        if told.pop("point") != point.configuration():
            raise ValueError("it is the result of another point")
        if isinstance(
            told["error"], str
        ):  # it may quote a path that is no text, which a table could not be written with
            told["error"] = told["error"].encode(errors="replace").decode()
        outcome = cls(**told)
        if not isinstance(outcome.on_purpose, bool):
            raise ValueError(f"on_purpose is {outcome.on_purpose!r:.40}, expected true or false")
        check_status(outcome.status, outcome.error)
        check_samples(outcome.warmup_samples)
        check_samples(outcome.samples)
        _check_results(outcome.results)
        if outcome.status == "ok":
            _check_measured(outcome, point)
        return outcome


def _refuse(constant: str) -> None:
    raise ValueError(f"it holds {constant}, which is no number")


def _check_results(results: object) -> None:
    """What a name says of its value: seconds are numbers, bytes and pixels are counts, and neither is negative."""
    if not isinstance(results, dict):
        raise ValueError(f"results are {results!r:.40}, expected values by name")
    for name, value in results.items():
        if name.endswith("_samples_s"):
            check_samples({name: value})
        elif name.endswith("_s"):
            _check_number(name, value)
        elif name.endswith("_bytes") or name in _COUNTS:
            _check_number(name, value, whole=True)


def _check_number(name: str, value: object, *, whole: bool = False) -> None:
    kinds, largest = (int, _LARGEST_WHOLE) if whole else (int | float, sys.float_info.max)
    if isinstance(value, bool) or not isinstance(value, kinds) or not 0 <= value <= largest:
        what = "a whole number" if whole else "a finite number"
        raise ValueError(f"{name} is {value!r:.40}, expected {what} that is not negative")


def _check_measured(outcome: Outcome, point: Point) -> None:
    """That status ok comes with all that was to be measured."""
    workload = find_workload(point.workload)
    results, samples = outcome.results, outcome.samples
    missing = [name for name in workload.needs if name not in results]
    if missing or not results:
        raise ValueError(f"status ok without {', '.join(missing) or 'results'}")
    if workload.images is not None:
        pixels, counted = workload.images(point) * point.width * point.height, sum(results[name] for name in PIXELS)
        if counted != pixels:
            raise ValueError(f"equal, tied, edge and wrong pixels are {counted} together, of {pixels} that were traced")
    if workload.samples is None:
        return
    held = set(samples) & workload.optional or set(sorted(workload.optional)[:1])
    expected = workload.samples(point) | held
    if set(samples) != expected or set(outcome.warmup_samples) != set(samples):
        raise ValueError(f"samples of {sorted(samples)}, expected {sorted(expected)}, and as many warm-ups")
    for values in samples.values():
        if not min(point.rounds, MINIMUM_ROUNDS) <= len(values) <= point.rounds or len(values) != results.get("rounds"):
            raise ValueError(f"{len(values)} rounds of samples, {results.get('rounds')} by its account")
    for values in outcome.warmup_samples.values():
        if len(values) != point.warmup:
            raise ValueError(f"{len(values)} warm-up rounds, expected {point.warmup}")
