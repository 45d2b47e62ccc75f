"""Processes as the unit of repetition: what they share, who is left out, and what a slow phase can do to a verdict."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.configuration import MeasureConfiguration
from experiments.harness.points import GridPoint
from experiments.harness.records import Record
from experiments.results.processes import BAND, drifted
from experiments.results.table import make_tables
from experiments.sweep import run_sweep
from tests.harness.test_passes import Unsteady
from tests.harness.test_sweep import Runner, configuration
from tests.results.test_table import MEASURED

pytestmark = pytest.mark.usefixtures("figures_unsaved")


def points(folder, *splits, processes=3, **fields):
    measure = MeasureConfiguration(processes=processes)
    return [GridPoint("a", replace(configuration(folder, split_x=one, **fields), measure=measure)) for one in splits]


def in_process(number, factor=1.0, canary=1.0):
    """`MEASURED` with its own method slower by a factor, and its baseline by another."""
    samples = {"own": [factor], "rtcIntersect1": [8.0 * canary], "packets_8": [4.0]}
    return replace(
        MEASURED, point_id=f"p{number}", configuration=MEASURED.configuration | {"process": number}, samples=samples
    )


def test_every_point_has_its_first_process_before_any_has_its_second(tmp_path):
    runner = Runner()
    table = run_sweep(points(tmp_path, 1, 2, 4, 8), run=runner)
    assert [point.process for point in runner.points] == [0] * 4 + [1] * 4 + [2] * 4
    assert {point.options.split_x for point in runner.points[:4]} == {1, 2, 4, 8}
    assert list(table["processes"]) == [3, 3, 3, 3]
    assert len(pd.read_parquet(tmp_path / "one" / "processes.parquet")) == 12


def test_more_processes_keep_those_that_were_measured(tmp_path):
    run_sweep(points(tmp_path, 1), run=Runner())
    runner = Runner()
    assert run_sweep(points(tmp_path, 1, processes=5), run=runner)["processes"][0] == 5
    assert [point.process for point in runner.points] == [3, 4]


def test_what_is_counted_and_not_timed_is_measured_once(tmp_path):
    runner = Runner()
    run_sweep(points(tmp_path, 1, workload="memory"), run=runner)
    assert len(runner.points) == 1


@pytest.mark.parametrize(("name", "value"), [("processes", 0), ("process", -1)])
def test_impossible_numbers_of_processes_are_refused(name, value):
    with pytest.raises(InputError, match=f"measure.{name} is {value}"):
        MeasureConfiguration(**{name: value})


def test_the_row_of_a_point_has_the_mean_of_its_processes_and_an_interval_that_two_have_wider():
    three = [in_process(number, factor) for number, factor in enumerate((1.0, 2.0, 4.0))]
    row = make_tables(three).points.iloc[0]
    assert (row["render_time_s"], row["speedup"]) == pytest.approx((2.0, 4.0))
    assert row["render_time_low_s"] == pytest.approx(2 ** (1 - 4.302653 / np.sqrt(3)), rel=1e-5)
    assert (row["point_id"], row["processes"], row["processes_left_out"]) == ("p0", 3, 0)
    two = make_tables(three[:2])
    assert two.points["render_time_low_s"].iloc[0] < row["render_time_low_s"]
    assert make_tables(three[:1]).points[["render_time_low_s", "speedup_high"]].iloc[0].isna().all()
    assert list(two.processes["render_time_s"]) == [1.0, 2.0]
    assert set(two.processes["point_id"]) == {"p0"}


def test_one_failed_process_makes_the_point_a_failed_one():
    failed = Record("p1", "failed", "killed", in_process(1).configuration, MEASURED.environment)
    row = make_tables([in_process(0), failed, in_process(2)]).points.iloc[0]
    assert (row["status"], row["error"]) == ("failed", "killed")
    assert pd.isna(row["render_time_s"])


def test_a_process_in_which_the_machine_was_not_as_it_mostly_was_is_left_out():
    usual = [in_process(number, canary=1 + 0.01 * number) for number in range(4)]
    strange = in_process(4, factor=3.0, canary=1.2)
    assert drifted([*usual, strange]) == {"p4"}
    tables = make_tables([*usual, strange])
    row = tables.points.iloc[0]
    assert (row["processes"], row["processes_left_out"], row["render_time_s"]) == (4, 1, 1.0)
    assert list(tables.processes["status"]) == ["ok"] * 4 + ["unsteady"]
    assert f"more than {BAND:.0%} off the median" in tables.processes["error"][4]
    assert drifted([*usual[:2], strange]) == set()  # too few to say who is unusual


def test_a_point_all_of_whose_processes_are_left_out_is_not_measured():
    others = [
        replace(
            in_process(number), point_id=f"q{number}", configuration=in_process(number).configuration | {"rounds": 9}
        )
        for number in range(9)
    ]
    row = make_tables([in_process(number, canary=2.0) for number in range(3)] + others).points.iloc[0]
    assert (row["status"], row["processes_left_out"]) == ("unsteady", 3)


def test_what_strays_is_replaced_at_the_end_three_times_at_most(tmp_path):
    runner = Unsteady()
    table = run_sweep(points(tmp_path, 1, 2), run=runner)
    assert [(point.options.split_x, point.process) for point in runner.points[6:]] == [(2, 1)] * 3
    assert list(table["processes_left_out"]) == [0, 1]
    assert list(table["processes_replaced"]) == [0, 1]
    again = Unsteady()
    run_sweep(points(tmp_path, 1, 2), run=again)
    assert again.points == []


class Disturbed(Runner):
    """One process scatters the first time it runs."""

    def __call__(self, point):
        outcome = super().__call__(point)
        first = not any(one == point for one in self.points[:-1])
        unsteady = first and point.process == 1 and point.options.split_x == 2
        samples = outcome.samples | {"own": [0.05, 0.1, 0.2]} if unsteady else outcome.samples
        return replace(outcome, samples=samples)


def test_a_disturbed_process_is_replaced_until_one_is_steady(tmp_path):
    runner = Disturbed()
    table = run_sweep(points(tmp_path, 1, 2, processes=5), run=runner)
    assert [(point.options.split_x, point.process) for point in runner.points[10:]] == [(2, 1)]
    assert list(table["processes_replaced"]) == [0, 1]
    assert list(table["warnings"]) == ["3 of 5 rounds"] * 2  # of no disturbance


def test_a_quick_look_with_few_processes_keeps_what_was_disturbed_and_its_warning(tmp_path):
    runner = Disturbed()
    table = run_sweep(points(tmp_path, 1, 2, processes=4), run=runner)
    assert len(runner.points) == 8
    assert "spread is" in table["warnings"][1]


@pytest.mark.parametrize(("others", "looks"), [(0.02, 1), (0.05, 1), (0.06, 3), (None, 3)])
def test_a_sweep_looks_for_an_idle_machine_at_first_and_after_a_process_that_was_not_idle(
    tmp_path, monkeypatch, others, looks
):
    """The same share of the cores is too much as makes a warning, however many cores there are."""

    class Shared(Runner):
        def __call__(self, point):
            outcome = super().__call__(point)
            return replace(outcome, results=outcome.results | {"others_share": others})

    seen = []
    monkeypatch.setattr("experiments.sweep.Waiting.for_idle", lambda self: seen.append(self))
    monkeypatch.setattr("experiments.results.time_warnings.cores_of", lambda record: 8)
    run_sweep(points(tmp_path, 1), run=Shared())
    assert len(seen) == looks
