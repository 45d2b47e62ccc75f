"""Jobs of Hydra's submitit launchers, on Slurm or on this machine: each ends by itself, and an interrupt cancels all.

The launchers themselves wait for job after job, raise what the first that failed raises, and ask Slurm's accounting
alone, which a cluster may lack, whether a job still runs.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from hydra.core.singleton import Singleton
from hydra.core.utils import JobStatus

if TYPE_CHECKING:
    from experiments.launched import Ended

_LOOK_S = 1.0
"""Between two looks for results."""

_ASK_S = 5.0
"""Between two questions to the queue which jobs it still has."""

_GRACE_S = 15.0
"""So long after its end a job's result may take to be seen on a shared file system."""

_SILENT_S = 900.0
"""So long a queue may fail to answer before its jobs are given up."""


def first_line(error: object) -> str:
    """An error in a line."""
    return f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"


def run_submitted(launcher: Any, jobs: Sequence[Sequence[str]], ended: Ended) -> None:
    """Submit the jobs together, wait for each, and tell of its end (`experiments.launched.Launch`).

    Whatever else ends the wait, Slurm's jobs are cancelled; those on this machine are children of this process.
    """
    submitted: list[Any] = []
    try:
        with _interrupts_later():
            try:
                submitted += _submit(launcher, jobs)
            except Exception as error:  # the queue refused
                refused = first_line(error)
        if submitted:
            _wait(submitted, ended)
        else:
            for place in range(len(jobs)):
                ended(place, refused)
    except BaseException:
        _cancel(submitted)
        raise


def _submit(launcher: Any, jobs: Sequence[Sequence[str]]) -> list[Any]:
    """As the launcher does it, but without the wait."""
    import submitit
    from hydra_plugins.hydra_submitit_launcher.config import BaseQueueConf  # type: ignore[import-untyped]

    cluster = launcher._EXECUTOR
    given = dict(launcher.params)
    folder = given.pop("submitit_folder")
    first = {f"{cluster}_{name}": given.pop(name) for name in ("max_num_timeout",) if name in given}
    executor = submitit.AutoExecutor(folder, cluster=cluster, **first)
    common = BaseQueueConf.__dataclass_fields__
    executor.update_parameters(
        **{name if name in common else f"{cluster}_{name}": value for name, value in given.items()}
    )
    places, count = range(len(jobs)), len(jobs)
    names = [f"job_id_for_{place}" for place in places]
    state = Singleton.get_state()
    return executor.map_array(
        launcher, [list(job) for job in jobs], ["hydra.sweep.dir"] * count, places, names, [state] * count
    )


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold interrupts back: one between a job's submission and the queue's answer would leave a job unknown to us."""
    came: list[int] = []
    kinds = (signal.SIGINT, signal.SIGTERM)
    before = {kind: signal.signal(kind, lambda number, _: came.append(number)) for kind in kinds}
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)
    if came:
        raise KeyboardInterrupt


def _wait(jobs: Sequence[Any], ended: Ended) -> None:
    """Until every job has a result, or the queue has it no more, or does not answer."""
    left = dict(enumerate(jobs))
    queued: set[str] | None = None
    now_s = asked_s = answered_s = time.monotonic()
    gone_s: dict[int, float] = {}
    while left:
        for place, job in list(left.items()):
            if _has_result(job):
                del left[place]
                ended(place, _problem(job))
            elif queued is not None and job.job_id not in queued:
                if now_s - gone_s.setdefault(place, now_s) > _GRACE_S:
                    del left[place]
                    ended(place, f"job {job.job_id} ended without a result{_last_words(job)}")
            else:
                gone_s.pop(place, None)
        now_s = time.monotonic()
        if now_s - asked_s > _ASK_S:
            asked_s, queued = now_s, _queued(list(left.values()))
            answered_s = answered_s if queued is None else now_s
            if now_s - answered_s > _SILENT_S:
                for place in left:
                    ended(place, f"squeue has not answered for {_SILENT_S / 60:.0f} min")
                return
        time.sleep(_LOOK_S)


def _has_result(job: Any) -> bool:
    if not _is_slurm([job]) and not job.done():  # a job here would disturb the next one while it ends
        return False
    with suppress(OSError):  # makes a shared file system look again
        job.paths.folder.chmod(job.paths.folder.stat().st_mode)
    return bool(job.paths.result_pickle.exists())


def _problem(job: Any) -> str | None:
    """Why a job with a result failed, None = it did not."""
    from submitit.core.utils import pickle_load

    try:
        outcome, returned = pickle_load(job.paths.result_pickle)
    except Exception as error:  # whatever a damaged file makes pickle raise
        return f"the result of job {job.job_id} cannot be read ({first_line(error)})"
    if outcome == "error":  # a traceback
        return str(returned).strip().rpartition("\n")[2]
    return str(returned._return_value) if returned.status is JobStatus.FAILED else None


def _last_words(job: Any) -> str:
    with suppress(OSError, ValueError):
        said = (job.stderr() or "").strip()
        if said:
            return f": {said.rpartition(chr(10))[2]}"
    return ""


def _queued(jobs: Sequence[Any]) -> set[str] | None:
    """The identities of those jobs that wait or run; None: the queue does not answer."""
    if not _is_slurm(jobs):
        return {job.job_id for job in jobs if not job.done()}
    # Needs no accounting, and a job of which Slurm has forgotten is no error.
    command = ["squeue", "--noheader", "--array", "--me", "--format=%i"]
    plain = {name: value for name, value in os.environ.items() if not name.startswith("SQUEUE_")}
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True, env=plain)
    except (OSError, subprocess.SubprocessError):
        return None
    return set(told.stdout.split())


def _cancel(jobs: Sequence[Any]) -> None:
    if not _is_slurm(jobs):
        return
    arrays = sorted({job.job_id.partition("_")[0] for job in jobs})
    try:
        subprocess.run(["scancel", *arrays], capture_output=True, text=True, timeout=60, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        print(f"the jobs go on, cancel them with: scancel {' '.join(arrays)} ({error})", file=sys.stderr)


def _is_slurm(jobs: Sequence[Any]) -> bool:
    return any(type(job).__name__ == "SlurmJob" for job in jobs)
