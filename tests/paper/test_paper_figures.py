"""Figures 3 to 5 of the paper are drawn as the paper has them, from what the table says and no more."""

import numpy as np
import pytest

from atra.files.paths import write_atomically
from atra.files.saving import encode_png
from experiments.drawing.style import TIMES
from experiments.workloads.frame.grid_figure import grid_ratios, grid_times
from experiments.workloads.frame_figures import ALL_HITS, PAPER_BEST, split_ratios, split_times
from experiments.workloads.picture.files import ScenePictures, read_pictures
from experiments.workloads.picture.shown import scenes_figure
from tests.drawn import COMMON, interval_of, level, line, make_rows, save, skipped, time_row, unfolded, words

OFF = {"culling": False}
SPLIT = [
    time_row(1, 0.1, ratio=0.5, **OFF), time_row(2, 0.04, ratio=1.25, **OFF), time_row(4, 0.05, ratio=1.0, **OFF),
    time_row(1, 0.08, ratio=0.625), time_row(2, 0.02, ratio=2.0), time_row(4, 0.025, ratio=1.75),
]  # fmt: skip


def cells(panel):
    """(column, row) -> what is written there."""
    texts = panel.cells.texts
    return {(column, row): text for row, line in enumerate(texts) for column, text in enumerate(line) if text}


def test_figure_5_draws_the_table_s_times_in_ms_with_intervals_and_both_baselines():
    table = make_rows(*SPLIT)
    figure = split_times(table)
    (axis,) = figure.panels
    for culling, label in ((True, "aligned, culling on"), (False, "aligned, culling off")):
        rows = table[table["culling"] == culling]
        assert line(axis, label) == dict(zip(rows["split_x"], 1000 * rows["render_time_s"], strict=True))
    assert level(axis, "rtcIntersect1 per pixel") == pytest.approx(100)
    assert level(axis, "fastest ray packets") == pytest.approx(50)
    assert interval_of(axis, "aligned, culling off") == [50, 200]
    assert (figure.x.label, figure.y.label) == ("horizontal splits", "time of a frame in ms")
    assert (figure.x.scale, figure.y.scale) == ("ticks", "log")
    assert "both axes are logarithmic" in unfolded(figure)


@pytest.mark.parametrize(("make", "heights"), [(split_times, [40, 20]), (split_ratios, [1.25, 2])])
def test_the_best_split_is_ringed_and_told(make, heights):
    figure = make(make_rows(*SPLIT))
    rings = [(mark.x, mark.y) for mark in figure.panels[0].marks]
    np.testing.assert_allclose(rings, [(2, height) for height in heights])
    assert "culling on: 2 best, 20.0 ms" in words(figure)


def test_beside_figure_5_stands_the_speed_up_with_every_baseline_where_it_lies_among_the_ratios():
    figure = split_ratios(make_rows(*SPLIT))
    (axis,) = figure.panels
    assert line(axis, "aligned, culling on") == {1: 0.625, 2: 2.0, 4: 1.75}
    assert line(axis, "aligned, culling off") == {1: 0.5, 2: 1.25, 4: 1.0}
    assert level(axis, "rtcIntersect1 per pixel") == pytest.approx(0.5)
    assert level(axis, "fastest ray packets") == pytest.approx(1)
    assert level(axis, ALL_HITS) == pytest.approx(0.5)
    assert interval_of(axis, "aligned, culling off") == [1.75, 2.25]
    assert f"culling on: 2 best, 20.0 ms, 2.00{TIMES}; over all hits 4.00{TIMES}" in words(figure)


def test_single_rays_are_held_against_single_rays():
    rows = make_rows(time_row(1, 0.05, packet_width=1), time_row(2, 0.02, packet_width=1, ratio=0.1))
    (axis,) = split_ratios(rows).panels
    assert line(axis, "aligned, culling on") == {1: 2, 2: 5}
    assert level(axis, "fastest ray packets") == pytest.approx(2)
    assert "speed-up over rtcIntersect1 per pixel" in axis.y.label


GRID = [
    *(time_row(x, 0.1 / x / y, split_y=y, ratio=0.5 * x * y) for x in (1, 2) for y in (1, 2)),
    *(time_row(x, 0.2 / x / y, split_y=y, ratio=0.25 * x * y, **OFF) for x in (1, 2) for y in (1, 2)),
]


def test_figure_4_is_a_map_of_the_table_s_times_in_ms_for_culling_off_beside_one_for_culling_on():
    figure = grid_times(make_rows(*GRID))
    off, on = figure.panels
    assert [one.title for one in (off, on)] == [f"box (10 triangles), culling {word}" for word in ("off", "on")]
    # Rows of the picture are vertical splits, from the bottom up.
    np.testing.assert_allclose(off.cells.values, [[200, 100], [100, 50]])
    np.testing.assert_allclose(on.cells.values, [[100, 50], [50, 25]])
    assert cells(on) == {(0, 0): "100", (1, 0): "50.0", (0, 1): "50.0", (1, 1): "25.0"}
    assert (figure.x.label, figure.y.label) == ("horizontal splits", "vertical splits")
    assert figure.quantity == "in each cell: milliseconds of a frame"
    assert {(one.cells.low, one.cells.high) for one in (off, on)} == {(25, 200)}


def test_figure_4_frames_the_best_split_and_the_one_that_splits_and_culls_nothing():
    maps = [panel.cells for panel in grid_times(make_rows(*GRID)).panels]
    framed = [{one.label: (one.column, one.row) for one in map_.frames} for map_ in maps]
    best = "best split, by the ratio in the same rounds"
    assert framed == [{best: (1, 1), ALL_HITS: (0, 0)}, {best: (1, 1)}]


def test_beside_figure_4_stands_the_speed_up_under_both_readings():
    off, on = grid_ratios(make_rows(*GRID)).panels
    np.testing.assert_allclose(off.cells.values, [[0.25, 0.5], [0.5, 1]])
    assert cells(off)[1, 1] == "1.00\n4.00"
    assert cells(on)[1, 1] == "2.00\n8.00"


@pytest.mark.parametrize("make", [split_times, split_ratios])
def test_a_packet_width_is_a_panel_of_its_own_and_scenes_keep_their_rows(make):
    table = make_rows(*(time_row(1, 0.08, packet_width=width, scene=name) for name in "ab" for width in (8, 1)))
    titles = [one.title for one in make(table).panels]
    assert titles == [f"{name} (10 triangles), packet width {width}" for name in "ab" for width in (1, 8)]


def test_a_packet_width_has_maps_of_its_own():
    table = make_rows(*(time_row(1, 0.08, packet_width=width) for width in (8, 1)))
    titles = [one.title for one in grid_times(table).panels]
    assert titles == [
        f"box (10 triangles), packet width {width}, culling {word}" for width in (1, 8) for word in ("off", "on")
    ]


def test_what_is_missing_is_said_point_by_point():
    rows = [SPLIT[0], skipped(SPLIT[1]), *SPLIT[3:]]
    said = words(split_times(make_rows(*rows)))
    assert f"{TIMES} culling off, 2: skipped, needs more memory than its budget" in said
    assert f"{TIMES} culling off, 4: not in the table" in said
    figure = grid_times(make_rows(GRID[4], skipped(GRID[5]), *GRID[:4]))
    off, _ = figure.panels
    assert cells(off) == {(0, 0): "200", (0, 1): TIMES, (1, 0): "\N{EN DASH}", (1, 1): "\N{EN DASH}"}
    why = f"; {TIMES}: skipped, needs more memory than its budget; \N{EN DASH}: not in the table"
    assert figure.quantity.endswith(why)


def test_an_unsteady_point_s_time_is_not_drawn():
    unsteady = {
        "status": "unsteady",
        "error": "rtcIntersect1 over packets was more than 10% off the median of the sweep",
    }
    (axis,) = split_times(make_rows(*SPLIT[:5], SPLIT[5] | unsteady)).panels
    assert line(axis, "aligned, culling on") == {1: 80, 2: 20}
    _, on = grid_times(make_rows(*GRID[1:], GRID[0] | unsteady)).panels
    assert cells(on)[0, 0] == TIMES


@pytest.mark.parametrize("make", [split_times, split_ratios])
def test_a_table_without_culling_off_says_so(make):
    said = words(make(make_rows(*SPLIT[3:])))
    assert "culling off: not in the table" in said
    assert "culling on: not in the table" not in said


@pytest.mark.parametrize("make", [grid_times, grid_ratios])
def test_a_map_without_points_says_so_in_its_cells(make):
    figure = make(make_rows(*SPLIT[3:]))
    off, on = (set(cells(panel).values()) for panel in figure.panels)
    assert off == {"\N{EN DASH}"} != on
    assert figure.quantity.endswith("\N{EN DASH}: not in the table")


@pytest.mark.parametrize(("make", "gone", "said"), [
    (split_times, ["render_time_s"], "culling on, 1, 2, 4: not measured"),
    (split_times, ["packets_render_time_s"], "fastest ray packets: not measured"),
    (split_ratios, ["baseline_render_time_s"], "rtcIntersect1 per pixel: not measured"),
    (split_ratios, ["speedup", "speedup_vs_packets"], "culling on, 1, 2, 4: not measured"),
    (grid_ratios, ["speedup", "speedup_vs_packets"], f"{ALL_HITS}: not measured"),
])  # fmt: skip
def test_an_older_table_without_a_column_says_what_is_missing(make, gone, said):
    figure = make(make_rows(*SPLIT).drop(columns=gone))
    assert said in unfolded(figure)
    save(figure)


IMAGES = [np.full((4, 8, 3), value, np.uint8) for value in (10, 20, 30)]


def pictures(scene, stands_for=None):
    return ScenePictures(scene, 61600, stands_for, 8, 4, 29, 2, 1, 0, *map(encode_png, IMAGES))


def picture_row(scene, **fields):
    return COMMON | {"workload": "picture", "scene": scene, "triangles": 61600} | fields


def test_figure_3_shows_each_scene_with_its_name_and_triangles():
    rows = make_rows(picture_row("ball", stands_for="mitsuba"), picture_row("room"))
    figure = scenes_figure(rows, [pictures("ball"), pictures("room")])
    for panel in figure.panels:
        np.testing.assert_array_equal(panel.picture, IMAGES[0])
    for text in ("ball (61,600 triangles)", "room (61,600 triangles)", "stand-in for mitsuba, not that scene"):
        assert text in words(figure)
    assert figure.provenance.endswith(f"1000 {TIMES} 1000 pixels")


def test_figure_3_holds_no_picture_that_must_not_be_passed_on_and_says_what_it_lacks():
    rows = make_rows(picture_row("mitsuba"), picture_row("room"), skipped(picture_row("hall")))
    figure = scenes_figure(rows, [pictures("mitsuba")])
    assert all(panel.picture is None for panel in figure.panels)
    said = unfolded(figure)
    assert "does not allow pictures of it to be passed on" in said
    assert "room: no picture: neither a record nor a kept file holds it" in said
    assert "skipped: needs 9 GiB" in said
    save(figure)


def test_kept_pictures_stand_in_for_records_that_are_gone(tmp_path):
    rows = make_rows(picture_row("box", **dict.fromkeys(("pixels_equal", "pixels_tied", "pixels_edge"), 1)))
    assert read_pictures(rows, tmp_path) == []
    for name, image in zip(("aligned", "pixel", "difference"), IMAGES, strict=True):
        write_atomically(tmp_path / "pictures" / f"box_{name}.png", encode_png(image))
    (kept,) = read_pictures(rows, tmp_path)
    (panel,) = scenes_figure(rows, [kept]).panels
    np.testing.assert_array_equal(panel.picture, IMAGES[0])


PAPER = {"scene": "sponza", "packet_width": 1, "width": 1024, "height": 1024}


def test_the_paper_s_best_speed_up_is_a_star_among_ours_of_its_scene_size_and_rays():
    rows = [time_row(split, 0.05, **PAPER) for split in (1, 64)]
    figure = split_ratios(make_rows(*rows), with_paper=True)
    assert [(mark.x, mark.y) for mark in figure.panels[0].marks if mark.label == PAPER_BEST] == [(64, 1.71)]
    for other in ({"scene": "atrium", "stands_for": "sponza"}, {"packet_width": 8}, {"width": 512}):
        shown = split_ratios(make_rows(*(row | other for row in rows)), with_paper=True)
        assert PAPER_BEST not in [mark.label for mark in shown.panels[0].marks]
