"""What measures one point in a process of its own, which gets a job as a line of JSON on standard input: the point, the
version of its method, the path where the record goes, whole or not at all, and the process of the run that asks.

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
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil

from atra.errors import AtraError, InputError, MemoryBudgetError, StorageError, printable
from atra.files.paths import write_atomically
from experiments.harness.identity import loaded_files
from experiments.harness.options import typed
from experiments.harness.point import Kinds, Measured, Point
from experiments.harness.records import LACKED_MEMORY, UNPROMISING, Record

ON_PURPOSE = "on_purpose"
"""Result of a record whose error is one of `atra`'s own, meant for the person at the keyboard; without it, a bug."""

METHOD_LINES = "method_lines"
"""Result of a record whose point failed in the code of another's method: where, in that code."""

_MOST_LINES = 3
"""As many lines are told from the start and from the end of where an error came from."""

_OURS = tuple(Path(__file__).resolve().parents[3] / package for package in ("atra", "experiments", "scenes"))

CANNOT_WRITE = 74
"""Exit code of a worker that has no room for its result, and perhaps none for words either; EX_IOERR of sysexits."""


class Unpromising(InputError):
    """A point that need not be measured, as a frame was predicted to be slow."""


MAY_CHANGE = {MemoryBudgetError: LACKED_MEMORY, Unpromising: UNPROMISING}
"""Problems without which another run may measure the point, and the results that tell of them."""


def failed(error: str, **results: Any) -> Record:
    """The record of a point that went wrong, as its worker leaves it."""
    return Record("", "failed", error, results=results)


def skipped(problem: AtraError) -> Record:
    """The record of a point that cannot be measured, with the reason."""
    told = {name: True for kind, name in MAY_CHANGE.items() if isinstance(problem, kind)}
    return Record("", "skipped", str(problem), results={ON_PURPOSE: True, **told})


def read_result(content: bytes, point: Point) -> Record:
    """The record of `point` that its worker has written. Raises ValueError, TypeError or AttributeError for what is
    none, and ValueError for status ok without all that the point's workload measures."""
    record, workload = Record.from_json(content), point.workload
    missing = [name for name in workload.needs if name not in record.results]
    if workload.samples is not None:
        missing += sorted(workload.samples(point) - set(record.samples))
    if workload.optional and workload.optional.isdisjoint(record.samples):
        missing.append(f"one of {', '.join(sorted(workload.optional))}")
    if record.status == "ok" and missing:
        raise ValueError(f"status ok without {', '.join(missing)}")
    return record


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


def record_of(point: Point) -> Record:
    """Whatever measuring comes to."""
    try:
        measured = measure_point(point)
    except MemoryBudgetError as error:
        return skipped(error)
    except AtraError as error:
        return failed(_with_notes(str(error), error), **{ON_PURPOSE: True}, **_own_lines(point, error))
    except Exception as error:
        with suppress(OSError):  # where there is no room for words, the record says the most of it
            traceback.print_exc()
        return failed(printable(_with_notes(f"{type(error).__name__}: {error}", error)), **_own_lines(point, error))
    return Record("", "ok", **vars(measured))


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
        record = replace(record_of(point), files=loaded_files(point))
    else:
        told = f"method {name} is {version}, expected {job['version']}: it changed since this run began"
        record = failed(printable(told), **{ON_PURPOSE: True})
    try:
        write_atomically(Path(job["result_path"]), record.to_json())
    except StorageError as error:
        with suppress(OSError):
            print(error, flush=True)
        raise SystemExit(CANNOT_WRITE) from None
