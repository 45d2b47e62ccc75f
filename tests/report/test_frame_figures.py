"""The figures of several frames draw what the table says, on tables small enough to read."""

from experiments.drawing.style import TIMES
from experiments.workloads.multiframe.shown import (
    PACKETS,
    SEPARATE_FRAMES,
    TOGETHER,
    VISIBLE_FRAMES,
    best_place,
    multiframe_figure,
    stereo_figure,
)
from tests.drawn import bars, interval_of, level, line, make_rows, method_row, save, skipped, whiskers, words

NAMES = ("separate", "visible_first", "rasteriser")
RASTER_S = 0.004


def frames_row(split_x, together_s, separate_s, visible_s, **fields):
    """A row of several frames; packets take 0.05 s. Intervals of times are half and double."""
    row = method_row("aligned", split_x, together_s, 0.05 / together_s, frames=2, motion="eyes", workload="multiframe")
    for name, time_s in zip(NAMES, (separate_s, visible_s, RASTER_S), strict=True):
        row |= {f"{name}_render_time_s": time_s, f"{name}_render_time_low_s": 0.5 * time_s}
        row |= {f"{name}_render_time_high_s": 2 * time_s, f"speedup_vs_{name}": time_s / together_s}
        row |= {f"speedup_vs_{name}_low": 0.75, f"speedup_vs_{name}_high": 1.25}
    sizes = {"separate_embree_bytes": 5, "embree_bytes": 4, "peak_rss_bytes": 4, "rss_mesh_bytes": 1}
    return row | {name: count * 2**20 for name, count in sizes.items()} | fields


def test_each_way_has_the_split_at_which_packets_lose_most_to_it():
    rows = make_rows(
        frames_row(1, 0.1, 0.01, 0.02),
        frames_row(64, 0.02, 0.05, 0.04),
        frames_row(128, 0.04, 0.02, 0.01),
        skipped(frames_row(256, 0.001, 0.001, 0.001)),
    )
    chosen = {}
    for way in (TOGETHER, SEPARATE_FRAMES, VISIBLE_FRAMES):
        place = best_place(rows, way)
        chosen[way.label] = rows["split_x"].iloc[place]
    assert list(chosen.values()) == [64, 1, 128]
    assert best_place(rows.iloc[3:], PACKETS) is None


def test_the_stereo_figure_draws_every_way_at_its_best_split_in_milliseconds_with_intervals_and_paired_ratios():
    figure = stereo_figure(make_rows(frames_row(64, 0.02, 0.05, 0.04), frames_row(128, 0.04, 0.02, 0.01)))
    (axis,) = figure.panels
    assert bars(axis) == {
        f"both together, 64 {TIMES} 1": 20, f"aligned, each eye, 128 {TIMES} 1": 20,
        f"visible-first, each eye, 128 {TIMES} 1": 10, "rasteriser, each eye": 4,
    }  # fmt: skip
    assert whiskers(axis) == [[10, 40], [10, 40], [5, 20], [2, 8]]
    assert f"20.0 ms, 2.50{TIMES} [1.75, 2.25]" in words(figure)
    assert f"20.0 ms, 0.50{TIMES} [0.75, 1.25]" in words(figure)
    assert f"10.0 ms, 0.25{TIMES} [0.75, 1.25]" in words(figure)
    assert level(axis, "rtcIntersect1 per pixel") == 100
    assert level(axis, "fastest packets per pixel") == 50


def test_the_stereo_figure_draws_a_split_of_too_few_processes_for_an_interval():
    row = frames_row(64, 0.02, 0.05, 0.04)
    row |= {name: None for name in row if name.endswith(("_low", "_high", "_low_s", "_high_s"))}
    assert f"20.0 ms, 2.50{TIMES}" in words(stereo_figure(make_rows(row)))


def test_the_figures_of_frames_say_what_was_skipped_and_which_pixels_are_wrong():
    reason = "skipped, needs more memory than its budget"
    table = make_rows(frames_row(64, 0.02, 0.05, 0.04, pixels_wrong=7), skipped(frames_row(128, 0.04, 0.02, 0.01)))
    for make in (stereo_figure, multiframe_figure):
        said = words(make(table))
        assert "7 pixels wrong" in said
        assert f"all frames together, 128 {TIMES} 1: {reason}" in " ".join(said.split())
    assert multiframe_figure(make_rows(skipped(walk(8, 0.02)))).is_empty


def walk(frames, together_s, **fields):
    return frames_row(64, together_s, 2 * together_s, 0.5 * together_s, frames=frames, motion="walk", **fields)


def test_the_multiframe_figure_draws_the_time_of_one_frame_of_each_way_and_motion():
    turned_row = frames_row(64, 0.02, 0.05, 0.04, motion="turn", pixels_wrong=7)
    table = make_rows(walk(2, 0.02), walk(4, 0.02), turned_row)
    figure = multiframe_figure(table)
    walked, _, turned, _ = figure.panels
    assert line(walked, "all frames together") == {2.0: 10, 4.0: 5}
    assert line(walked, "aligned, frame by frame") == {2.0: 20, 4.0: 10}
    assert line(walked, "visible-first, frame by frame") == {2.0: 5, 4.0: 2.5}
    assert line(walked, "rasteriser, frame by frame") == {2.0: 2, 4.0: 1}
    assert line(walked, "fastest packets per pixel, frame by frame") == {2.0: 25, 4.0: 12.5}
    assert line(turned, "all frames together") == {2.0: 10}
    assert interval_of(walked, "all frames together") == [5, 20]
    assert "the camera walks" in words(figure)
    assert "the mesh turns" in words(figure)
    assert f"4 frames, 64 {TIMES} 1" in words(figure)
    assert f"2.00{TIMES} [0.75, 1.25]" in words(figure)
    assert f"2 frames, 64 {TIMES} 1: 7 pixels wrong" in words(figure)
    save(figure)


def test_the_multiframe_figure_draws_embree_s_bytes_and_the_peak_at_the_split_of_the_times():
    slower = walk(2, 0.04) | {"split_x": 128, "embree_bytes": 9 * 2**20, "peak_rss_bytes": 9 * 2**20}
    figure = multiframe_figure(make_rows(walk(2, 0.02), slower))
    memory = figure.panels[-1]
    assert line(memory, TOGETHER.label) == {2: 4}
    assert line(memory, SEPARATE_FRAMES.label) == {2: 5}
    assert line(memory, "peak of RSS over the mesh") == {2: 3}
