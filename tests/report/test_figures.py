"""Figures draw what the table says, on tables small enough to read."""

from itertools import pairwise
from pathlib import Path

import pandas as pd
import pytest
from matplotlib.axis import Tick
from matplotlib.text import Text

from atra.errors import InputError
from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.provenance import how_measured, provenance
from experiments.drawing.render import draw as drawn
from experiments.drawing.style import BLACK, PANEL_INCHES, SMALL, TIMES
from experiments.harness.configuration import Configuration, SweepConfiguration
from experiments.harness.points import GridPoint
from experiments.paper.figures import instancing_figure
from experiments.report.writing import GRID_OF_FILES, figures_of
from experiments.sweep import run_sweep
from experiments.workloads.build.shown import build_figure
from experiments.workloads.frame.grid_figure import grid_ratios, grid_times
from experiments.workloads.frame_figures import methods_figure, split_ratios, split_times
from experiments.workloads.memory.shown import memory_figure
from tests.drawn import (
    MIB,
    build_row,
    crosses,
    level,
    line,
    make_rows,
    memory_row,
    method_row,
    save,
    skipped,
    time_row,
    unfolded,
    words,
)


@pytest.mark.parametrize(("axis_name", "said"), [("split_x", "horizontal splits"), ("split_y", "vertical splits")])
def test_the_axis_of_splits_says_which_way_they_run(axis_name, said):
    rows = [time_row(1, time_s) | {axis_name: split} for split, time_s in ((1, 0.08), (2, 0.02))]
    figure = split_times(make_rows(*rows), axis_name=axis_name)
    assert figure.x.label == said
    assert line(figure.panels[0], "aligned, culling on") == {1: 80, 2: 20}


def test_processes_left_out_are_said_beside_the_figure():
    unsteady = time_row(2, 0.1) | {"status": "unsteady", "error": "too noisy", "processes_left_out": 3}
    figure = split_times(make_rows(time_row(1, 0.1, processes_left_out=1), unsteady))
    assert "4 processes left out as unsteady" in unfolded(figure)
    assert "culling on, 2: unsteady, too noisy" in unfolded(figure)


FROM = " (from 1 MiB on)"


def test_the_build_figure_draws_plan_and_build_of_copies_and_the_build_of_instances():
    instanced = build_row(2, 0.001, 0.003, geometry="instanced", culling=False)
    table = make_rows(build_row(1, 0.002, 0.005), build_row(2, 0.003, 0.007), instanced, skipped(build_row(4, 0, 0)))
    figure = build_figure(table)
    (axis,) = figure.panels
    assert line(axis, "BVH build, culling on") == {1: 5, 2: 7}
    assert line(axis, "plan (culling and shear), culling on") == {1: 2, 2: 3}
    assert line(axis, "BVH build, instanced") == {2: 3}
    assert level(axis, "BVH build for per-pixel rays") == pytest.approx(4)
    assert crosses(axis) == {4}
    assert "culling on, 4: skipped, needs more memory than its budget" in unfolded(figure)


def test_the_memory_figure_takes_the_mesh_off_and_draws_the_pixel_rows_as_baselines():
    table = make_rows(
        memory_row(1, 100, 110, 130),
        memory_row(2, 101, 121, 141),
        memory_row(1, 100, 105, 106, method="pixel", culling=False),
        memory_row(1, 100, 900, 900, culling=False),
        skipped(memory_row(4, 0, 0, 0)),
    )
    figure = memory_figure(table)
    (axis,) = figure.panels
    assert line(axis, f"RSS over the mesh, after the build{FROM}") == {1: 10, 2: 20}
    assert line(axis, f"peak of RSS over the mesh{FROM}") == {1: 30, 2: 40}
    assert line(axis, "Embree's own account") == {1: 3, 2: 6}
    assert {5.0, 6.0, 3.0} == {one.value for one in axis.levels}
    assert crosses(axis) == {4}


def test_rss_is_drawn_where_it_grew_by_more_than_the_noise_of_pages_and_embree_s_bytes_everywhere():
    figure = memory_figure(make_rows(memory_row(1, 100, 100, 130), memory_row(2, 100, 110, 130)))
    (axis,) = figure.panels
    assert line(axis, f"RSS over the mesh, after the build{FROM}") == {2: 10}
    assert line(axis, "Embree's own account") == {1: 3, 2: 6}
    assert f"RSS over the mesh, after the build{FROM}" in figure.legend


def test_a_failure_is_told_in_its_own_words_and_a_long_list_of_points_by_its_ends():
    rows = [skipped(memory_row(2**k, 0, 0, 0)) | {"status": "failed", "error": "memory ran out"} for k in range(7)]
    figure = memory_figure(make_rows(*rows))
    assert "culling on, 1 to 64 (7 points): failed, memory ran out" in words(figure)
    assert crosses(figure.panels[0]) == {1, 2, 4, 8, 16, 32, 64}


def test_the_instancing_figure_sets_embree_s_bytes_beside_the_speed_up_at_the_width_of_the_instances():
    table = make_rows(
        memory_row(2, 100, 110, 110),
        memory_row(2, 100, 150, 150, culling=False, embree_bytes=9 * MIB),
        memory_row(2, 100, 102, 102, culling=False, geometry="instanced", embree_bytes=MIB),
        memory_row(1, 100, 101, 101, culling=False, method="pixel"),
        time_row(2, 0.02),
        time_row(2, 0.03, culling=False, ratio=1.5),
        time_row(2, 0.04, culling=False, geometry="instanced", ratio=0.5),
        time_row(2, 0.5, packet_width=1),
    )
    memory, speed = instancing_figure(table).panels
    assert line(memory, "aligned, culling on") == {2: 6}
    assert line(memory, "aligned, culling off") == {2: 9}
    assert line(memory, "aligned, instanced") == {2: 1}
    assert level(memory, "one ray per pixel (memory)") == pytest.approx(3)
    assert line(speed, "aligned, culling on") == {2: 2}
    assert line(speed, "aligned, culling off") == {2: 1.5}
    assert line(speed, "aligned, instanced") == {2: 0.5}


def drawn_names(*rows, grids=None):
    return [figure.name for figure in figures_of(make_rows(*rows), Path(), grids)]


FIGURE5 = ["figure5", "figure5_speedup"]
SPLITS = [time_row(split, 0.01 * split) for split in (1, 2)]
INSTANCED = memory_row(2, 100, 102, 102, culling=False, geometry="instanced")


@pytest.mark.parametrize(("rows", "expected"), [
    (SPLITS, FIGURE5),
    (
        [*SPLITS, *(row | {"packet_width": 1} for row in SPLITS)],
        [f"{name}_{rays}" for name in FIGURE5 for rays in ("single_rays", "packets_of_8")],
    ),
    (
        [row | {"split_x": 1, "split_y": row["split_x"]} for row in SPLITS],
        ["figure5_vertical", "figure5_vertical_speedup"],
    ),
    ([*SPLITS, time_row(1, 0.01, split_y=2)], ["figure4", "figure4_speedup"]),
    ([*SPLITS, build_row(1, 0.1, 0.2), memory_row(1, 1, 2, 3)], [*FIGURE5, "figure6", "figure7"]),
    ([*SPLITS, INSTANCED], [*FIGURE5, "figure7_instancing"]),
    ([time_row(2, 0.01), time_row(2, 0.01, method="tiles")], ["methods"]),
    ([time_row(2, 0.01), time_row(1, 0.01, method="embreex")], ["methods"]),
    ([time_row(2, 0.01)], []),
    ([skipped(row) for row in SPLITS], []),
    ([], []),
])  # fmt: skip
def test_without_grids_a_table_draws_every_figure_that_has_something_to_show(rows, expected):
    assert drawn_names(*rows) == expected


def test_a_sweep_that_names_figures_draws_these_of_the_points_of_their_grids_alone():
    rows = [row | {"grids": "horizontal"} for row in SPLITS] + [build_row(1, 0.1, 0.2, grids="build")]
    assert drawn_names(*rows, grids={"figure5": ["horizontal"], "figure7": ["memory"]}) == ["figure5"]
    assert drawn_names(*rows, grids={"figure6": ["build", "none"]}) == ["figure6"]


def test_the_methods_of_files_stand_in_every_figure_of_their_sweep():
    rows = [time_row(split, 0.1, grids=grid) for split, grid in ((1, "one"), (2, GRID_OF_FILES), (4, "other"))]
    (figure,) = figures_of(table := make_rows(*rows), Path(), {"figure5": ["one"]})
    assert figure.point_ids == set(table["point_id"][:2])


def test_a_figure_of_one_packet_width_holds_the_points_of_that_width():
    table = make_rows(*SPLITS, *(row | {"packet_width": 1} for row in SPLITS))
    single, packets, *_ = figures_of(table, Path())
    assert (single.point_ids, packets.point_ids) == (set(table["point_id"][2:]), set(table["point_id"][:2]))


@pytest.mark.parametrize(("figures", "message"), [
    ({"figure9": ["horizontal"]}, "sweep.figures names 'figure9', expected one of figure4, figure4_speed"),
    ({"figure5": ["vertical"]}, "sweep.figures.figure5 names 'vertical', expected one of horizontal"),
])  # fmt: skip
def test_an_unknown_figure_or_grid_is_refused_with_the_known_names_before_anything_is_measured(
    tmp_path, figures, message
):
    sweep = SweepConfiguration(figures=figures)
    with pytest.raises(InputError, match=message):
        run_sweep([GridPoint("horizontal", Configuration(sweep=sweep, results_dir=str(tmp_path)))])
    assert list(tmp_path.iterdir()) == []


ONE_ROW = {
    "split, times": (split_times, time_row(1, 0.08)),
    "split, ratios": (split_ratios, time_row(1, 0.08)),
    "grid, times": (grid_times, time_row(1, 0.08)),
    "grid, ratios": (grid_ratios, time_row(1, 0.08)),
    "build": (build_figure, build_row(1, 0.002, 0.005)),
    "memory": (memory_figure, memory_row(1, 100, 110, 130)),
    "instancing, memory": (instancing_figure, memory_row(1, 100, 110, 130)),
    "instancing, time": (instancing_figure, time_row(1, 0.08)),
    "methods": (methods_figure, method_row("visible_first", 4)),
}
LEFT = ["scene", "status", "method", "split_x", "split_y", "culling", "workload", "width", "height", "triangles"]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if place % 3 else ()) for place, name in enumerate(ONE_ROW)]
)
def test_every_figure_copes_with_one_row_with_none_and_with_a_row_of_missing_values(name):
    make, row = ONE_ROW[name]
    one = make_rows(row)
    missing = one.copy()
    missing[[name for name in one if name not in LEFT]] = pd.NA
    without = make_rows(skipped(row), skipped(row | {"threads": None, "packet_width": None}))
    older = one.drop(columns=["first_frame_time_s", "stands_for", "grids"])
    for table in (one, one.iloc[:0], missing, without, older, pd.concat([one, missing, without])):
        save(make(table))


@pytest.mark.slow
@pytest.mark.parametrize("name", ONE_ROW)
def test_every_text_of_a_figure_is_large_enough_and_inside_of_it(name):
    make, row = ONE_ROW[name]
    scenes = ("fireplace_room", "living_room")
    long = [row | {"scene": scene, "triangles": 143_163, "stands_for": "sponza"} for scene in scenes]
    figure = drawn(make(make_rows(*long, *(skipped(one | {"split_x": 1024}) for one in long))))
    assert figure.get_figwidth() == pytest.approx(2 * PANEL_INCHES)
    figure.draw_without_rendering()
    ticks = {text for tick in figure.findobj(Tick) for text in tick.findobj(Text)}
    for text in filter(Text.get_text, figure.findobj(Text)):
        assert text.get_fontsize() >= SMALL, text
        if text not in ticks:  # those beyond the end of an axis are there, too, and not drawn
            whole = text.get_window_extent()
            assert min(whole.x0, whole.y0) >= 0, text
            assert max(whole.x1 - figure.bbox.x1, whole.y1 - figure.bbox.y1) <= 0, text


def test_labels_of_ticks_keep_apart():
    rows = [time_row(split, 0.1, ratio=1.5) for split in (1, 16, 64, 128, 256, 512, 1024)]
    (axis, *_) = drawn(split_ratios(make_rows(*rows))).axes
    axis.figure.draw_without_rendering()
    places = [text.get_window_extent() for text in axis.get_xticklabels() if text.get_text()]
    assert [text.get_text() for text in axis.get_xticklabels()][-1] == "1,024"
    assert len(places) >= 4
    assert all(left.x1 < right.x0 for left, right in pairwise(places))


def test_a_long_label_of_a_bar_is_folded_and_leaves_its_panel_as_wide_as_the_others():
    bars = [Bar(", ".join(["some option of it"] * count), 1.0, 0.9, 1.1, BLACK, "") for count in (1, 6)]
    figure = drawn(Figure("bars", [Panel(bars=bars), Panel(bars=bars[:1])], x=Axis("ratio", "linear")))
    figure.draw_without_rendering()
    long, short = figure.axes
    widths = [axis.get_window_extent().width for axis in figure.axes]
    assert widths[0] == pytest.approx(widths[1], rel=0.02)
    assert widths[0] > 0.4 * figure.bbox.width
    label = next(text for text in long.texts if "\n" in text.get_text())
    assert label.get_window_extent().x1 < short.get_window_extent().x0


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "methods" else pytest.mark.slow) for name in ONE_ROW]
)
def test_a_stand_in_is_named_as_one_and_no_other_scene_is(name):
    make, row = ONE_ROW[name]
    of_stand_in = make(make_rows(row | {"stands_for": "sponza"}))
    assert "stand-in for sponza, not that scene" in words(of_stand_in)
    assert "stand-in" not in words(make(make_rows(row)))
    titles = [axis.get_title(loc="left") for axis in drawn(of_stand_in).axes]
    assert all("stand-in for sponza, not that scene" in " ".join(title.split()) for title in titles)


def test_the_foot_and_the_notes_say_only_what_the_table_tells():
    one = make_rows(memory_row(1, 1, 2, 3))
    assert (provenance(one), how_measured(one)) == (f"threads 1, 1000 {TIMES} 1000 pixels", "packet width 8")
    flagged = time_row(1, 1.0, rounds=3, warnings="spread", cpu="some cpu")
    rows = make_rows(flagged, time_row(2, 1.0, measured_at="2000-01-01T"))
    said = how_measured(rows, "mark")
    assert "of each the median of 3 to 9 rounds; bars: 95 % confidence intervals over processes" in said
    assert said.endswith("mark, 1 of 2 points carry warnings (see table)")
    assert provenance(rows) == f"some cpu, 2000-01-01, threads 1, 1000 {TIMES} 1000 pixels"
    held = provenance(rows.assign(instruction_set=["avx2", "none"]))
    assert "some cpu, held to avx2, 2000-01-01" in held
    assert provenance(rows.iloc[:0]) == how_measured(rows.iloc[:0]) == ""
