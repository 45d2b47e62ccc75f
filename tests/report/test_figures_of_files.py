"""A method of a file, which has no splits, stands in the figures over splits; no figure is empty, or named so."""

from dataclasses import replace
from pathlib import Path

import pytest

from experiments.drawing.style import TIMES
from experiments.report.writing import GRID_OF_FILES, figures_of, most_telling
from experiments.workloads.frame.grid_figure import grid_ratios, grid_times
from experiments.workloads.frame_figures import split_ratios, split_times
from tests.drawn import level, line, make_rows, method_row, skipped, time_row, words

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
