"""Workload `moving`: every frame is seen from another eye, by the method and by the baselines alike."""

from itertools import pairwise

import numpy as np
import pytest

import atra
from experiments.drawing.style import TIMES
from experiments.harness.method import Tracing
from experiments.results.terminal import results_console
from experiments.workloads.baselines import OWN, SINGLE
from experiments.workloads.moving import EYES, KEPT, RADIUS, STILL, eyes_around, kept_tracer
from experiments.workloads.moving.shown import moving_figure, sweep_lines
from experiments.workloads.rounds import Frames, expert_packet_widths
from tests.drawn import bars, level, make_rows, method_row, whiskers, words
from tests.images import assert_no_pixel_wrong, trace_pixels
from tests.meshes import cornell_box, cornell_camera
from tests.points import measured

pytestmark = pytest.mark.uncovered

MESH, CAMERA = cornell_box(), cornell_camera(40, 24)
PATH = eyes_around(CAMERA, MESH)


def test_the_path_has_another_eye_in_every_frame_and_looks_the_same_way():
    assert len({camera.eye for camera in (CAMERA, *PATH)}) == EYES + 1
    size = float(np.linalg.norm(MESH.bounds[1] - MESH.bounds[0]))
    for camera, following in pairwise([*PATH, PATH[0]]):
        assert np.linalg.norm(np.subtract(camera.eye, CAMERA.eye)) == pytest.approx(size * RADIUS)
        assert np.linalg.norm(np.subtract(camera.eye, following.eye)) == pytest.approx(
            2 * size * RADIUS * np.sin(np.pi / EYES)
        )
        np.testing.assert_allclose(camera.axes, CAMERA.axes, atol=1e-12)
    assert eyes_around(CAMERA, MESH) == PATH


def test_every_frame_is_of_the_next_camera():
    with atra.RasterTracer(MESH, CAMERA, threads=1) as tracer:
        frames = Frames(tracer, PATH[:2])
        seen = []
        for _ in range(3):
            frames()
            seen.append(frames.latest().camera)
        assert seen == [PATH[0], PATH[1], PATH[0]]


@pytest.mark.parametrize("method", ["pixel", "aligned", "visible_first", "tiles", "raster"])
def test_a_point_has_samples_of_a_moving_and_a_standing_eye_and_no_pixel_of_the_last_frame_is_wrong(method):
    got = measured(method, "moving")
    names = {OWN, STILL, SINGLE, KEPT, *(f"packets_{width}" for width in expert_packet_widths())}
    assert {name: len(values) for name, values in got.samples.items()} == dict.fromkeys(names, 3)
    assert sum(got.results[f"pixels_{kind}"] for kind in ("equal", "tied", "edge", "wrong")) == 48 * 32
    assert got.results["pixels_wrong"] == got.results["kept_pixels_wrong"] == 0


@pytest.mark.parametrize("packet_width", [1, *expert_packet_widths()])
def test_packets_over_a_bvh_of_the_world_keep_it_from_eye_to_eye_and_see_what_they_should(packet_width):
    with kept_tracer(MESH, CAMERA, Tracing(), packet_width) as tracer:
        scene = tracer.embree_bytes
        for camera in (CAMERA, *PATH[:3]):
            tracer.look(camera)
            assert tracer.embree_bytes == scene
            assert_no_pixel_wrong(MESH, camera, tracer.trace(), trace_pixels(MESH, camera))


def moving_row(method, split_x, time_s, ratio, **fields):
    """Packets take 50 ms, over a BVH of the world 25."""
    own = {"workload": "moving", "kept_packets_time_s": 0.025, "speedup_vs_kept_packets": 0.025 / time_s}
    return method_row(method, split_x, time_s, ratio, pixels_wrong=0, moving_over_still=1.25) | own | fields


def test_the_figure_draws_every_method_at_its_best_split_and_packets_that_keep_their_bvh():
    table = make_rows(
        moving_row("aligned", 64, 0.08, 0.5),
        moving_row("aligned", 128, 0.04, 1.5),
        moving_row("raster", 1, 0.01, 5.5, pixels_wrong=3) | {"split_x": None, "split_y": None},
    )
    figure = moving_figure(table)
    (axis,) = figure.panels
    assert bars(axis) == {
        f"aligned, packets of 8, 128 {TIMES} 1": 1.5, "rasteriser": 5.5, "packets, BVH of the world kept": 2.0,
    }  # fmt: skip
    assert whiskers(axis)[:2] == [[1.75, 2.25]] * 2
    assert level(axis, "fastest packets per pixel") == 1
    assert f"10.0 ms, 5.50{TIMES} [1.75, 2.25]" in words(figure)
    assert "25.0 ms" in words(figure)
    assert "3 pixels wrong" in words(figure)


def test_the_terminal_says_what_another_eye_costs(capsys):
    rows = make_rows(moving_row("aligned", 64, 0.08, 0.5), moving_row("aligned", 128, 0.04, 1.5))
    (table,) = sweep_lines(rows)
    results_console().print(table)
    said = capsys.readouterr().out
    assert "40.0 ms" in said
    assert "80.0 ms" not in said
    assert all(ratio in said for ratio in ("1.25x", "1.50x", "0.62x"))
