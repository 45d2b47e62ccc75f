"""The sweep of plans: views, what is compared, regret by hand, and the figure."""

import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import atra
from atra.errors import InputError
from atra.planner.choice import PACKETS, RASTER, candidates
from experiments.harness.processes.worker import measure_point
from experiments.workloads.planner import FRAMES, regrets
from experiments.workloads.planner.shown import SERIES, draw_planner_figure, sweep_lines
from scenes.cornell_box import CORNELL_BOX_CAMERA
from scenes.views import VIEWS, view_fields
from tests.meshes import cornell_box, cornell_camera
from tests.points import planned
from tests.report_samples import table_of

pytestmark = pytest.mark.uncovered


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_the_scene_from_a_place_of_its_own(view):
    mesh = cornell_box()
    fields = view_fields(mesh, CORNELL_BOX_CAMERA, view)
    camera = atra.Camera(**fields, width=16, height=16)
    assert fields == view_fields(mesh, CORNELL_BOX_CAMERA, view)
    with atra.PixelTracer(mesh, camera, packet_width=1) as tracer:
        assert np.isfinite(tracer.trace().depth).mean() > 0.2
    others = [view_fields(mesh, CORNELL_BOX_CAMERA, other) for other in VIEWS if other != view]
    assert fields not in others


def test_a_view_moved_in_stands_nearer_by_four_tenths_of_what_it_looked_at_and_an_unknown_one_is_refused():
    eye = np.asarray(CORNELL_BOX_CAMERA["eye"])
    moved = np.asarray(view_fields(cornell_box(), CORNELL_BOX_CAMERA, "near")["eye"])
    with atra.PixelTracer(cornell_box(), cornell_camera(1, 1), packet_width=1) as tracer:
        assert np.linalg.norm(moved - eye) == pytest.approx(0.4 * float(tracer.trace().depth[0, 0]))
    with pytest.raises(InputError, match=r"scene\.view is 'behind'"):
        view_fields(cornell_box(), CORNELL_BOX_CAMERA, "behind")


def test_regret_is_the_choice_over_the_best_in_frames_and_in_all():
    first_s = {"packets": 4.0, "a": 65.0, "b": 18.0}
    frame_s = {"packets": 4.0, "a": 1.0, "b": 2.0}
    assert FRAMES == 64
    found = regrets(first_s, frame_s, "packets", "b", 48.0)
    assert (found["plan"], found["best_plan"], found["best_frame_plan"]) == ("b", "a", "a")
    assert found["packets_regret"] == 256 / 128
    assert (found["regret"], found["frame_regret"], found["vs_packets"]) == (144 / 128, 2.0, 144 / 256)
    assert found["regret_with_planning"] == (48 + 144) / 128


def test_planning_pays_from_the_frame_at_which_its_time_is_made_good():
    first_s, frame_s = {"packets": 4.0, "b": 18.0}, {"packets": 4.0, "b": 2.0}
    frames = np.arange(1, 100)
    for planning_s in (0.0, 48.0, 49.0):
        from_frame = regrets(first_s, frame_s, "packets", "b", planning_s)["pays_from_frames"]
        np.testing.assert_array_equal(frames >= from_frame, planning_s + 18 + 2 * (frames - 1) < 4 * frames)
    assert regrets(first_s, frame_s, "packets", "packets", 1.0)["pays_from_frames"] is None
    assert regrets({"packets": 4.0, "b": 1.0}, frame_s, "packets", "b", 1.0)["pays_from_frames"] == 1


def planner_table():
    """Three views; regrets 1.0, 1.1 and 1.2."""
    common = {
        "scene": "cornell_box", "triangles": 1112, "width": 64, "height": 64, "status": "ok", "threads": 1,
        "workload": "planner", "method": "pixel", "grids": "planner", "packet_width": 8, "build_quality": "medium",
        "packets_regret": 2.0, "frame_regret": 1.0, "vs_packets": 0.5, "regret_with_planning": 1.5,
    }  # fmt: skip
    views = enumerate(("aside", "around", "wide"))
    return table_of([{**common, "view": view, "regret": 1.0 + 0.1 * place} for place, view in views])


def test_the_terminal_says_median_and_worst_of_all_plans():
    told, counted = sweep_lines(planner_table().assign(pays_from_frames=pd.array([20, 30, None], "Int64")))
    assert told.startswith("plans: regret 1.10, at worst 1.20;")
    assert "over packets at worst 0.50" in told
    assert counted == (
        "planning counted, too: regret 1.50, at worst 1.50; it pays in 2 of 3 views, mostly from 25 frames on, "
        "at worst from 30"
    )


def test_the_figure_shows_every_view_where_it_belongs():
    table = planner_table()
    figure = draw_planner_figure(table)
    (axis,) = [axis for axis in figure.axes if axis.get_visible()]
    drawn = {line.get_label(): list(line.get_xdata()) for line in axis.lines}
    for label, (name, _) in SERIES.items():
        views = [text.get_text().partition(",")[0] for text in axis.get_yticklabels()]
        assert drawn[label] == pytest.approx(list(table.set_index("view")[name][views]))


def toy_point(**fields):
    return planned("pixel", "planner", (32, 32), {"view": "near"}, threads=1, **fields).point


def test_a_measured_point_holds_every_candidate_in_the_same_rounds():
    point = toy_point()
    measured = measure_point(point)
    wanted = {str(one) for one in candidates(point.camera)}
    assert set(measured.samples) == {one["name"] for one in measured.results["candidates"]} == wanted
    assert {len(values) for values in measured.samples.values()} == {3}
    assert measured.results["plan"] in wanted
    assert min(measured.results["regret"], measured.results["frame_regret"]) >= 1.0
    assert measured.results["regret_with_planning"] > measured.results["regret"]


def test_a_point_is_measured_where_processor_time_does_not_tell_frames_apart(monkeypatch):
    monkeypatch.setattr(time, "thread_time", lambda: 0.0)
    measured = measure_point(toy_point())
    assert all(value > 0 for values in measured.samples.values() for value in values)


def test_a_point_passes_its_ties_on_to_plans_and_tracers(monkeypatch):
    def refuse(_):
        raise AssertionError("nobody may ask for ties")

    for module in ("atra.exact.ties", "atra.tracing.base"):
        monkeypatch.setattr(f"{module}.coplanar_overlaps", refuse)
    measured = measure_point(toy_point(ties="any"))
    assert measured.results["planned"]["ties"] == "any"


def test_a_point_leaves_out_what_does_not_fit_into_its_memory_budget():
    measured = measure_point(replace(toy_point(), memory_budget_gib=1e-9))
    assert {one["method"] for one in measured.results["candidates"]} == {PACKETS, RASTER}
    assert measured.results["plan"] in (PACKETS, RASTER)
