"""Points of a sweep that other machines measure: which are handed over, whose records are taken, what is lost."""

from dataclasses import replace

import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.configuration import records_folder
from experiments.harness.identity import identity
from experiments.harness.points import GridPoint, measure, plan_points
from experiments.harness.records import load_record, record_path, write_record
from experiments.launched import measure_launched
from experiments.sweep import run_sweep
from tests.harness.test_sweep import Runner, configuration

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
    """Stands in for a launcher whose jobs run on other machines: each writes the record of its point. fields: the
    environment there, in which {} is the split. run: what measures there."""

    def __init__(self, folder, configurations, run=None, **fields):
        self.folder, self.fields, self.run = folder, fields, run or Runner()
        self.planned = {one.method.options.split_x: one for one in configurations}
        self.written, self.jobs = [], []

    def __call__(self, jobs):
        self.jobs += jobs
        for place, overrides in enumerate(jobs):
            fields = dict(one.split("=") for one in overrides)
            split, process = int(fields["method.split_x"]), int(fields.get("measure.process", 0))
            (planned,) = plan_points([self.planned[split]])
            planned = replace(planned, point=replace(planned.point, process=process))
            there = {key: each.format(split) if isinstance(each, str) else each for key, each in self.fields.items()}
            record = measured_elsewhere(planned, self.run, **there)
            write_record(self.folder / "records", record)
            self.written.append(record.point_id)
            yield place, None


def grid_points(configurations):
    return [GridPoint("a", one, (f"method.split_x={one.method.options.split_x}",)) for one in configurations]


def test_launched_points_are_found_by_their_configuration(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2)]
    launch = Elsewhere(tmp_path, configurations, cpu="another cpu")
    table = run_sweep(grid_points(configurations), launch=launch, at_once=2)
    assert sorted(launch.jobs) == [("method.split_x=1",), ("method.split_x=2",)]
    assert sorted(table["point_id"]) == sorted(launch.written)
    assert list(table["grids"]) == ["a", "a"]
    assert set(table["cpu"]) == {"another cpu"}


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
        run_sweep([GridPoint("a", configuration(tmp_path))], launch=job)
    assert "no record: its job left none to use" in capsys.readouterr().err
    assert record_path(
        tmp_path / "records", record.point_id
    ).exists()  # it may be of another version, which can still read it


def test_launched_points_of_two_machines_are_not_put_into_one_table(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2)]
    with pytest.raises(InputError, match="cpu is 'cpu 1' in one and 'cpu 2' in the other"):
        run_sweep(grid_points(configurations), launch=Elsewhere(tmp_path, configurations, cpu="cpu {}"), at_once=2)


def test_a_point_that_cannot_be_measured_is_in_the_table_of_another_machine(tmp_path):
    """This machine, which launches the jobs, says so."""
    configurations = [configuration(tmp_path, split_x=split) for split in (2, 7)]  # 64 pixels are no 7 columns
    configurations[0].sweep.report = True
    for _ in range(2):
        launch = Elsewhere(tmp_path, configurations, cpu="another cpu")
        table = run_sweep(grid_points(configurations), launch=launch)
        assert list(table["status"]) == ["ok", "skipped"]
    assert launch.jobs == []


def test_jobs_that_a_queue_bound_to_one_core_each_make_one_table(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2)]

    class Bound(Elsewhere):
        def __call__(self, jobs):
            self.fields = {"affinity": [len(self.jobs)]}
            yield from super().__call__(jobs)

    table = run_sweep(grid_points(configurations), launch=Bound(tmp_path, configurations))
    assert sorted(table["affinity"]) == ["0", "1"]


def test_what_another_machine_finished_the_same_command_does_not_launch_again(tmp_path, capsys):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2, 4)]
    first = Elsewhere(tmp_path, configurations, cpu="another cpu")
    run_sweep(grid_points(configurations[:2]), launch=first, at_once=2)
    second = Elsewhere(tmp_path, configurations, cpu="another cpu")
    table = run_sweep(grid_points(configurations), launch=second, at_once=3)
    assert "2 finished before, 0 cannot be measured, 1 to do" in capsys.readouterr().err
    assert second.jobs == [("method.split_x=4",)]
    assert sorted(table["point_id"]) == sorted(first.written + second.written)


def test_of_records_of_two_machines_those_are_kept_of_which_there_are_most(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2, 4)]
    for cpu, some in (("one", configurations), ("two", configurations[:2])):
        for planned in plan_points(some):
            write_record(tmp_path / "records", measured_elsewhere(planned, cpu=cpu))
    again = Elsewhere(tmp_path, configurations)
    assert set(run_sweep(grid_points(configurations), launch=again)["cpu"]) == {"one"}
    assert again.jobs == []


def test_a_failed_job_of_another_machine_is_launched_again(tmp_path):
    configurations = [configuration(tmp_path)]
    with pytest.raises(SystemExit):
        run_sweep(grid_points(configurations), launch=Elsewhere(tmp_path, configurations, Runner("failed"), cpu="one"))
    assert set(
        run_sweep(grid_points(configurations), launch=Elsewhere(tmp_path, configurations, cpu="one"))["status"]
    ) == {"ok"}


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


def five(folder):
    configurations = [configuration(folder)]
    configurations[0].measure.processes = 5
    return configurations


def test_what_was_disturbed_on_another_machine_is_measured_again_there(tmp_path):
    launch = Elsewhere(tmp_path, five(tmp_path), disturbed_once(2), cpu="another cpu")
    table = run_sweep(grid_points(five(tmp_path)), launch=launch, at_once=5)
    assert len(launch.jobs) == 7
    assert list(table["processes_replaced"]) == [2]
    assert replaced(tmp_path) == {0: (1, 0.1), 1: (1, 0.1), 2: (0, 0.1), 3: (0, 0.1), 4: (0, 0.1)}


@pytest.mark.parametrize("elsewhere", [False, True])
def test_an_interrupt_while_processes_are_measured_again_loses_no_record(elsewhere, tmp_path):
    run, calls = disturbed_once(3), []

    def interrupted(point):
        calls.append(point)
        if len(calls) == 7:  # five, and one again
            raise KeyboardInterrupt
        return run(point)

    launch = Elsewhere(tmp_path, five(tmp_path), interrupted, cpu="another cpu") if elsewhere else None
    with pytest.raises(SystemExit) as ended:
        run_sweep(grid_points(five(tmp_path)), run=interrupted, launch=launch, at_once=5)
    assert ended.value.code == 130
    found = replaced(tmp_path)
    assert len(found) == 5
    assert sorted(found.values()) == [(0, 0.05), (0, 0.05), (0, 0.1), (0, 0.1), (1, 0.1)]
    assert list(pd.read_csv(tmp_path / "one" / "table.csv")["processes"]) == [5]


def test_a_record_whose_successor_s_job_fails_stays_as_it_is(tmp_path):
    class Once(Elsewhere):
        def __call__(self, jobs):
            if len(self.jobs) < 5:
                yield from super().__call__(jobs)
            else:
                self.jobs += jobs
                yield 0, "killed"

    launch = Once(tmp_path, five(tmp_path), disturbed_once(1), cpu="another cpu")
    run_sweep(grid_points(five(tmp_path)), launch=launch, at_once=5)
    assert len(launch.jobs) == 6
    assert replaced(tmp_path)[0] == (0, 0.05)
