"""What methods cost over many frames, by hand; times are powers of two, so that float64 holds them exactly."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from experiments.results.statistics import best_of
from experiments.results.table import make_table
from experiments.workloads.frame.break_even import (
    Cost,
    baseline_costs,
    break_even_frames,
    cost_of,
    cumulative_time_s,
    time_rows,
)
from experiments.workloads.series import best_rows
from tests.drawn import make_rows, method_row, skipped
from tests.results.test_table import MEASURED

pytestmark = pytest.mark.uncovered

BASELINE = Cost("pixel", 0.0, 1.0, 4.0, 4.0)


def cost(once_s, first_s, frame_s):
    return Cost("aligned", once_s / 2, once_s / 2, first_s, frame_s)


def test_cumulative_time_is_plan_build_first_frame_and_then_the_further_frames():
    total_s = cumulative_time_s(Cost("tiles", 1.0, 2.0, 8.0, 0.5), np.array([1, 2, 3, 1000]))
    np.testing.assert_array_equal(total_s, [11, 11.5, 12, 510.5])


@pytest.mark.parametrize(("once_s", "first_s", "frame_s", "expected"), [
    (0.5, 4.0, 4.0, 1),  # cheaper to set up, never overtaken
    (1.0, 4.0, 2.0, 2),  # level after the first frame, ahead after the second
    (3.0, 4.0, 2.0, 3),  # level after the second frame
    (1.0, 11.0, 2.0, 5),  # a slow first frame counts as well: 7 s behind
    (1.0, 4.0, 4.0, None),  # as dear to the last frame
    (0.5, 1.0, 4.5, None),  # leads for a while, and then no more
])  # fmt: skip
def test_break_even_is_the_first_frame_from_which_on_the_time_in_all_is_less(once_s, first_s, frame_s, expected):
    candidate = cost(once_s, first_s, frame_s)
    assert break_even_frames(candidate, [BASELINE]) == expected
    frames = np.arange(1, 200)
    ahead = cumulative_time_s(candidate, frames) < cumulative_time_s(BASELINE, frames)
    assert not ahead[-1] if expected is None else (ahead == (frames >= expected)).all()


def test_the_best_row_has_the_largest_ratio_not_the_shortest_time_and_is_the_first_of_equals():
    table = make_rows(
        method_row("aligned", 64, time_s=0.01, ratio=1.5),
        method_row("aligned", 128, time_s=0.02, ratio=2.5),
        method_row("aligned", 256, time_s=0.03, ratio=2.5),
    )
    assert best_rows(pd.concat([table, table]))["split_x"].tolist() == [128]  # whatever the index of the table


def test_single_rays_are_held_against_single_rays_and_all_else_against_packets():
    ratios = [{"speedup": 2.0, "speedup_vs_packets": 4.0}, {"speedup": 3.0, "speedup_vs_packets": 1.0}]
    single, packets = (
        make_rows(*(method_row("aligned", split, packet_width=width) | one for split, one in enumerate(ratios, 1)))
        for width in (1, 8)
    )
    assert (best_rows(single)["split_x"].tolist(), best_rows(packets)["split_x"].tolist()) == ([2], [1])


def test_the_best_is_chosen_by_the_processes_that_choose_it_in_the_claims():
    processes = {64: [2.0, 2.0, 9.0, 9.0, 9.0], 128: [3.0, 3.0, 1.0, 1.0, 1.0]}
    records = [
        ran(split, process, value) for split, values in processes.items() for process, value in enumerate(values)
    ]
    (row,) = best_rows(make_table(records)).to_dict("records")
    assert row["split_x"] == best_of(processes)[0] == 128


def ran(split_x, process, ratio):
    """Packets take so many times as long as the point's own method."""
    options = MEASURED.configuration["method_options"] | {"split_x": split_x, "packet_width": 8}
    configuration = MEASURED.configuration | {"method_options": options, "process": process}
    samples = {"own": [1.0], "rtcIntersect1": [8.0 * ratio], "packets_8": [ratio]}
    return replace(MEASURED, point_id=f"{split_x}-{process}", configuration=configuration, samples=samples)


def test_another_scene_method_width_or_thread_count_has_its_own_best_row():
    rows = [method_row("aligned", 64, 0.03, ratio=2.0), method_row("aligned", 32, 0.02, ratio=3.0)]
    others = {"scene": "b", "method": "tiles", "packet_width": 1, "threads": 2, "width": 16, "build_quality": "high"}
    table = make_rows(*rows, *(row | {name: value} for name, value in others.items() for row in rows))
    assert best_rows(table)["split_x"].tolist() == [32] * 7


def test_points_without_a_ratio_or_of_another_workload_are_no_best_row():
    good = method_row("aligned", 64, ratio=2.0)
    table = make_rows(
        skipped(method_row("aligned", 128, ratio=9.0)),
        method_row("aligned", 128, ratio=9.0, workload="memory"),
        method_row("aligned", 256, ratio=pd.NA),
        good,
    )
    assert best_rows(time_rows(table))["split_x"].tolist() == [64]
    assert len(time_rows(table)) == 3
    assert len(best_rows(table.iloc[:0])) == 0


def test_the_price_of_a_row_is_its_columns_and_missing_ones_leave_no_price():
    row = method_row("visible_first", 64, time_s=0.5, plan_time_s=0.25, build_time_s=0.125, first_frame_time_s=2.0)
    table = make_rows(row, row | {"first_frame_time_s": None}, row | {"plan_time_s": None, "embree_bytes": None})
    expected = Cost("visible_first", 0.25, 0.125, 2.0, 0.5, 3000, 0.05)
    assert [cost_of(one) for _, one in table.iterrows()] == [expected, None, None]


def test_packets_have_a_baseline_of_each_build_quality_the_usual_one_first():
    single = method_row("pixel", 1, time_s=0.1, packet_width=1)
    rows = [
        method_row("pixel", 1, time_s=0.5, own_build_quality="low", plan_time_s=None, build_time_s=0.25),
        method_row("pixel", 1, time_s=0.25, build_time_s=0.5),
        method_row("pixel", 1, time_s=0.125, plan_time_s=None, build_time_s=0.5, packet_width=16),
    ]
    costs = baseline_costs(make_rows(method_row("aligned", 64), single, *rows))
    assert [(name, one.plan_time_s, one.build_time_s, one.frame_time_s) for name, one in costs.items()] == [
        ("same", 0.0, 0.5, 0.125), ("low", 0.0, 0.25, 0.5),
    ]  # fmt: skip
    assert baseline_costs(make_rows(method_row("aligned", 64), single)) == {}


def test_break_even_is_with_whichever_build_of_packets_is_cheapest_so_far():
    cheap = Cost("pixel", 0.0, 0.0, 4.0, 5.0)  # of low quality: ahead for the first frame alone
    candidate = cost(2.0, 4.0, 3.5)
    assert break_even_frames(candidate, [BASELINE]) == 4  # 1 s behind, 0.5 s gained a frame
    assert break_even_frames(candidate, [cheap]) == 3  # 2 s behind, 1.5 s gained
    assert break_even_frames(candidate, [BASELINE, cheap]) == 4
    assert break_even_frames(cost(1.0, 4.0, 4.5), [BASELINE, cheap]) is None


def test_a_baseline_frame_is_carried_over_by_the_packets_that_both_were_timed_with():
    slow_moment = Cost("aligned", 4.0, 4.0, 4.0, 3.0, None, packets_frame_time_s=8.0)
    timed = Cost("pixel", 0.0, 1.0, 4.0, 4.0, None, packets_frame_time_s=4.0)
    assert break_even_frames(slow_moment, [timed]) == 3  # 7 s behind, 5 s gained a frame; 1 s a frame would need 9
    assert break_even_frames(slow_moment, [BASELINE]) == 9  # whose rounds had none
