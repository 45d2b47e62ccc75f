"""Jobs of Hydra's launcher for Slurm: each ends by itself, and an interrupt cancels all.

The launcher itself waits for job after job, raises what the first that failed raises, and asks Slurm's accounting
alone, which a cluster may lack, whether a job still runs.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from hydra.core.singleton import Singleton
from hydra.core.utils import JobStatus

if TYPE_CHECKING:
    from experiments.launched import Ended

_LOOK_S = 2.0
"""Between two looks for results and at the queue."""

_GRACE_S = 15.0
"""So long after its end a job's result may take to be seen on a shared file system."""


def first_line(error: object) -> str:
    """An error in a line."""
    return f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"


def run_submitted(launcher: Any, jobs: Sequence[Sequence[str]], ended: Ended) -> None:
    """Submit the jobs together, wait for each, and tell of its end (`experiments.launched.Launch`). Whatever else ends
    the wait, the jobs are cancelled. Raises what a queue that refuses the jobs makes submitit raise."""
    submitted = _submit(launcher, jobs)
    left, gone_s = dict(enumerate(submitted)), dict.fromkeys(range(len(submitted)), 0.0)
    try:
        while left:
            queued = _queued()
            for place, job in list(left.items()):
                has_result = _has_result(job)
                if queued is not None and job.job_id not in queued:
                    gone_s[place] += _LOOK_S
                if has_result or gone_s[place] > _GRACE_S:
                    del left[place]
                    ended(place, _problem(job, has_result))
            time.sleep(_LOOK_S if left else 0.0)
    except BaseException:
        _cancel(submitted)
        raise


def _submit(launcher: Any, jobs: Sequence[Sequence[str]]) -> list[Any]:
    """As the launcher does it, but without the wait."""
    import submitit
    from hydra_plugins.hydra_submitit_launcher.config import BaseQueueConf  # type: ignore[import-untyped]

    given = dict(launcher.params)
    executor = submitit.AutoExecutor(
        given.pop("submitit_folder"), cluster="slurm", slurm_max_num_timeout=given.pop("max_num_timeout")
    )
    common = BaseQueueConf.__dataclass_fields__
    executor.update_parameters(**{name if name in common else f"slurm_{name}": given[name] for name in given})
    places, count = range(len(jobs)), len(jobs)
    names = [f"job_id_for_{place}" for place in places]
    state = Singleton.get_state()
    return executor.map_array(
        launcher, [list(job) for job in jobs], ["hydra.sweep.dir"] * count, places, names, [state] * count
    )


def _has_result(job: Any) -> bool:
    with suppress(OSError):  # makes a shared file system look again
        job.paths.folder.chmod(job.paths.folder.stat().st_mode)
    return bool(job.paths.result_pickle.exists())


def _problem(job: Any, has_result: bool) -> str | None:
    """Why a job that is over failed, None = it did not."""
    if not has_result:
        with suppress(OSError, ValueError):
            said = (job.stderr() or "").strip()
            if said:
                return f"job {job.job_id} ended without a result: {said.rpartition(chr(10))[2]}"
        return f"job {job.job_id} ended without a result"
    from submitit.core.utils import pickle_load

    try:
        outcome, returned = pickle_load(job.paths.result_pickle)
    except Exception as error:  # whatever a damaged file makes pickle raise
        return f"the result of job {job.job_id} cannot be read ({first_line(error)})"
    if outcome == "error":  # a traceback
        return str(returned).strip().rpartition("\n")[2]
    return str(returned._return_value) if returned.status is JobStatus.FAILED else None


def _queued() -> set[str] | None:
    """The identities of our jobs that wait or run; None: the queue does not answer now."""
    # Needs no accounting, and a job of which Slurm has forgotten is no error.
    command = ["squeue", "--noheader", "--array", "--me", "--format=%i"]
    plain = {name: value for name, value in os.environ.items() if not name.startswith("SQUEUE_")}
    try:
        told = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True, env=plain)
    except (OSError, subprocess.SubprocessError):
        return None
    return set(told.stdout.split())


def _cancel(jobs: Sequence[Any]) -> None:
    arrays = sorted({job.job_id.partition("_")[0] for job in jobs})
    try:
        subprocess.run(["scancel", *arrays], capture_output=True, text=True, timeout=60, check=True)
    except (OSError, subprocess.SubprocessError) as error:
        print(f"the jobs go on, cancel them with: scancel {' '.join(arrays)} ({error})", file=sys.stderr)
