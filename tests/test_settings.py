"""Points that differ in a setting never look alike: not in the table, a figure, the page or the terminal."""

from __future__ import annotations

import io
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from experiments.harness.point import Point
from experiments.harness.records import Record
from experiments.report.columns import IDENTITY, views_of
from experiments.results.settings import SETTINGS, settings_that_vary
from experiments.results.table import COLUMNS, make_table
from experiments.results.terminal import print_sweep
from experiments.workloads.build.build_figure import draw_build_figure
from experiments.workloads.frame.grid_figure import draw_grid_figure
from experiments.workloads.frame.split_figure import draw_split_figure
from experiments.workloads.memory.memory_figure import draw_memory_figure
from tests.test_figures import build_row, make_rows, memory_row, time_row
from tests.test_table import MEASURED

OTHERWISE_TOLD = {"scene", "triangles", "method", "quantity", "scene_source", "scene_path"}
EFFORT = {
    "rounds", "warmup", "frame_budget_s", "time_limit_s", "memory_budget_gib", "offsets", "sample_rays",
}  # fmt: skip

# Two values of each setting, as a record's configuration holds them, and the second one in words.
VALUES: dict[str, tuple[Any, Any, str]] = {
    "mesh_sha256": ("ab" * 32, "cd" * 32, "mesh cdcdcdcd"),
    "view": ("own", "turned", "view turned"),
    "eye": ([0.0, 1.0, 3.0], [0.0, 1.5, 3.0], "eye 0, 1.5, 3"),
    "target": ([0.0, 1.0, 0.0], [0.0, 1.0, 1e-9], "target 0, 1, 1e-09"),
    "up": ([0.0, 1.0, 0.0], [0.0, 1.0, 1.0], "up 0, 1, 1"),
    "fov_y_degrees": (45.0, 60.0, "fov y degrees 60.0"),
    "width": (8, 16, "width 16"),
    "height": (4, 8, "height 8"),
    "motion": ("turn", "walk", "motion walk"),
    "frames": (2, 4, "frames 4"),
    "geometry": ("copied", "instanced", "instanced geometry"),
    "culling": (False, True, "culling on"),
    "split_x": (1, 2, "split x 2"),
    "split_y": (1, 2, "split y 2"),
    "packet_width": (1, 8, "packet width 8"),
    "packet_rows": (2, None, "packet rows automatic"),
    "threads": (1, 2, "threads 2"),
    "build_quality": ("high", "low", "low build quality"),
    "ties": ("any", "lowest", "ties lowest"),
}
every_setting = pytest.mark.parametrize("name", SETTINGS)


def records_that_differ_in(name: str) -> list[Record]:
    common = MEASURED.configuration | {key: first for key, (first, _, _) in VALUES.items()}
    common["motion"] = "walk" if name == "frames" else None
    ran = {key: value for key, value in MEASURED.results.items() if key != "packet_width"}
    return [
        replace(MEASURED, point_id=str(value), configuration=common | {name: value}, results=ran)
        for value in VALUES[name][:2]
    ]


def test_every_field_of_a_point_is_a_setting_or_told_otherwise_or_effort() -> None:
    assert {field.name for field in fields(Point)} - set(SETTINGS) == OTHERWISE_TOLD | EFFORT
    assert set(SETTINGS) < set(COLUMNS)


@every_setting
def test_two_points_that_differ_in_a_setting_differ_in_its_column(name: str) -> None:
    table = make_table(records_that_differ_in(name))
    assert settings_that_vary(table) == [name]
    assert settings_that_vary(table, besides=[name]) == []


@every_setting
def test_the_page_shows_a_setting_that_varies_in_every_view(name: str) -> None:
    for view in views_of(make_table(records_that_differ_in(name))):
        assert view.columns.count(name) == 1
    if name not in IDENTITY:
        frame_times, *_ = views_of(make_table(records_that_differ_in("split_x")))
        assert name not in frame_times.columns


@every_setting
def test_the_best_of_a_scene_is_told_for_each_value_of_a_setting_but_the_split(tmp_path: Path, name: str) -> None:
    shown = io.StringIO()
    print_sweep(make_table(records_that_differ_in(name)), tmp_path, Console(file=shown, width=200))
    rows = [line for line in shown.getvalue().splitlines() if "│ box" in line]
    assert len(rows) == (1 if name in ("split_x", "split_y") else 2)


# The figures tell these apart themselves: the abscissa, and a line for each.
@pytest.mark.parametrize("name", [name for name in SETTINGS if name not in ("split_x", "geometry", "culling")])
def test_no_figure_over_splits_draws_two_values_of_a_setting_as_one_line(name: str) -> None:
    values = make_table(records_that_differ_in(name))[name]
    cases = [
        (draw_split_figure, time_row(1, 0.08)),
        (draw_build_figure, build_row(1, 0.02, 0.04)),
        (draw_memory_figure, memory_row(1, 1, 2, 3)),
    ]
    if name != "split_y":
        cases.append((draw_grid_figure, time_row(1, 0.08)))
    for draw, row in cases:
        figure = draw(make_rows(*(row | {name: value} for value in values)))
        titles = {axis.get_title(loc="left") for axis in figure.axes} - {""}
        assert len(titles) == 2
        assert f"box (10 triangles), {VALUES[name][2]}" in titles


def test_another_view_is_not_told_again_by_its_eye() -> None:
    first, second = records_that_differ_in("view")
    second.configuration["eye"] = [9.0, 9.0, 9.0]
    assert settings_that_vary(make_table([first, second])) == ["view"]


def test_scenes_have_cameras_of_their_own() -> None:
    first, second = records_that_differ_in("eye")
    second.configuration["scene"] = "another"
    assert settings_that_vary(make_table([first, second])) == []
