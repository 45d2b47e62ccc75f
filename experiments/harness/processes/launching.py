"""Starts the worker process of a point and brings back its record, whatever becomes of it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil

from atra.compiled.instruction_sets import VARIABLE
from atra.errors import printable
from experiments.harness.point import Point
from experiments.harness.processes.worker import CANNOT_WRITE, ON_PURPOSE, failed, read_result
from experiments.harness.records import Record

_ROOT = Path(__file__).resolve().parents[3]
_OUTPUT_KEPT_BYTES = 4000
_LONGEST_LINE = 500
"""Characters of a worker's last line that its row quotes."""

_MOST_PRINTED_BYTES = 1 << 26
"""A worker that prints more is stopped: its words stand in a file, and the disk has other uses."""

_WAIT_S = 0.5
"""So long an interrupt may have to wait on Windows, and a worker may print without being watched."""

WORKER_COMMAND = (sys.executable, "-m", "experiments.worker")


def run_worker(point: Point, command: Sequence[str] = WORKER_COMMAND) -> Record:
    """Measure `point` in a fresh process; never raises for what happens there.

    A worker that dies, exceeds `point.time_limit_s` or leaves no complete result gives a failed record with the
    reason; the end of all it printed is kept in `results["worker_output"]` then. When it ends, or KeyboardInterrupt
    passes through here, the worker and every process it has started are killed.
    """
    try:
        with tempfile.TemporaryDirectory(prefix="atra-", ignore_cleanup_errors=True) as folder:
            return _run_in(Path(folder), point, command)
    except OSError as error:
        return failed(f"no worker could be started: {error}", **{ON_PURPOSE: True})


def _run_in(folder: Path, point: Point, command: Sequence[str]) -> Record:
    result_path = folder / "record.json"
    job = {
        "point": point.configuration(),
        "version": point.method.version(),
        "result_path": str(result_path),
        "run": os.getpid(),
    }
    output_path = folder / "output.txt"
    with output_path.open("wb") as output:
        process = subprocess.Popen(
            list(command), stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT,
            env=_environment(point), **_apart_from_the_interrupt_key(),
        )  # fmt: skip
        try:
            assert process.stdin is not None
            with contextlib.suppress(OSError):  # it may have died without listening; its exit code tells
                process.stdin.write(json.dumps(job).encode() + b"\n")
                process.stdin.flush()
            code = _wait(process, point.time_limit_s, output_path)
            reason = _death(code, folder) if code is not None else None
        except subprocess.TimeoutExpired:
            reason = f"stopped after the time limit of {point.time_limit_s:g} s (measure.time_limit_s)"
        finally:
            _end(process)
    printed, printed_bytes = _end_of(output_path), output_path.stat().st_size
    if printed_bytes > _MOST_PRINTED_BYTES:
        reason = f"it printed {printed_bytes >> 20} MiB, more than the {_MOST_PRINTED_BYTES >> 20} MiB that are kept"
    if reason is None:
        try:
            record = read_result(result_path.read_bytes(), point)
        except FileNotFoundError:
            reason = "the worker ended without a result"
        except (ValueError, TypeError, AttributeError) as error:
            reason = f"the worker's result is not complete ({error})"
        else:
            if record.status == "failed" and printed:
                record.results["worker_output"] = printed
            return record
    last_line = printable(printed.rpartition("\n")[2][:_LONGEST_LINE])
    return failed(f"{reason}; it said: {last_line}" if last_line else reason, worker_output=printed)


def _apart_from_the_interrupt_key() -> dict[str, Any]:
    """Options for `subprocess`: a group of its own. The interrupt is for the run alone, which then ends the worker."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"process_group": 0}


def _wait(process: subprocess.Popen[bytes], limit_s: float, output: Path) -> int | None:
    """The exit code, None for a worker that has printed too much; raises TimeoutExpired. Windows lets no interrupt
    through while it waits, hence in short waits."""
    end_s = time.monotonic() + limit_s
    while True:
        left_s = max(0.0, end_s - time.monotonic())
        try:
            return process.wait(min(left_s, _WAIT_S))
        except subprocess.TimeoutExpired:
            if left_s <= _WAIT_S:
                raise
            if output.stat().st_size > _MOST_PRINTED_BYTES:
                return None


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill the worker, if it still runs, and what it has started and left behind, which would spoil later times.

    Windows has no groups to find the latter by: what a worker left behind that ended by itself lives on there.
    """
    if hasattr(os, "killpg"):
        # Processes that outlive the worker are still in its group. macOS forbids signals to one that is a zombie.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)  # type: ignore[attr-defined]  # it is where killpg is
    elif process.poll() is None:
        _kill_children(process.pid)
        process.kill()
    process.wait()
    with contextlib.suppress(OSError):  # what it never read is still in the buffer
        assert process.stdin is not None
        process.stdin.close()


def _end_of(output: Path) -> str:
    with output.open("rb") as printed:
        printed.seek(max(0, output.stat().st_size - _OUTPUT_KEPT_BYTES))
        return printed.read().decode(errors="replace").strip()


def _environment(point: Point) -> dict[str, str]:
    """The environment of the worker, which reads its instruction set once, when `atra` is imported. NumPy's matrix
    library would take every core whatever the point asks for."""
    libraries = () if point.threads is None else ("OPENBLAS", "MKL", "OMP")
    vectors = {} if point.instruction_set is None else {VARIABLE: point.instruction_set}
    return project_environment() | vectors | {f"{name}_NUM_THREADS": str(point.threads) for name in libraries}


def stop_children() -> None:
    """Kill the jobs a launcher has started, which would go on without the sweep; no record is ever half written."""
    _kill_children(os.getpid())


def _kill_children(parent: int) -> None:
    """Kill all that the process `parent` has started; one that has just ended, or is not ours to look at, is left."""
    with contextlib.suppress(psutil.Error):
        for child in psutil.Process(parent).children(recursive=True):
            with contextlib.suppress(psutil.Error):
                # joblib's tracker tidies up after the others and ends with this process; killed, it would complain.
                if "resource_tracker" not in " ".join(child.cmdline()):
                    child.kill()


def _death(code: int, folder: Path) -> str | None:
    if code == 0:
        return None
    if code == CANNOT_WRITE:
        return f"the worker could not write its result to {folder.parent} (no room?); TMPDIR names another folder"
    if code > 0:
        return f"the worker ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = " (out of memory?)" if name == "SIGKILL" else ""
    return f"the worker was killed by {name}{hint}"


def project_environment() -> dict[str, str]:
    """The environment of a process that is to import this project wherever it is started from."""
    # The user may have started run.py from elsewhere; relative paths stay theirs, imports are ours.
    paths = [str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(paths),
        # Modules in the working folder, such as a numpy.py among downloaded models, would win over all.
        "PYTHONSAFEPATH": "1",
        # What it prints is read back as UTF-8, and a file's name that no code page of Windows has must not end it.
        "PYTHONIOENCODING": "utf-8:backslashreplace",
    }
