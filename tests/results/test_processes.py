"""Processes as the unit of repetition: what they share, and who is left out."""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.configuration import MeasureConfiguration
from experiments.harness.records import Record
from experiments.results import table as table_module
from experiments.results.processes import BAND, drifted
from experiments.results.statistics import Estimate
from experiments.results.table import make_tables
from tests.folders import ROOT
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


RECORDED = json.loads((ROOT / "tests" / "data" / "slow_phase.json").read_text(encoding="utf-8"))
"""A slow phase during half of a sweep, in the order of a table: the built-in Cornell box, 512 x 512 pixels, one thread,
`aligned` with culling at 1, 16 and 128 cells, five rounds in each of six processes, the points in turn. During the last
three processes a burner filled arrays on the same core. Each call was timed by two clocks: that of the thread ("cpu"),
which others do not move, stands for an idle machine, and the wall clock for the slow phase."""
SPLITS = (1, 16, 128)
WIDEST = 1.5
"""Ends of an interval of a sweep half of whose processes are left out, upper over lower."""


def records(slow_phase):
    return [
        replace(
            MEASURED,
            point_id=f"{one['split_x']} {one['process']}",
            samples=one["wall" if slow_phase and one["burner"] else "cpu"],
            configuration=MEASURED.configuration
            | {"process": one["process"], "method_options": {"split_x": one["split_x"], "split_y": 1}},
        )
        for one in RECORDED
    ]


def judged(slow_phase):
    """Every gain over a baseline, and every split over another, as claims judge: a value of each process that is not
    left out."""
    rows = make_tables(records(slow_phase)).processes
    rows = rows[rows["status"] == "ok"]
    found = {
        f"{baseline} at {split}": Estimate.of(rows.loc[rows["split_x"] == split, baseline].tolist())
        for baseline in ("speedup", "speedup_vs_packets")
        for split in SPLITS
    }
    ratios = {
        f"{baseline}: {more} over {fewer}": found[f"{baseline} at {more}"].over(found[f"{baseline} at {fewer}"])
        for baseline in ("speedup", "speedup_vs_packets")
        for fewer, more in combinations(SPLITS, 2)
    }
    return found | ratios


def test_a_slow_phase_turns_no_verdict_around():
    quiet, slow = judged(slow_phase=False), judged(slow_phase=True)
    assert len(quiet) == 12
    # There is no limit that the one sweep says a ratio is above, and the other below.
    assert not [name for name, one in quiet.items() if one.high < slow[name].low or slow[name].high < one.low]


def test_the_slow_phase_is_left_out_and_the_rest_still_decides():
    tables = make_tables(records(slow_phase=True))
    left_out = tables.processes["status"].eq("unsteady")
    during = np.array([one["burner"] for one in RECORDED])
    assert left_out[during].mean() > 0.8
    assert left_out[~during].mean() < 0.2
    assert make_tables(records(slow_phase=False)).points["processes_left_out"].sum() <= 1
    for name, one in judged(slow_phase=True).items():
        assert one.high / one.low < WIDEST, name


def test_without_the_canary_little_would_be_decided(monkeypatch):
    monkeypatch.setattr(table_module, "drifted", lambda records: set())
    assert sum(one.high / one.low > WIDEST for one in judged(slow_phase=True).values()) >= 6
