"""Points of a sweep measured elsewhere: what hands them to a launcher, what a job does, and what finds its record."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from atra.errors import RecordError
from experiments.harness.configuration import Configuration, records_folder
from experiments.harness.environment import stable_fields
from experiments.harness.identity import identity, is_current
from experiments.harness.points import PlannedPoint, measure, plan_points
from experiments.harness.processes.launching import run_worker
from experiments.harness.records import Record, check_writable, load_record, write_record
from experiments.results.processes import key_of
from scenes.loading import replace_missing_scenes

Ended = Callable[[int, str | None], None]
"""Is told when a job has ended: its place among the jobs, and why it failed, None = it did not."""

Launch = Callable[[Sequence[Sequence[str]], Ended], None]
"""Has points measured elsewhere, each given by its overrides, and tells of the end of each job. The record of a job
that did not fail is in the records folder then."""


def measure_launched(configuration: Configuration) -> None:
    """Measure one point of a launched sweep, which knows that it is to be measured, and write its record."""
    if configuration.sweep.stand_ins:
        replace_missing_scenes([configuration.scene])
    (planned,) = plan_points([configuration])
    folder = records_folder(configuration)
    check_writable(folder)
    write_record(folder, measure(planned, run_worker))


class Launched:
    """The points of a sweep and the launcher that has them measured.

    Another machine writes a record under an identity of its own. Records are therefore known by their configuration and
    by the identity that the point has on that machine; numbers of other code are no longer true.
    points: by name. folder: of the records. at_once: how many jobs the launcher is given at a time.
    """

    def __init__(self, launch: Launch, at_once: int, folder: Path, points: Mapping[str, PlannedPoint]) -> None:
        self._launch, self._at_once, self._folder, self._points = launch, at_once, folder, points
        self._names = {key_of(planned.point.configuration()): name for name, planned in points.items()}
        self._seen: dict[Path, tuple[int, int]] = {}

    def finished(self) -> dict[str, Record]:
        """What earlier runs finished, by name: records of one machine, on which most of the points were measured."""
        of_machines: dict[str, dict[str, Record]] = {}
        for name, record in self._written():
            if reusable(record, self._points[name]) is not None:
                of_machines.setdefault(repr(stable_fields(record.environment)), {})[name] = record
        return max(
            of_machines.values(),
            key=lambda records: sum(record.status == "ok" for record in records.values()),
            default={},
        )

    def measure(
        self, overrides: Mapping[str, Sequence[str]], ended: Callable[[str, Record | None, str | None], None]
    ) -> None:
        """Have points measured, each given by its overrides, and tell of the end of each: its record, or why there is
        none. Of an interrupted launcher, too, the records that are there are told of."""
        names = list(overrides)
        for start in range(0, len(names), self._at_once):
            batch = names[start : start + self._at_once]
            left = set(batch)
            for _ in self._written():  # an earlier record is not what the job is to bring
                pass

            def take(left: set[str] = left) -> None:
                for name, record in self._written():
                    if name in left:
                        left.remove(name)
                        ended(name, record, None)

            def job_ended(place: int, problem: str | None, batch: list[str] = batch, left: set[str] = left) -> None:
                take()
                if batch[place] in left:
                    left.remove(batch[place])
                    ended(batch[place], None, problem or "its job left none to use")

            try:
                self._launch([overrides[name] for name in batch], job_ended)
            finally:
                take()

    def _written(self) -> Iterator[tuple[str, Record]]:
        """Records of the points that were written since the last call, at first all that there are; oldest first."""
        stamps: dict[Path, tuple[int, int]] = {}
        for path in self._folder.glob("*.json"):
            with suppress(FileNotFoundError):
                stamps[path] = (path.stat().st_mtime_ns, path.stat().st_ino)
        new = sorted((path for path in stamps if self._seen.get(path) != stamps[path]), key=lambda path: stamps[path])
        for path in new:
            self._seen[path] = stamps[path]
            try:
                record = load_record(self._folder, path.stem)
            except RecordError:  # perhaps of another sweep or version, and not ours to set aside
                continue
            name = None if record is None else self._names.get(key_of(record.configuration))
            if record is None or name is None:
                continue
            its_own = identity(self._points[name].point, record.environment)
            if record.point_id == path.stem == its_own and is_current(record):
                yield name, record


def reusable(record: Record | None, planned: PlannedPoint) -> Record | None:
    """The record if measuring the point again would tell nothing new; a point that was skipped may be possible now."""
    if record is None or not record.finished or not is_current(record):
        return None
    if record.status == "skipped" and planned.problem is None:
        return None
    return record
