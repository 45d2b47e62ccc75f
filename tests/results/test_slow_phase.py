"""A slow phase during half of a sweep, recorded: it may leave open what was decided, and never turn it around.

`tests/data/slow_phase.json`, in the order of a table: the built-in Cornell box, 512 x 512 pixels, one thread, `aligned`
with culling at 1, 16 and 128 cells, five rounds in each of six processes, the points in turn. During the last three
processes a burner filled arrays on the same core. Other work was on that core all the time, so each call was timed by
two clocks: that of the thread ("cpu"), which others do not move, stands for an idle machine, and the wall clock for the
slow phase.
"""

import json
from dataclasses import replace
from itertools import combinations

import numpy as np

from experiments.results import table as table_module
from experiments.results.statistics import Estimate
from experiments.results.table import make_tables
from tests.folders import ROOT
from tests.results.test_table import MEASURED

RECORDED = json.loads((ROOT / "tests" / "data" / "slow_phase.json").read_text(encoding="utf-8"))
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
