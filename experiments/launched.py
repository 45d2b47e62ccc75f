"""Points of a sweep measured elsewhere: what a job does, what hands jobs to Hydra's launchers, what finds records."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from hydra.core.singleton import Singleton
from hydra.core.utils import JobStatus

from atra.errors import AtraError, RecordError
from experiments.harness.configuration import Configuration, records_folder
from experiments.harness.environment import stable_fields
from experiments.harness.identity import identity, is_current
from experiments.harness.points import PlannedPoint, measure, plan_points
from experiments.harness.processes.launching import project_environment, run_worker, stop_children
from experiments.harness.records import Record, check_writable, load_record, write_record
from experiments.results.processes import key_of
from scenes.loading import replace_missing_scenes

Launch = Callable[[Sequence[Sequence[str]]], Iterator[tuple[int, str | None]]]
"""Has jobs run elsewhere, each given by its overrides, and tells of each that has ended: its place among the jobs, and
why it failed, None = it did not. The record of one that did not fail is in the records folder then."""

Stamps = dict[Path, tuple[int, int]]

_LOOK_S = 2.0
"""Between two looks for results of Slurm's jobs and at its queue."""

_GRACE_S = 15.0
"""So long after its end a job's result may take to be seen on a shared file system."""


def measure_launched(configuration: Configuration) -> None:
    """Measure one point of a launched sweep, which knows that it is to be measured, and write its record."""
    if configuration.sweep.stand_ins:
        replace_missing_scenes([configuration.scene])
    (planned,) = plan_points([configuration])
    folder = records_folder(configuration)
    check_writable(folder)
    write_record(folder, measure(planned, run_worker))


def finished_elsewhere(folder: Path, points: Mapping[str, PlannedPoint]) -> dict[str, Record]:
    """What earlier runs finished, by name: records of one machine, on which most of the points were measured."""
    of_machines: dict[str, dict[str, Record]] = {}
    for name, record in _written(folder, points, {}):
        if is_reusable(record, points[name]):
            of_machines.setdefault(repr(stable_fields(record.environment)), {})[name] = record
    return max(
        of_machines.values(), key=lambda found: sum(record.status == "ok" for record in found.values()), default={}
    )


def measure_elsewhere(
    launch: Launch, at_once: int, folder: Path, points: Mapping[str, PlannedPoint], names: Sequence[str]
) -> Iterator[tuple[str, Record | None, str | None]]:
    """Have points measured, `at_once` at a time, and tell of the end of each: its name, and its record or why there is
    none. Of an interrupted launcher, too, the records that are there are told of.

    folder: of the records. points: by name. names: those to measure.
    """
    seen: Stamps = {}
    for start in range(0, len(names), at_once):
        batch = names[start : start + at_once]
        left = set(batch)
        for _ in _written(folder, points, seen):  # an earlier record is not what the job is to bring
            pass

        def brought(left: set[str] = left) -> Iterator[tuple[str, Record | None, str | None]]:
            for name, record in _written(folder, points, seen):
                if name in left:
                    left.remove(name)
                    yield name, record, None

        try:
            for place, problem in launch([points[name].overrides for name in batch]):
                yield from brought()
                if batch[place] in left:
                    left.remove(batch[place])
                    yield batch[place], None, problem or "its job left none to use"
        except (Exception, KeyboardInterrupt):
            yield from brought()
            raise


def _written(folder: Path, points: Mapping[str, PlannedPoint], seen: Stamps) -> Iterator[tuple[str, Record]]:
    """Records of the points that are not `seen` yet, or were written again since, oldest first.

    Another machine writes a record under an identity of its own. Records are therefore known by their configuration and
    by the identity that the point has on that machine; numbers of other code are no longer true.
    """
    names = {key_of(planned.point.configuration()): name for name, planned in points.items()}
    stamps: Stamps = {}
    for path in folder.glob("*.json"):
        with suppress(FileNotFoundError):
            stamps[path] = (path.stat().st_mtime_ns, path.stat().st_ino)
    new = sorted((path for path in stamps if seen.get(path) != stamps[path]), key=stamps.__getitem__)
    seen.update(stamps)
    for path in new:
        try:
            record = load_record(folder, path.stem)
        except RecordError:  # perhaps of another sweep or version, and not ours to set aside
            continue
        name = None if record is None else names.get(key_of(record.configuration))
        if record is None or name is None:
            continue
        its_own = identity(points[name].point, record.environment)
        if record.point_id == path.stem == its_own and is_current(record):
            yield name, record


def is_reusable(record: Record, planned: PlannedPoint) -> bool:
    """Whether measuring the point again would tell nothing new; a point that was skipped may be possible now."""
    is_possible_now = record.status == "skipped" and planned.problem is None
    return record.finished and is_current(record) and not is_possible_now


def launch_with(launcher: Any, is_slurm: bool) -> Launch:
    """What has jobs run by a launcher of Hydra's, one Hydra job a process of a point."""

    def launch(jobs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str | None]]:
        # A job is unpickled by an interpreter that was not started as run.py.
        os.environ.update(project_environment())
        try:
            yield from (_on_slurm if is_slurm else _at_once)(launcher, jobs)
        except BaseException as error:
            stop_children()
            if isinstance(error, AtraError) or not isinstance(error, Exception):  # a full disk, an interrupt
                raise
            # Of a launcher: the queue refused, or the first of its workers was killed. Records tell of the others.
            yield from ((place, first_line(error)) for place in range(len(jobs)))

    return launch


def first_line(error: object) -> str:
    """An error in a line."""
    return f"{type(error).__name__}: {str(error).strip().partition(chr(10))[0]}"


def _failure(returned: Any) -> str | None:
    return str(returned._return_value) if returned.status is JobStatus.FAILED else None


def _at_once(launcher: Any, jobs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str | None]]:
    """Have the launcher run the jobs and wait for them all."""
    yield from enumerate(map(_failure, launcher.launch([list(job) for job in jobs], initial_job_idx=0)))


def _on_slurm(launcher: Any, jobs: Sequence[Sequence[str]]) -> Iterator[tuple[int, str | None]]:
    """Submit the jobs together, and wait for each. Whatever else ends the wait, the jobs are cancelled. Raises what a
    queue that refuses the jobs makes submitit raise.

    The launcher itself waits for job after job, raises what the first that failed raises, and asks Slurm's accounting
    alone, which a cluster may lack, whether a job still runs.
    """
    submitted = _submit(launcher, jobs)
    left, gone_s = dict(enumerate(submitted)), dict.fromkeys(range(len(submitted)), 0.0)
    try:
        while left:
            queued = _queued()
            for place, job in list(left.items()):
                with suppress(OSError):  # makes a shared file system look again
                    job.paths.folder.chmod(job.paths.folder.stat().st_mode)
                has_result = job.paths.result_pickle.exists()
                if queued is not None and job.job_id not in queued:
                    gone_s[place] += _LOOK_S
                if has_result or gone_s[place] > _GRACE_S:
                    del left[place]
                    yield place, _problem(job, has_result)
            time.sleep(_LOOK_S if left else 0.0)
    finally:
        if left:
            _cancel(submitted)


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
    state = Singleton.get_state()
    told = [(list(job), "hydra.sweep.dir", place, f"job_id_for_{place}", state) for place, job in enumerate(jobs)]
    return executor.map_array(launcher, *zip(*told, strict=True))


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
    return _failure(returned)


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
