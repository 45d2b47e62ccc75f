"""Methods in figures: each has its bar or its level, a method of a file too, and what is missing has its reason."""

from dataclasses import replace
from pathlib import Path

import pytest

from experiments import methods
from experiments.commands.new_method import run_new_method
from experiments.drawing.style import TIMES
from experiments.drawing.values import say_number
from experiments.report.writing import GRID_OF_FILES, figures_of, most_telling
from experiments.workloads.frame.grid_figure import grid_ratios, grid_times
from experiments.workloads.frame_figures import methods_figure, split_ratios, split_times
from tests.drawn import bars, level, line, make_rows, method_row, skipped, time_row, whiskers, words

pytestmark = pytest.mark.usefixtures("figures_unsaved")


FIGURE5 = {"figure5": ["horizontal"]}


def of_grid(name, *rows):
    return [row | {"grids": name} for row in rows]


def theirs(**fields):
    """A row of an external program, which tells no width of packets."""
    return method_row("program", None, 0.03, 0.75, split_y=None, packet_width=0, **fields)


def splits(**fields):
    return time_row(1, 0.08, **fields), time_row(16, 0.02, **fields)


def drawn(*rows, figures=None):
    """The figures of rows, by name."""
    return {one.name: one.figure for one in figures_of(make_rows(*rows), Path(), figures)}


def labels(panel):
    return [one.label for one in panel.levels]


def test_over_splits_it_is_a_level_for_comparison_in_time_and_in_speed_up():
    rows = make_rows(*splits(), theirs())
    times, ratios = split_times(rows), split_ratios(rows)
    assert level(times.panels[0], "program") == 30.0
    assert level(ratios.panels[0], "program") == 0.75
    assert "program: 30.0 ms" in words(times)
    assert f"program: 30.0 ms, 0.75{TIMES}" in words(ratios)
    for figure in (times, ratios):
        assert "program" in figure.legend
        assert len(figure.panels) == 1


def test_its_level_stands_in_the_panel_of_its_scene_alone():
    table = make_rows(*splits(), *splits(scene="hall"), theirs(scene="hall"))
    box, hall = split_times(table).panels
    assert "program" not in labels(box)
    assert level(hall, "program") == 30.0


def test_one_with_a_wrong_image_has_no_level():
    wrong = {"status": "wrong", "error": "4,096 of 4,096 pixels wrong", "pixels_wrong": 4096}
    figure = split_times(make_rows(*splits(), theirs() | wrong))
    assert "program" not in labels(figure.panels[0])


def test_maps_of_both_axes_tell_it_below():
    rows = make_rows(*(time_row(x, 0.02, split_y=y) for x in (1, 2) for y in (1, 2)), theirs())
    assert "program: 30.0 ms" in words(grid_times(rows))
    assert f"program: 30.0 ms, 0.75{TIMES}" in words(grid_ratios(rows))


@pytest.mark.parametrize("figures", [None, FIGURE5])
def test_there_is_no_figure_of_packets_of_0(figures):
    found = drawn(*of_grid("horizontal", *splits()), *of_grid(GRID_OF_FILES, theirs()), figures=figures)
    assert not [name for name in found if "packets_of" in name]
    assert level(found["figure5"].panels[0], "program") == 30.0


def test_where_packets_of_two_widths_have_a_figure_each_it_stands_in_both():
    rows = of_grid("horizontal", *splits(packet_width=8), *splits(packet_width=16))
    found = drawn(*rows, *of_grid(GRID_OF_FILES, theirs()), figures=FIGURE5)
    assert list(found) == ["figure5_packets_of_8", "figure5_packets_of_16"]
    for figure in found.values():
        assert level(figure.panels[0], "program") == 30.0
        assert set(line(figure.panels[0], "aligned, culling on")) == {1, 16}


def test_a_figure_with_nothing_to_show_is_not_drawn():
    failed = [skipped(one) for one in splits()]
    alone = of_grid(GRID_OF_FILES, theirs(scene="hall"))
    assert drawn(*alone, figures=FIGURE5) == {}
    assert drawn(*of_grid("horizontal", *failed), *alone, figures=FIGURE5) == {}
    assert split_times(make_rows(*failed)).is_empty


def test_the_figure_to_open_first_shows_the_method():
    rows = *of_grid("horizontal", *splits()), *of_grid("vertical", *splits()), *of_grid(GRID_OF_FILES, theirs())
    table = make_rows(*rows)
    first, *others = figures_of(table, Path(), FIGURE5)
    without = replace(first, figure=split_times(make_rows(*splits())))
    assert most_telling([without, first, *others], table) is first
    assert most_telling([without], table) is without
    assert most_telling([without, first], make_rows(*splits())) is without
    assert most_telling([], table) is None


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


def test_wrong_pixels_are_told_beside_the_panel_and_numbers_with_three_digits():
    said = [say_number(value) for value in (0, 0.0123, 9.999, 34, 99.96, 1234.5)]
    assert said == ["0", "0.0123", "10.0", "34.0", "100", "1,234"]
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
