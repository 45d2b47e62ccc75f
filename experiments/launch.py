"""Starts the worker process of a point and brings back its outcome, whatever becomes of it."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import psutil

from atra.errors import printable
from experiments.point import Point
from experiments.worker import Job, Outcome

_ROOT = Path(__file__).resolve().parents[1]
_OUTPUT_KEPT = 4000

WORKER_COMMAND = (sys.executable, "-m", "experiments.worker")


def run_worker(point: Point, command: Sequence[str] = WORKER_COMMAND) -> Outcome:
    """Measure `point` in a fresh process; never raises for what happens there.

    A worker that dies, exceeds `point.time_limit_s` or leaves no readable result gives a failed outcome with the
    reason; the end of all it printed is kept in `results["worker_output"]` then. KeyboardInterrupt stops the worker
    and passes on.
    """
    with tempfile.TemporaryDirectory(prefix="atra-") as folder:
        job = Job(point, str(Path(folder) / "outcome.json"))
        output_path = Path(folder) / "output.txt"
        with output_path.open("wb") as output:
            process = subprocess.Popen(
                list(command), stdin=subprocess.PIPE, stdout=output, stderr=subprocess.STDOUT,
                env=project_environment() | _thread_limits(point),
            )  # fmt: skip
            try:
                process.communicate(job.to_json().encode(), timeout=point.time_limit_s)
                reason = _death(process.returncode)
            except subprocess.TimeoutExpired:
                reason = f"stopped after the time limit of {point.time_limit_s:g} s (measure.time_limit_s)"
            finally:
                if process.poll() is None:
                    process.kill()
                    process.wait()
        printed = output_path.read_bytes()[-_OUTPUT_KEPT:].decode(errors="replace").strip()
        if reason is None:
            try:
                outcome = Outcome(**json.loads(Path(job.result_path).read_bytes()))
            except FileNotFoundError:
                reason = "the worker ended without a result"
            except (ValueError, TypeError) as error:
                reason = f"the worker's result is unreadable ({error})"
            else:
                if outcome.status == "failed" and not outcome.on_purpose:
                    outcome.results["worker_output"] = printed
                return outcome
        last_line = printable(printed.rpartition("\n")[2])
        return Outcome(
            "failed", f"{reason}; it said: {last_line}" if last_line else reason, results={"worker_output": printed}
        )


def _thread_limits(point: Point) -> dict[str, str]:
    """NumPy's matrix library would take every core whatever the point asks for."""
    if point.threads is None:
        return {}
    return {f"{name}_NUM_THREADS": str(point.threads) for name in ("OPENBLAS", "MKL", "OMP")}


def stop_children() -> None:
    """Kill the jobs a launcher has started, which would go on without the sweep; no record is ever half written."""
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            # joblib's tracker tidies up after the others and ends with this process; killed, it would complain.
            if "resource_tracker" not in " ".join(child.cmdline()):
                child.kill()


def _death(code: int) -> str | None:
    if code == 0:
        return None
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
    # Without the second, modules in the working folder, such as a numpy.py among downloaded models, would win over all.
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"}
