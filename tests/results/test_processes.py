"""Processes as the unit of repetition: what they share, and who is left out."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.configuration import MeasureConfiguration
from experiments.harness.records import Record
from experiments.results.canary import BAND, drifted
from experiments.results.table import make_tables
from tests.results.test_table import MEASURED


def in_process(number, factor=1.0, canary=1.0):
    """`MEASURED` with its own method slower by a factor, and its baseline by another."""
    samples = {"own": [factor], "rtcIntersect1": [8.0 * canary], "packets_8": [4.0]}
    return replace(
        MEASURED, point_id=f"p{number}", configuration=MEASURED.configuration | {"process": number}, samples=samples
    )


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
