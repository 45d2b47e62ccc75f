"""The figures that compare methods draw what the table says, on tables small enough to read."""

import pytest

from experiments import methods
from experiments.commands.new_method import run_new_method
from experiments.drawing.style import TIMES
from experiments.drawing.values import say_number
from experiments.workloads.frame_figures import methods_figure
from tests.drawn import bars, level, make_rows, method_row, skipped, whiskers, words

PIXEL = method_row("pixel", 1, 0.05, 1.0, plan_time_s=0.0, embree_bytes=2000, first_frame_time_s=0.06)


def test_the_methods_figure_draws_the_ratio_at_the_best_split_its_interval_the_time_and_both_baselines():
    table = make_rows(
        method_row("tiles", 4, 0.04, 1.25, split_y=4),
        method_row("aligned", 64, 0.01, 1.5),
        method_row("aligned", 128, 0.02, 2.5),
        method_row("aligned", 128, 0.08, 0.5, packet_width=1),
        PIXEL,
    )
    figure = methods_figure(table)
    (axis,) = figure.panels
    assert bars(axis) == {
        f"aligned, packets of 8, 128 {TIMES} 1": 2.5, f"aligned, single rays, 128 {TIMES} 1": 0.5,
        f"culled tiles, packets of 8, 4 {TIMES} 4": 1.25,
    }  # fmt: skip
    assert whiskers(axis) == [[1.75, 2.25]] * 3
    assert f"20.0 ms, 2.50{TIMES} [1.75, 2.25]" in words(figure)
    assert level(axis, "rtcIntersect1 per pixel") == 0.5
    assert level(axis, "fastest ray packets") == 1


@pytest.mark.usefixtures("methods_as_before")
def test_a_method_of_a_file_stands_beside_ours(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_new_method(["theirs"])
    methods.use_method_file("theirs.py")
    assert "theirs" in words(methods_figure(make_rows(method_row("theirs"), method_row("aligned", 2), PIXEL)))


def test_a_method_without_a_time_keeps_its_place_and_its_status():
    table = make_rows(skipped(method_row("tiles", 4, split_y=4)), method_row("aligned", 2))
    figure = methods_figure(table)
    assert list(bars(figure.panels[0])) == [f"aligned, packets of 8, 2 {TIMES} 1"]
    assert ("culled tiles, packets of 8", "skipped") in figure.panels[0].told_rows


def test_wrong_pixels_are_told_beside_the_panel():
    assert "1,234 pixels wrong" in words(methods_figure(make_rows(method_row("aligned", 2, pixels_wrong=1234))))
    assert "wrong" not in words(methods_figure(make_rows(method_row("aligned", 2))))


def test_the_methods_figure_has_a_bar_for_every_tracer_and_the_status_of_one_that_is_missing():
    rows = [
        method_row("embreex", 1, 0.2, 0.25, packet_width=None),
        method_row("aligned", 128, 0.02, 2.5),
        skipped(method_row("open3d"), "open3d is not installed; pip install open3d, and Debian's libusb-1.0-0, libgl1"),
    ]
    figure = methods_figure(make_rows(*rows))
    assert bars(figure.panels[0]) == {f"aligned, packets of 8, 128 {TIMES} 1": 2.5, "embreex": 0.25}
    assert ("Open3D", "skipped") in figure.panels[0].told_rows


def test_numbers_are_said_with_three_digits():
    said = [say_number(value) for value in (0, 0.0123, 9.999, 34, 99.96, 1234.5)]
    assert said == ["0", "0.0123", "10.0", "34.0", "100", "1,234"]
