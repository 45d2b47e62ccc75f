"""The best ray packets: chosen in some processes, told by the others, and no more than noise says nothing."""

import pytest

from experiments.drawing.style import TIMES
from experiments.workloads.frame.shown import best_baselines, process_lines
from tests.drawn import make_rows, method_row

pytestmark = pytest.mark.uncovered

NOISE = (0.99, 1.01, 1.0, 1.005, 0.995, 1.0)


def rows_of(name, ratios, **fields):
    return [
        method_row("pixel", ratio=ratio, point_id=name, packet_width=16, coherent=True, process=place) | fields
        for place, ratio in enumerate(ratios)
    ]


def table(*rows):
    return make_rows(*(one for several in rows for one in several))


def test_the_fastest_of_a_scene_is_told_with_its_margin():
    usual, wide = rows_of("usual", NOISE), rows_of("wide", tuple(1.1 * one for one in NOISE), packet_rows="2")
    others = [rows_of(name, NOISE, scene="flat", packet_rows=rows) for name, rows in (("a", "1"), ("b", "automatic"))]
    best, flat = best_baselines(table(usual, wide, *others))
    assert (best.scene, best.name, best.tried) == ("box", f"packets of 16 per pixel, 8 {TIMES} 2 pixels", 2)
    assert best.margin.value == pytest.approx(1.1, rel=0.01)
    assert best.is_faster
    assert not flat.is_faster


def test_what_stood_out_in_the_processes_that_chose_it_alone_is_noise():
    lucky = rows_of("lucky", (1.3, 1.3, 1.3, 1.0, 1.01, 0.99), coherent=False)
    lines = list(process_lines(table(rows_of("usual", NOISE), lucky)))
    assert "incoherent, 1.00 [0.98, 1.03] times as fast as the usual packets (no more than noise)" in lines[0]
    assert lines[1] == "nowhere are ray packets faster than the usual ones by more than noise"


def test_too_few_processes_decide_nothing_and_the_usual_packets_alone_leave_no_choice():
    rows = table(rows_of("usual", (1.0, 1.0)), rows_of("robust", (1.2, 1.2), robust=True))
    assert list(process_lines(rows)) == ["best of 2 ray packets, box: packets of 16 per pixel, robust (not decided)"]
    single = [row | {"packet_width": 1} for row in rows_of("single", NOISE)]
    assert not list(best_baselines(table(rows_of("usual", NOISE), single)))
