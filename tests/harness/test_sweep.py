"""Sweeps as a whole, with a runner that measures nothing: what is measured, what is shared, what is refused."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from psutil import virtual_memory

from atra.errors import InputError, MemoryBudgetError
from experiments.commands.single import run_single_point
from experiments.harness.configuration import (
    Chosen,
    SceneConfiguration,
    records_folder,
)
from experiments.harness.identity import current_environment, identity
from experiments.harness.points import GridPoint, measure, plan_points
from experiments.harness.processes.worker import failed, skipped
from experiments.harness.records import Record, load_record, write_record
from experiments.methods.aligned import ALIGNED, AlignedOptions
from experiments.methods.peers.embreex_run import EMBREEX
from experiments.methods.pixel import PIXEL, PixelOptions
from experiments.results.table import read_table
from experiments.sweep import run_sweep
from scenes.loading import SceneSource
from tests.points import POINT
from tests.sweeps import Runner, configuration, grid

pytestmark = pytest.mark.usefixtures("figures_unsaved")


def test_a_point_of_two_grids_is_measured_once_and_belongs_to_both(tmp_path):
    runner = Runner()
    table = run_sweep(grid(tmp_path, 1, 2, name="horizontal") + grid(tmp_path, 2, name="grid"), run=runner)
    assert sorted(runner.measured) == [(1, 0), (2, 0)]
    assert list(table["grids"]) == ["horizontal", "horizontal,grid"]


def test_what_one_sweep_measured_another_does_not_measure_again(tmp_path):
    run_sweep(grid(tmp_path, 1), run=Runner())
    runner = Runner()
    table = run_sweep([GridPoint("b", configuration(tmp_path, "second", split)) for split in (1, 4)], run=runner)
    assert runner.measured == [(4, 0)]
    assert len(table) == 2
    assert (tmp_path / "second" / "table.csv").exists()


def test_a_failed_point_is_tried_again_and_the_exit_code_tells(tmp_path):
    with pytest.raises(SystemExit) as failed:
        run_sweep(grid(tmp_path, 1), run=Runner(status="failed"))
    assert failed.value.code == 1
    again = Runner()
    run_sweep(grid(tmp_path, 1), run=again)
    assert again.measured == [(1, 0)]


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


class Limited(Runner):
    """A worker that is stopped at a time limit below 60 s where it has two columns of cells, and lacks memory below
    2 GiB where it has four."""

    def __call__(self, point):
        found = super().__call__(point)
        if point.options.split_x == 2 and point.time_limit_s < 60:
            return failed(f"stopped after the time limit of {point.time_limit_s:g} s")
        if point.options.split_x == 4 and point.memory_budget_gib < 2:
            return skipped(MemoryBudgetError("needs 2 GiB"))
        return found


def test_a_larger_limit_is_for_the_points_that_the_smaller_one_stopped_and_the_sweep_stays_where_it_is(tmp_path):
    def sweep(time_limit_s, memory_budget_gib):
        points = grid(tmp_path, 1, 2, 4)
        for one in points:
            one.configuration.measure.time_limit_s = time_limit_s
            one.configuration.measure.memory_budget_gib = memory_budget_gib
        command = f"run.py sweep=one measure.time_limit_s={time_limit_s} measure.memory_budget_gib={memory_budget_gib}"
        runner = Limited()
        with suppress(SystemExit):
            run_sweep(points, command=command, run=runner)
        statuses = list(read_table(tmp_path / "one" / "table.parquet")["status"])
        return statuses, sorted(split for split, _ in runner.measured)

    assert sweep(10.0, 1.0) == (["ok", "failed", "skipped"], [1, 2, 4])
    assert sweep(100.0, 1.0) == (["ok", "ok", "skipped"], [2, 4])
    assert sweep(100.0, 4.0) == (["ok", "ok", "ok"], [4])
    assert sweep(10.0, 1.0) == (["ok", "ok", "ok"], [])
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == ["one", "records"]


def test_processes_of_a_point_that_were_measured_with_other_limits_are_of_one_row(tmp_path):
    points = grid(tmp_path, 1, processes=3)

    class StoppedOnce(Runner):
        def __call__(self, point):
            found = super().__call__(point)
            return found if point.process != 1 or point.time_limit_s > 10 else failed("stopped")

    points[0].configuration.measure.time_limit_s = 10.0
    with pytest.raises(SystemExit):
        run_sweep(points, run=StoppedOnce())
    points[0].configuration.measure.time_limit_s = 100.0
    again = StoppedOnce()
    assert list(run_sweep(points, run=again)["processes"]) == [3]
    assert again.measured == [(1, 1)]


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


def test_a_peer_that_does_not_tell_its_memory_is_no_reason_to_stop(tmp_path):
    def run(point):
        results = Runner()(point).results
        return Record("", "ok", results={"rss_bytes": results["rss_bytes"], "peak_rss_bytes": 9})

    assert list(run_sweep(grid(tmp_path, 1, workload="memory"), run=run)["rss_bytes"]) == [9]


def test_a_single_point_leaves_the_record_of_a_sweep_as_it_is_and_replaces_one_that_failed(
    tmp_path, monkeypatch, capsys
):
    one = configuration(tmp_path)
    run = {"run": Runner("failed")}
    monkeypatch.setattr("experiments.commands.single.measure", lambda planned: measure(planned, run["run"]))

    def record(runner):
        """The record that a point by this runner prints."""
        run["run"] = runner
        with suppress(SystemExit):
            run_single_point(one)
        told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("record: ")]
        return Path(told[0].removeprefix("record: ")) if told else None

    def statuses():
        return [load_record(path.parent, path.stem).status for path in records_folder(one).glob("*.json")]

    record(Runner("failed"))
    assert statuses() == ["failed"]
    kept = record(Runner())
    assert statuses() == ["ok"]
    of_a_sweep = load_record(kept.parent, kept.stem)
    write_record(kept.parent, replace(of_a_sweep, results=of_a_sweep.results | {"measured_again": 2}))
    before = kept.read_bytes()
    record(Runner("failed"))
    slower = record(lambda point: replace(Runner()(point), samples={"own": [0.2] * 3, "rtcIntersect1": [0.1] * 3}))
    assert kept.read_bytes() == before
    assert load_record(slower.parent, slower.stem).samples["own"] == [0.2] * 3


class Predicted:
    """Stands in for the model: a frame takes as many seconds as there are cells."""

    def __init__(self, look, choice, want, constants):
        assert (look, want) == ("a look", "nearest")
        self.frame_time_s = float(choice.cells)


@pytest.fixture
def predicted(monkeypatch):
    monkeypatch.setattr("experiments.law.skipping.look_at", lambda mesh, camera: "a look")
    monkeypatch.setattr("experiments.law.skipping.forecast", Predicted)


def test_points_predicted_to_be_slow_are_skipped_on_request_and_measured_when_they_are_wanted(tmp_path, predicted):
    runner = Runner()
    table = run_sweep(grid(tmp_path, 1, 2, 8, skip_slower=4.0), run=runner)
    assert sorted(runner.measured) == [(1, 0), (2, 0)]
    assert list(table["status"]) == ["ok", "ok", "skipped"]
    assert "8 times as long as the fastest of this view; sweep.skip_slower is 4" in table["error"][2]
    again = Runner()
    run_sweep(grid(tmp_path, 1, 2, 8), run=again)
    assert again.measured == [(8, 0)]
    assert list(run_sweep(grid(tmp_path, 1, 2, 8, skip_slower=4.0), run=Runner())["status"]) == ["ok"] * 3


def test_a_point_of_which_the_model_knows_nothing_is_not_skipped_and_a_limit_below_1_is_refused(tmp_path, predicted):
    one = configuration(tmp_path, method=Chosen(EMBREEX, EMBREEX.options()))
    one.sweep.skip_slower = 1.0
    planned = plan_points([one, *(each.configuration for each in grid(tmp_path, 1, 2, skip_slower=1.0))])
    assert ["predicted" in str(each.problem) for each in planned] == [False, False, True]
    with pytest.raises(InputError, match=r"sweep\.skip_slower is 0\.5"):
        run_sweep(grid(tmp_path, 1, skip_slower=0.5), run=Runner())
