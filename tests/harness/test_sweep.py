"""Sweeps as a whole, with a runner that measures nothing: what is measured, what is shared, what is refused."""

from dataclasses import replace

import psutil
import pytest
from psutil import virtual_memory

from atra.errors import InputError
from experiments.harness.configuration import (
    Chosen,
    Configuration,
    MeasureConfiguration,
    SceneConfiguration,
    SweepConfiguration,
    records_folder,
)
from experiments.harness.identity import current_environment, identity, identity_of, measure
from experiments.harness.options import NoOptions
from experiments.harness.points import plan_points
from experiments.harness.processes.outcome import Outcome
from experiments.harness.records import point_id, write_record
from experiments.launched import measure_launched
from experiments.methods.aligned import ALIGNED, AlignedOptions
from experiments.methods.peers.embreex_run import EMBREEX
from experiments.methods.pixel import PIXEL, PixelOptions
from experiments.sweep import GridPoint, run_sweep
from experiments.workloads import find_workload
from scenes.loading import SceneSource
from tests.harness.processes.test_outcome import POINT

pytestmark = pytest.mark.usefixtures("figures_unsaved")


class Runner:
    """Stands in for the worker: remembers the points it was given."""

    def __init__(self, status="ok"):
        self.status = status
        self.points = []

    def __call__(self, point):
        self.points.append(point)
        if self.status != "ok":
            return Outcome(self.status, "on purpose")
        results = {
            "triangles_traced": 10, "packet_width": 8, "threads": 1, "plan_time_s": 0.1,
            "build_time_s": 0.1, "rss_bytes": 9, "peak_rss_bytes": 9, "embree_bytes": 9, "rounds": 3,
            "pixels_equal": 64, "pixels_tied": 0, "pixels_edge": 0, "pixels_wrong": 0,
        }  # fmt: skip
        names = ("own", "rtcIntersect1", "packets_8")
        return Outcome("ok", samples={name: [0.1, 0.1, 0.1] for name in names}, results=results)


def configuration(folder, sweep="one", split_x=1, workload="frame", **fields):
    """Of a sweep that draws nothing: drawing takes time."""
    return Configuration(
        scene=SceneConfiguration(name="cornell_box", source=SceneSource.procedural),
        sweep=SweepConfiguration(name=sweep, figures={"figure5": []}),
        measure=MeasureConfiguration(processes=1),
        method=fields.pop("method", Chosen(ALIGNED, AlignedOptions(split_x))),
        workload=Chosen(find_workload(workload), NoOptions()),
        **{"width": 64, "height": 64, "results_dir": str(folder), **fields},
    )


def test_a_point_of_two_grids_is_measured_once_and_belongs_to_both(tmp_path):
    runner = Runner()
    points = [
        GridPoint("horizontal", configuration(tmp_path, split_x=1)),
        GridPoint("horizontal", configuration(tmp_path, split_x=2)),
        GridPoint("grid", configuration(tmp_path, split_x=2)),
    ]
    table = run_sweep(points, run=runner)
    assert sorted(point.options.split_x for point in runner.points) == [1, 2]
    assert list(table["grids"]) == ["horizontal", "horizontal,grid"]


def test_what_one_sweep_measured_another_does_not_measure_again(tmp_path):
    run_sweep([GridPoint("a", configuration(tmp_path, "first"))], run=Runner())
    runner = Runner()
    both = [GridPoint("b", configuration(tmp_path, "second", split_x=split)) for split in (1, 4)]
    table = run_sweep(both, run=runner)
    assert [point.options.split_x for point in runner.points] == [4]
    assert len(table) == 2
    assert (tmp_path / "second" / "table.csv").exists()


def test_a_failed_point_is_tried_again_and_the_exit_code_tells(tmp_path):
    points = [GridPoint("a", configuration(tmp_path))]
    with pytest.raises(SystemExit) as failed:
        run_sweep(points, run=Runner(status="failed"))
    assert failed.value.code == 1
    again = Runner()
    run_sweep(points, run=again)
    assert len(again.points) == 1


def test_a_point_that_lacked_memory_is_tried_again_when_more_is_free_and_not_given_up_when_less_is(
    tmp_path, monkeypatch
):
    unculled = Chosen(ALIGNED, AlignedOptions(64, culling=False))
    points = [GridPoint("a", configuration(tmp_path, method=unculled))]
    points[0].configuration.measure.processes = 3
    free = virtual_memory()

    def sweep(available):
        monkeypatch.setattr(psutil, "virtual_memory", lambda: free._replace(available=available))
        runner = Runner()
        return list(run_sweep(points, run=runner)["status"]), len(runner.points)

    assert sweep(10 * 2**20) == (["skipped"], 0)
    assert sweep(2**34) == (["ok"], 3)
    assert sweep(10 * 2**20) == (["ok"], 0)


def test_a_point_skipped_for_want_of_a_library_is_measured_when_the_library_is_there(tmp_path):
    def refuse(*given):
        raise InputError("cannot load it")

    def sweep(is_there):
        method = ALIGNED if is_there else replace(ALIGNED, make=refuse)
        # Another point can be measured, or the sweep is refused.
        chosen = Chosen(method, AlignedOptions(4)), Chosen(PIXEL, PixelOptions())
        points = [configuration(tmp_path, method=one) for one in chosen]
        runner = Runner()
        table = run_sweep([GridPoint("a", one) for one in points], run=runner)
        return dict(zip(table["method"], table["status"], strict=True)), [one.method.name for one in runner.points]

    assert sweep(False) == ({"aligned": "skipped", "pixel": "ok"}, ["pixel"])
    assert sweep(False) == ({"aligned": "skipped", "pixel": "ok"}, [])
    assert sweep(True) == ({"aligned": "ok", "pixel": "ok"}, ["aligned"])


def test_a_launched_job_measures_a_point_that_was_skipped_before(tmp_path, monkeypatch):
    one, runner = configuration(tmp_path), Runner()
    (planned,) = plan_points([one])
    write_record(records_folder(one), measure(replace(planned, problem=InputError("cannot load it"))))
    monkeypatch.setattr("experiments.launched.measure", lambda planned, _: measure(planned, runner))
    for _ in range(2):
        measure_launched(one)
    assert len(runner.points) == 1


def test_workers_of_a_sweep_and_of_its_launched_jobs_share_its_folder_of_bytecode(tmp_path, monkeypatch):
    shared = []

    def run(point, results):
        shared.append((results, (results / ".bytecode").is_dir()))
        return Runner()(point)

    def launch(jobs):
        measure_launched(configuration(tmp_path, split_x=2))
        return [None]

    for module in ("sweep", "launched"):
        monkeypatch.setattr(f"experiments.{module}.run_worker", run)
    monkeypatch.setattr("experiments.harness.processes.bytecode._is_beside_sources", lambda: False)
    run_sweep([GridPoint("a", configuration(tmp_path))])
    run_sweep([GridPoint("a", configuration(tmp_path, split_x=2))], launch=launch)
    assert shared == [(tmp_path, True)] * 2
    assert not (tmp_path / ".bytecode").exists()


def test_the_memory_budget_is_a_share_of_what_is_free_or_what_is_said(monkeypatch):
    free = virtual_memory()
    monkeypatch.setattr(psutil, "virtual_memory", lambda: free._replace(available=24 * 2**30))
    assert replace(POINT, memory_budget_gib=None).tracing.memory_budget_bytes == 18 * 2**30
    assert replace(POINT, memory_budget_gib=4.0).tracing.memory_budget_bytes == 4 * 2**30


def test_a_scene_that_is_not_here_is_replaced_by_its_stand_in_only_where_allowed(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ATRA_SCENES", str(tmp_path))
    missing = configuration(tmp_path)
    missing.scene = SceneConfiguration(name="sponza", source=SceneSource.directory)
    with pytest.raises(InputError, match="sponza"):
        run_sweep([GridPoint("a", missing)], run=Runner())
    missing.sweep.stand_ins = True
    table = run_sweep([GridPoint("a", missing)], run=Runner())
    assert (table["scene"][0], table["stands_for"][0]) == ("atrium", "sponza")
    assert "sponza is not on this machine; atrium, its stand-in, is not that scene" in capsys.readouterr().err


def test_a_model_in_the_home_folder_is_found_by_the_worker_too(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "model.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = SceneConfiguration(source=SceneSource.file, path="~/model.obj")
    (planned,) = plan_points([replace(configuration(tmp_path), scene=scene)])
    assert planned.point.scene_path == str(tmp_path / "model.obj")


def test_a_peer_s_point_is_another_one_with_another_version_of_the_peer(tmp_path, monkeypatch):
    environment = current_environment()

    def named():
        return [identity(replace(POINT, method=method), environment) for method in (EMBREEX, ALIGNED)]

    before = named()
    monkeypatch.setattr("experiments.methods.peers.peer.package_version", lambda package: "0")
    peer, own = named()
    assert peer != before[0]
    assert own == before[1]


def measured_elsewhere(planned, **environment):
    """The record another machine, or other code, would have written; `environment` is what differs there."""
    record = measure(planned, Runner())
    if "code_sha256" in environment:
        record = replace(record, point_id=point_id(record.configuration | environment, record.environment))
        return replace(record, environment={**record.environment, **environment})
    record = replace(record, environment={**record.environment, **environment})
    return replace(record, point_id=identity_of(record, planned.point))


class Elsewhere:
    """Stands in for a launcher whose jobs run on other machines: each writes the record of its point."""

    def __init__(self, folder, configurations, cpu):
        self.folder, self.configurations, self.cpu, self.written, self.jobs = folder, configurations, cpu, [], []

    def __call__(self, jobs):
        self.jobs += jobs
        for planned in plan_points(self.configurations):
            record = measured_elsewhere(planned, cpu=self.cpu.format(planned.point.options.split_x))
            write_record(self.folder / "records", record)
            self.written.append(record.point_id)
        return [None] * len(jobs)


def test_launched_points_are_found_by_their_configuration(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2)]
    launch = Elsewhere(tmp_path, configurations, "another cpu")
    points = [GridPoint("a", one, (f"method.split_x={one.method.options.split_x}",)) for one in configurations]
    table = run_sweep(points, launch=launch, at_once=2)
    assert sorted(launch.jobs) == [("method.split_x=1",), ("method.split_x=2",)]
    assert list(table["point_id"]) == launch.written
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
    path = write_record(tmp_path / "records", record)
    if faults == "no record":
        path.write_text("{}")
    with pytest.raises(SystemExit):
        run_sweep([GridPoint("a", configuration(tmp_path))], launch=lambda jobs: [None])
    assert "no record: its job left none to use" in capsys.readouterr().err
    assert path.exists()  # it may be of another version, which can still read it


def test_launched_points_of_two_machines_are_not_put_into_one_table(tmp_path):
    configurations = [configuration(tmp_path, split_x=split) for split in (1, 2)]
    with pytest.raises(InputError, match="cpu is 'cpu 1' in one and 'cpu 2' in the other"):
        run_sweep(
            [GridPoint("a", one) for one in configurations],
            launch=Elsewhere(tmp_path, configurations, "cpu {}"),
            at_once=2,
        )


def test_a_peer_that_does_not_tell_its_memory_is_no_reason_to_stop(tmp_path):
    def run(point):
        results = Runner()(point).results
        return Outcome("ok", results={"rss_bytes": results["rss_bytes"], "peak_rss_bytes": 9})

    memory = GridPoint("a", configuration(tmp_path, workload="memory"))
    assert list(run_sweep([memory], run=run)["rss_bytes"]) == [9]


class Predicted:
    """Stands in for the model: a frame takes as many seconds as there are cells."""

    def __init__(self, look, choice, want, known):
        assert (look, want) == ("a look", "nearest")
        self.frame_time_s = float(choice.cells)


@pytest.fixture
def predicted(monkeypatch):
    monkeypatch.setattr("experiments.harness.points.look_at", lambda mesh, camera: "a look")
    monkeypatch.setattr("experiments.harness.points.forecast", Predicted)


def skipping(folder, limit, splits=(1, 2, 8)):
    points = [configuration(folder, split_x=split) for split in splits]
    for one in points:
        one.sweep.skip_slower = limit
    return [GridPoint("a", one) for one in points]


def test_points_predicted_to_be_slow_are_skipped_on_request_and_their_rows_say_why(tmp_path, predicted):
    runner = Runner()
    table = run_sweep(skipping(tmp_path, 4.0), run=runner)
    assert sorted(point.options.split_x for point in runner.points) == [1, 2]
    assert list(table["status"]) == ["ok", "ok", "skipped"]
    assert "8 times as long as the fastest of this view; sweep.skip_slower is 4" in table["error"][2]


def test_a_point_that_was_skipped_as_slow_is_measured_when_it_is_wanted_and_stays_measured(tmp_path, predicted):
    run_sweep(skipping(tmp_path, 4.0), run=Runner())
    runner = Runner()
    run_sweep(skipping(tmp_path, None), run=runner)
    assert [point.options.split_x for point in runner.points] == [8]
    assert list(run_sweep(skipping(tmp_path, 4.0), run=Runner())["status"]) == ["ok"] * 3


def test_a_point_of_which_the_model_knows_nothing_is_not_skipped(tmp_path, predicted):
    one = configuration(tmp_path, method=Chosen(EMBREEX, EMBREEX.options()))
    one.sweep.skip_slower = 1.0
    planned = plan_points([one, *(each.configuration for each in skipping(tmp_path, 1.0, (1, 2)))])
    assert ["predicted" in str(each.problem) for each in planned] == [False, False, True]


def test_a_limit_below_1_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"sweep\.skip_slower is 0\.5"):
        run_sweep(skipping(tmp_path, 0.5), run=Runner())
