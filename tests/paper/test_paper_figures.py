"""Figures 3 to 5 of the paper are drawn as the paper has them, from what the table says and no more."""

import numpy as np
import pytest

from experiments.drawing.shading import encode_png
from experiments.drawing.style import PANEL_INCHES, TIMES
from experiments.workloads.frame.grid_figure import draw_grid_ratios, draw_grid_times
from experiments.workloads.frame_figures import ALL_HITS, draw_split_ratios, draw_split_times
from experiments.workloads.picture.files import ScenePictures
from experiments.workloads.picture.shown import draw_differences_figure, draw_scenes_figure
from tests.drawn import COMMON, level, line, make_rows, save, skipped, time_row, unfolded, words

OFF = {"culling": False}
SPLIT = [
    time_row(1, 0.1, ratio=0.5, **OFF), time_row(2, 0.04, ratio=1.25, **OFF), time_row(4, 0.05, ratio=1.0, **OFF),
    time_row(1, 0.08, ratio=0.625), time_row(2, 0.02, ratio=2.0), time_row(4, 0.025, ratio=1.75),
]  # fmt: skip


def panels(figure):
    return [axis for axis in figure.axes if axis.get_title(loc="left")]


def cells(axis):
    """(column, row) -> what is written there."""
    whole = [text for text in axis.texts if text.get_transform() == axis.transData]
    return {tuple(map(int, text.get_position())): text.get_text() for text in whole if text.get_text()}


def test_figure_5_draws_the_table_s_times_in_ms_with_intervals_and_both_baselines():
    table = make_rows(*SPLIT)
    figure = draw_split_times(table)
    (axis,) = figure.axes
    for culling, label in ((True, "aligned, culling on"), (False, "aligned, culling off")):
        rows = table[table["culling"] == culling]
        assert line(axis, label) == dict(zip(rows["split_x"], 1000 * rows["render_time_s"], strict=True))
    assert level(axis, "rtcIntersect1 per pixel") == pytest.approx(100)
    assert level(axis, "fastest packets per pixel") == pytest.approx(50)
    bars = next(one for one in axis.get_lines() if one.get_label() == "_bars")
    assert bars.get_ydata()[[0, 1]] == pytest.approx([50, 200])
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("horizontal splits", "time of a frame in ms")
    assert (axis.get_xscale(), axis.get_yscale()) == ("log", "log")
    assert "both axes are logarithmic" in unfolded(figure)


@pytest.mark.parametrize(("draw", "heights"), [(draw_split_times, [40, 20]), (draw_split_ratios, [1.25, 2])])
def test_the_best_split_is_ringed_and_told(draw, heights):
    figure = draw(make_rows(*SPLIT))
    rings = [one.get_xydata()[0] for one in figure.axes[0].get_lines() if one.get_label() == "_best"]
    np.testing.assert_allclose(rings, [(2, height) for height in heights])
    assert "culling on: 2 best, 20.0 ms" in words(figure)


def test_beside_figure_5_stands_the_speed_up_with_every_baseline_where_it_lies_among_the_ratios():
    figure = draw_split_ratios(make_rows(*SPLIT))
    (axis,) = figure.axes
    assert line(axis, "aligned, culling on") == {1: 0.625, 2: 2.0, 4: 1.75}
    assert line(axis, "aligned, culling off") == {1: 0.5, 2: 1.25, 4: 1.0}
    assert level(axis, "rtcIntersect1 per pixel") == pytest.approx(0.5)
    assert level(axis, "fastest packets per pixel") == pytest.approx(1)
    assert level(axis, ALL_HITS) == pytest.approx(0.5)
    bars = next(one for one in axis.get_lines() if one.get_label() == "_bars")
    assert bars.get_ydata()[[0, 1]] == pytest.approx([1.75, 2.25])
    assert f"culling on: 2 best, 20.0 ms, 2.00{TIMES}; over all hits 4.00{TIMES}" in words(figure)


def test_single_rays_are_held_against_single_rays():
    rows = make_rows(time_row(1, 0.05, packet_width=1), time_row(2, 0.02, packet_width=1, ratio=0.1))
    (axis,) = draw_split_ratios(rows).axes
    assert line(axis, "aligned, culling on") == {1: 2, 2: 5}
    assert level(axis, "fastest packets per pixel") == pytest.approx(2)
    assert "speed-up over rtcIntersect1 per pixel" in axis.get_ylabel()


GRID = [
    *(time_row(x, 0.1 / x / y, split_y=y, ratio=0.5 * x * y) for x in (1, 2) for y in (1, 2)),
    *(time_row(x, 0.2 / x / y, split_y=y, ratio=0.25 * x * y, **OFF) for x in (1, 2) for y in (1, 2)),
]


def test_figure_4_is_a_map_of_the_table_s_times_in_ms_for_culling_off_beside_one_for_culling_on():
    figure = draw_grid_times(make_rows(*GRID))
    off, on = panels(figure)
    assert [axis.get_title(loc="left") for axis in (off, on)] == [
        f"box (10 triangles), culling {word}" for word in ("off", "on")
    ]
    # Rows of the picture are vertical splits, from the bottom up.
    np.testing.assert_allclose(off.images[0].get_array(), [[200, 100], [100, 50]])
    np.testing.assert_allclose(on.images[0].get_array(), [[100, 50], [50, 25]])
    assert cells(on) == {(0, 0): "100", (1, 0): "50.0", (0, 1): "50.0", (1, 1): "25.0"}
    assert (on.get_xlabel(), on.get_ylabel()) == ("horizontal splits", "vertical splits")
    assert {axis.get_ylabel() for axis in figure.axes if axis not in (off, on)} == {"time of a frame in ms"}
    assert off.images[0].get_clim() == on.images[0].get_clim() == (25, 200)


def test_figure_4_frames_the_best_split_and_the_one_that_splits_and_culls_nothing():
    off, on = panels(draw_grid_times(make_rows(*GRID)))
    framed = [
        {patch.get_label(): tuple(map(round, patch.get_center())) for patch in axis.patches} for axis in (off, on)
    ]
    best = "best split, by the ratio in the same rounds"
    assert framed == [{best: (1, 1), ALL_HITS: (0, 0)}, {best: (1, 1)}]


def test_beside_figure_4_stands_the_speed_up_under_both_readings():
    off, on = panels(draw_grid_ratios(make_rows(*GRID)))
    np.testing.assert_allclose(off.images[0].get_array(), [[0.25, 0.5], [0.5, 1]])
    assert cells(off)[1, 1] == f"1.00{TIMES}\n4.00{TIMES}"
    assert cells(on)[1, 1] == f"2.00{TIMES}\n8.00{TIMES}"


@pytest.mark.parametrize("draw", [draw_split_times, draw_split_ratios])
def test_a_packet_width_is_a_panel_of_its_own_and_scenes_keep_their_rows(draw):
    table = make_rows(*(time_row(1, 0.08, packet_width=width, scene=name) for name in "ab" for width in (8, 1)))
    titles = [axis.get_title(loc="left") for axis in panels(draw(table))]
    assert titles == [f"{name} (10 triangles), packet width {width}" for name in "ab" for width in (1, 8)]


def test_a_packet_width_has_maps_of_its_own():
    table = make_rows(*(time_row(1, 0.08, packet_width=width) for width in (8, 1)))
    titles = [axis.get_title(loc="left") for axis in panels(draw_grid_times(table))]
    assert titles == [
        f"box (10 triangles), packet width {width}, culling {word}" for width in (1, 8) for word in ("off", "on")
    ]


def test_what_is_missing_is_said_point_by_point():
    rows = [SPLIT[0], skipped(SPLIT[1]), *SPLIT[3:]]
    (axis,) = draw_split_times(make_rows(*rows)).axes
    said = " ".join(text.get_text() for text in axis.texts)
    assert f"{TIMES} culling off, 2: skipped, needs more memory than its budget" in said
    assert f"{TIMES} culling off, 4: not in the table" in said
    off, _ = panels(draw_grid_times(make_rows(GRID[4], skipped(GRID[5]), *GRID[:4])))
    assert cells(off) == {(0, 0): "200", (0, 1): "skipped", (1, 0): "\N{EN DASH}", (1, 1): "\N{EN DASH}"}
    said = " ".join(word for text in off.texts for word in text.get_text().split())
    assert "1 cell: skipped, needs more memory than its budget" in said
    assert "\N{EN DASH} 2 cells: not in the table" in said


def test_an_unsteady_point_s_time_is_not_drawn():
    unsteady = {
        "status": "unsteady",
        "error": "rtcIntersect1 over packets was more than 10% off the median of the sweep",
    }
    (axis,) = draw_split_times(make_rows(*SPLIT[:5], SPLIT[5] | unsteady)).axes
    assert line(axis, "aligned, culling on") == {1: 80, 2: 20}
    figure = draw_grid_times(make_rows(*GRID[1:], GRID[0] | unsteady))
    _, on = panels(figure)
    assert cells(on)[0, 0] == "unsteady"
    figure.draw_without_rendering()
    assert on.get_window_extent().width > 0.6 * PANEL_INCHES * figure.dpi  # a wide note would make the layout shrink it


@pytest.mark.parametrize("draw", [draw_split_times, draw_split_ratios, draw_grid_times, draw_grid_ratios])
def test_a_table_without_culling_off_says_so(draw):
    said = words(draw(make_rows(*SPLIT[3:])))
    assert "culling off: not in the table" in said
    assert "culling on: not in the table" not in said


@pytest.mark.parametrize(("draw", "gone", "said"), [
    (draw_split_times, ["render_time_s"], "culling on, 1, 2, 4: not measured"),
    (draw_split_times, ["packets_render_time_s"], "fastest packets per pixel: not measured"),
    (draw_split_ratios, ["baseline_render_time_s"], "rtcIntersect1 per pixel: not measured"),
    (draw_split_ratios, ["speedup", "speedup_vs_packets"], "culling on, 1, 2, 4: not measured"),
    (draw_grid_times, ["render_time_s"], "3 cells: measured, but without this value"),
    (draw_grid_ratios, ["speedup", "speedup_vs_packets"], f"{ALL_HITS}: not measured"),
])  # fmt: skip
def test_an_older_table_without_a_column_says_what_is_missing(draw, gone, said):
    figure = draw(make_rows(*SPLIT).drop(columns=gone))
    assert said in unfolded(figure)
    save(figure)


IMAGES = [np.full((4, 8, 3), value, np.uint8) for value in (10, 20, 30)]


def pictures(scene, stands_for=None):
    return ScenePictures(scene, 61600, stands_for, 8, 4, 29, 2, 1, 0, *map(encode_png, IMAGES))


def picture_row(scene, **fields):
    return COMMON | {"workload": "picture", "scene": scene, "triangles": 61600} | fields


def test_figure_3_shows_each_scene_with_its_name_and_triangles():
    rows = make_rows(picture_row("ball", stands_for="mitsuba"), picture_row("room"))
    figure = draw_scenes_figure(rows, [pictures("ball"), pictures("room")])
    assert figure.get_figwidth() == pytest.approx(2 * PANEL_INCHES)
    for axis in figure.axes:
        np.testing.assert_array_equal(axis.images[0].get_array(), IMAGES[0])
    for text in ("ball (61,600 triangles)", "room (61,600 triangles)", "stand-in for mitsuba, not that scene"):
        assert text in words(figure)
    assert f"8 {TIMES} 4 pixels" in unfolded(figure)


def test_figure_3_holds_no_picture_that_must_not_be_passed_on_and_says_what_it_lacks():
    rows = make_rows(picture_row("mitsuba"), picture_row("room"), skipped(picture_row("hall")))
    figure = draw_scenes_figure(rows, [pictures("mitsuba")])
    assert not any(axis.images for axis in figure.axes)
    said = unfolded(figure)
    assert "does not allow pictures of it to be passed on" in said
    assert "no picture: the records that hold it are not in this folder" in said
    assert "skipped: needs 9 GiB" in said
    save(figure)


def test_beside_figure_3_stand_the_pictures_of_both_methods_with_their_counts():
    one = pictures("ball", stands_for="mitsuba")
    figure = draw_differences_figure([one, one])
    assert len(figure.axes) == 6
    for axis, image in zip(figure.axes, IMAGES + IMAGES, strict=True):
        np.testing.assert_array_equal(axis.images[0].get_array(), image)
    stand_in = "stand-in for mitsuba, not that scene"
    for text in ("ball (61,600 triangles)", stand_in, "29 pixels equal", "2 tied, 1 edge"):
        assert text in words(figure)
    save(figure)
    save(draw_differences_figure([]))
