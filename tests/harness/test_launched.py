"""Points of a sweep that other machines measure: which are handed over, whose records are taken, what is lost."""

from dataclasses import replace

import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.configuration import records_folder
from experiments.harness.identity import identity
from experiments.harness.points import measure, plan_points
from experiments.harness.records import load_record, record_path, write_record
from experiments.launched import measure_launched
from experiments.sweep import run_sweep
from tests.sweeps import Runner, configuration, grid

pytestmark = pytest.mark.usefixtures("figures_unsaved")


def test_a_launched_job_measures_whatever_records_there_are(tmp_path, monkeypatch):
    """The sweep, on whatever machine it runs, knows which points have none that is true."""
    one, runner = configuration(tmp_path), Runner()
    (planned,) = plan_points([one])
    write_record(records_folder(one), measure(replace(planned, problem=InputError("cannot load it"))))
    monkeypatch.setattr("experiments.launched.measure", lambda planned, run: measure(planned, runner))
    for _ in range(2):
        measure_launched(one)
    assert len(runner.points) == 2


def measured_elsewhere(planned, run=None, **environment):
    """The record another machine, or other code, would have written; `environment` is what differs there."""
    record = measure(planned, run or Runner())
    files = ["atra/errors.py"] if "code_sha256" in environment else []
    record = replace(record, environment={**record.environment, **environment}, files=files)
    return replace(record, point_id=identity(planned.point, record.environment))


class Elsewhere:
    """Stands in for a launcher whose jobs run on other machines: each writes the record of its point. points: those of
    the sweep. fields: the environment there, in which {} is the split. run: what measures there. refused: a split
    whose job fails."""

    def __init__(self, folder, points, run=None, refused=None, **fields):
        self.folder, self.fields, self.run, self.refused = folder, fields, run or Runner(), refused
        self.planned = {one.configuration.method.options.split_x: one.configuration for one in points}
        self.written, self.batches = [], []

    @property
    def jobs(self):
        return [job for batch in self.batches for job in batch]

    def __call__(self, jobs):
        self.batches.append(list(jobs))
        for place, overrides in enumerate(jobs):
            fields = dict(one.split("=") for one in overrides)
            split, process = int(fields["method.split_x"]), int(fields.get("measure.process", 0))
            if split != self.refused:
                (planned,) = plan_points([self.planned[split]])
                planned = replace(planned, point=replace(planned.point, process=process))
                there = {key: one.format(split) if isinstance(one, str) else one for key, one in self.fields.items()}
                record = measured_elsewhere(planned, self.run, **there)
                write_record(self.folder / "records", record)
                self.written.append(record.point_id)
            yield place, "the queue is closed" if split == self.refused else None


def test_launched_points_are_found_by_their_configuration(tmp_path):
    points = grid(tmp_path, 1, 2)
    launch = Elsewhere(tmp_path, points, cpu="another cpu")
    table = run_sweep(points, launch=launch, at_once=2)
    assert sorted(launch.jobs) == [("method.split_x=1",), ("method.split_x=2",)]
    assert sorted(table["point_id"]) == sorted(launch.written)
    assert list(table["grids"]) == ["one", "one"]
    assert set(table["cpu"]) == {"another cpu"}


def test_a_launcher_is_given_so_many_points_at_once_and_each_just_once(tmp_path):
    points = grid(tmp_path, 1, 2, 4, 8, 16)
    launch = Elsewhere(tmp_path, points)
    run_sweep(points, launch=launch, at_once=2)
    assert [len(batch) for batch in launch.batches] == [2, 2, 1]
    assert len(set(launch.jobs)) == 5


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_point_whose_job_failed_is_named_with_the_reason_and_the_others_are_in_the_table(
    tmp_path, capsys, interrupted
):
    points = grid(tmp_path, 1, 2, 4)
    launch = Elsewhere(tmp_path, points, refused=4)

    def launch_and_interrupt(jobs):
        yield from list(launch(jobs))[:0]
        raise KeyboardInterrupt

    with pytest.raises(SystemExit) as ended:
        run_sweep(points, launch=launch_and_interrupt if interrupted else launch, at_once=3)
    assert ended.value.code == (130 if interrupted else 1)
    assert sorted(pd.read_csv(tmp_path / "one" / "table.csv")["split_x"]) == [1, 2]
    told = capsys.readouterr().err
    assert interrupted or "4 \N{MULTIPLICATION SIGN} 1, culling on: no record: the queue is closed" in told
    assert interrupted or "1 points have no record" in told


@pytest.mark.parametrize("faults", ["other code", "another name", "another method", "no record"])
def test_a_job_s_record_that_this_code_did_not_write_is_not_taken(tmp_path, faults, capsys):
    (planned,) = plan_points([configuration(tmp_path)])
    record = measured_elsewhere(planned, cpu="another cpu")
    if faults == "other code":
        record = measured_elsewhere(planned, cpu="another cpu", code_sha256="0")
    elif faults == "another name":
        record = replace(record, point_id="f00")
    elif faults == "another method":  # of a later version
        record = replace(record, configuration=record.configuration | {"method": "later"})

    def job(jobs):
        path = write_record(tmp_path / "records", record)
        if faults == "no record":
            path.write_text("{}")
        yield 0, None

    with pytest.raises(SystemExit):
        run_sweep(grid(tmp_path, 1), launch=job)
    assert "no record: its job left none to use" in capsys.readouterr().err
    path = record_path(tmp_path / "records", record.point_id)
    assert path.exists()  # it may be of another version, which can still read it


def test_launched_points_of_two_machines_are_not_put_into_one_table(tmp_path):
    points = grid(tmp_path, 1, 2)
    with pytest.raises(InputError, match="cpu is 'cpu 1' in one and 'cpu 2' in the other"):
        run_sweep(points, launch=Elsewhere(tmp_path, points, cpu="cpu {}"), at_once=2)


def test_a_point_that_cannot_be_measured_is_in_the_table_of_another_machine(tmp_path):
    """This machine, which launches the jobs, says so."""
    points = grid(tmp_path, 2, 7, report=True)  # 64 pixels are no 7 columns
    for _ in range(2):
        launch = Elsewhere(tmp_path, points, cpu="another cpu")
        assert list(run_sweep(points, launch=launch)["status"]) == ["ok", "skipped"]
    assert launch.jobs == []


def test_jobs_that_a_queue_bound_to_one_core_each_make_one_table(tmp_path):
    points = grid(tmp_path, 1, 2)

    class Bound(Elsewhere):
        def __call__(self, jobs):
            self.fields = {"affinity": [len(self.jobs)]}
            yield from super().__call__(jobs)

    assert sorted(run_sweep(points, launch=Bound(tmp_path, points))["affinity"]) == ["0", "1"]


def test_what_another_machine_finished_is_not_launched_again_and_what_failed_there_is(tmp_path, capsys):
    points = grid(tmp_path, 1, 2, 4)
    first, second = (Elsewhere(tmp_path, points, cpu="another cpu") for _ in range(2))
    run_sweep(points[:2], launch=first, at_once=2)
    with pytest.raises(SystemExit):
        run_sweep(points, launch=Elsewhere(tmp_path, points, Runner("failed"), cpu="another cpu"), at_once=3)
    table = run_sweep(points, launch=second, at_once=3)
    assert "2 finished before, 0 cannot be measured, 1 to do" in capsys.readouterr().err
    assert second.jobs == [("method.split_x=4",)]
    assert sorted(table["point_id"]) == sorted(first.written + second.written)


def test_of_records_of_two_machines_those_are_kept_of_which_there_are_most(tmp_path):
    points = grid(tmp_path, 1, 2, 4)
    for cpu, some in (("one", points), ("two", points[:2])):
        for planned in plan_points([one.configuration for one in some]):
            write_record(tmp_path / "records", measured_elsewhere(planned, cpu=cpu))
    again = Elsewhere(tmp_path, points)
    assert set(run_sweep(points, launch=again)["cpu"]) == {"one"}
    assert again.jobs == []


def disturbed_once(count):
    """Processes 0 to `count` - 1 scatter the first time they run."""
    runner = Runner()

    def run(point):
        outcome = runner(point)
        first = runner.points.count(point) == 1
        samples = outcome.samples | {"own": [0.05, 0.1, 0.2]} if first and point.process < count else outcome.samples
        return replace(outcome, samples=samples)

    return run


def replaced(folder):
    """How many processes each record has replaced, with the time of its own method, by process."""
    records = [load_record(folder / "records", path.stem) for path in (folder / "records").glob("*.json")]
    return {
        one.configuration["process"]: (one.results.get("measured_again", 0), one.samples["own"][0]) for one in records
    }


def test_what_was_disturbed_on_another_machine_is_measured_again_there(tmp_path):
    points = grid(tmp_path, 1, processes=5)
    launch = Elsewhere(tmp_path, points, disturbed_once(2), cpu="another cpu")
    table = run_sweep(points, launch=launch, at_once=5)
    assert [len(batch) for batch in launch.batches] == [5, 2]
    assert list(table["processes_replaced"]) == [2]
    assert replaced(tmp_path) == {0: (1, 0.1), 1: (1, 0.1), 2: (0, 0.1), 3: (0, 0.1), 4: (0, 0.1)}


@pytest.mark.parametrize("elsewhere", [False, True])
def test_an_interrupt_while_processes_are_measured_again_loses_no_record(elsewhere, tmp_path):
    points, run, calls = grid(tmp_path, 1, processes=5), disturbed_once(3), []

    def interrupted(point):
        calls.append(point)
        if len(calls) == 7:  # five, and one again
            raise KeyboardInterrupt
        return run(point)

    launch = Elsewhere(tmp_path, points, interrupted, cpu="another cpu") if elsewhere else None
    with pytest.raises(SystemExit) as ended:
        run_sweep(points, run=interrupted, launch=launch, at_once=5)
    assert ended.value.code == 130
    assert sorted(replaced(tmp_path).values()) == [(0, 0.05), (0, 0.05), (0, 0.1), (0, 0.1), (1, 0.1)]
    assert list(pd.read_csv(tmp_path / "one" / "table.csv")["processes"]) == [5]


def test_a_record_whose_successor_s_job_fails_stays_as_it_is(tmp_path):
    points = grid(tmp_path, 1, processes=5)

    class Once(Elsewhere):
        def __call__(self, jobs):
            self.refused = 1 if self.jobs else None
            yield from super().__call__(jobs)

    launch = Once(tmp_path, points, disturbed_once(1), cpu="another cpu")
    run_sweep(points, launch=launch, at_once=5)
    assert len(launch.jobs) == 6
    assert replaced(tmp_path)[0] == (0, 0.05)
