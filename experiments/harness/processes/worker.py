"""What measures one point in a process of its own, which gets a job as a line of JSON on standard input: the point, the
version of its method, the path where the outcome goes, whole or not at all, and the process of the run that asks.

Of whatever it prints nothing is read as a result: the result goes to the path named in the job. It ends when the run
that started it does.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import traceback
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import psutil

from atra.errors import AtraError, InputError, MemoryBudgetError, StorageError, printable
from atra.files.paths import write_atomically
from experiments.harness.identity import loaded_files
from experiments.harness.options import typed
from experiments.harness.point import Kinds, Measured, Point
from experiments.harness.records import LACKED_MEMORY, UNPROMISING

METHOD_LINES = "method_lines"
"""Result of a record whose point failed in the code of another's method: where, in that code."""

_MOST_LINES = 3
"""As many lines are told from the start and from the end of where an error came from."""

_OURS = tuple(Path(__file__).resolve().parents[3] / package for package in ("atra", "experiments", "scenes"))

CANNOT_WRITE = 74
"""Exit code of a worker that has no room for its result, and perhaps none for words either; EX_IOERR of sysexits."""


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


def read_point(fields: dict[str, Any], kinds: Kinds) -> Point:
    """The reverse of `Point.configuration`. Raises InputError for a method or a workload that is not found."""
    values: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()
    }
    method = kinds["method"].find(values.pop("method"))
    workload = kinds["workload"].find(values.pop("workload"))
    options = typed(method.options, values.pop("method_options"), "method.")
    of_workload = typed(workload.options, values.pop("workload_options"), "workload.")
    return Point(**values, method=method, options=options, workload=workload, workload_options=of_workload)


def measure_point(point: Point) -> Measured:
    """Measure the point in this process. Raises InputError and MemoryBudgetError as the tracers do."""
    return point.workload.measure(point)


def outcome_of(point: Point) -> Outcome:
    """Whatever measuring comes to."""
    try:
        measured = measure_point(point)
    except MemoryBudgetError as error:
        return skipped(error)
    except AtraError as error:
        return Outcome("failed", _with_notes(str(error), error), on_purpose=True, results=_own_lines(point, error))
    except Exception as error:
        with suppress(OSError):  # where there is no room for words, the outcome says the most of it
            traceback.print_exc()
        told = printable(_with_notes(f"{type(error).__name__}: {error}", error))
        return Outcome("failed", told, results=_own_lines(point, error))
    return Outcome("ok", None, True, measured.warmup_samples, measured.samples, measured.results)


def _with_notes(told: str, error: Exception) -> str:
    return "; ".join([told, *getattr(error, "__notes__", ())])


def _own_lines(point: Point, error: Exception) -> dict[str, Any]:
    """The lines of another's method that an error passed through, the outermost first, as results of its record."""
    frames = () if point.method.is_ours else traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not any(Path(frame.filename).is_relative_to(folder) for folder in _OURS)]
    told = [*own[:_MOST_LINES], *own[_MOST_LINES:][-_MOST_LINES:]]
    lines = [f"{frame.filename}:{frame.lineno} in {frame.name}: {frame.line}" for frame in told]
    return {METHOD_LINES: lines} if lines else {}


def _end_with_the_run(run: int) -> None:
    """Wait until the run that started this process is gone, and end: a killed run leaves no worker behind that would
    spoil the times of the next one.

    The system then closes the other end of standard input. On Windows a thread that reads it keeps libraries from being
    loaded, numpy/numpy#24290, so there the process itself is waited for.
    """
    if sys.platform == "win32":
        with suppress(psutil.NoSuchProcess):
            psutil.Process(run).wait()
    else:
        while os.read(0, 4096):  # not sys.stdin, whose lock a waiting thread would hold when the interpreter ends
            pass
    os._exit(1)


def run_job(kinds: Kinds) -> None:
    """Measure the point of the job on standard input, unless its method has changed since the run began. kinds: what
    finds its method and workload."""
    job = json.loads(sys.stdin.readline())
    point = read_point(job["point"], kinds)
    threading.Thread(target=_end_with_the_run, args=(job["run"],), daemon=True).start()
    name, version = point.method.name, point.method.version()
    if version == job["version"]:
        outcome = replace(outcome_of(point), files=loaded_files(point))
    else:
        told = f"method {name} is {version}, expected {job['version']}: it changed since this run began"
        outcome = Outcome("failed", printable(told), on_purpose=True)
    try:
        write_atomically(Path(job["result_path"]), outcome.to_json())
    except StorageError as error:
        with suppress(OSError):
            print(error, flush=True)
        raise SystemExit(CANNOT_WRITE) from None
