"""Points of several frames: how the camera or mesh moves, what is refused, measured and shown of them."""

import io
from contextlib import ExitStack

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from atra.alignment.alignment import Alignment
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.split import Split
from atra.hits import Hits
from atra.judge.compare import compare
from experiments.drawing.style import TIMES
from experiments.harness.points import plan_points
from experiments.harness.processes.worker import measure_point
from experiments.harness.records import Record
from experiments.paper.evidence import collect_scenes
from experiments.results.statistics import NotMeasuredError
from experiments.results.table import make_table, make_tables
from experiments.results.terminal import print_sweep, say_label, say_outcome
from experiments.workloads.multiframe import MultiframeOptions
from experiments.workloads.multiframe.motion import (
    EYE_DISTANCE,
    MESH_TURN_DEGREES,
    MOTIONS,
    STEP,
    STEP_TURN_DEGREES,
    STEP_ZOOM,
    frames_of,
    make_together,
)
from experiments.workloads.rounds import expert_packet_widths, make_single
from scenes.loading import SceneSource, load_scene
from tests.meshes import cornell_box, cornell_camera
from tests.points import configured
from tests.results.test_table import MEASURED

pytestmark = pytest.mark.uncovered


CAMERA = cornell_camera(width=48, height=32)
MESH = cornell_box()
DIAGONAL = float(np.linalg.norm(MESH.bounds[1] - MESH.bounds[0]))
SPLIT = Split(4, 1, 48, 32)


def test_the_eyes_stand_side_by_side_around_the_view_and_look_the_same_way():
    (left, right), meshes = frames_of(CAMERA, MESH, 2, "eyes")
    assert meshes == (MESH, MESH)
    apart = np.subtract(right.eye, left.eye)
    np.testing.assert_allclose(apart, CAMERA.axes[0] * DIAGONAL * EYE_DISTANCE, atol=1e-12)
    np.testing.assert_allclose(np.add(right.eye, left.eye) / 2, CAMERA.eye, atol=1e-12)
    Alignment.of_eyes(left, right, SPLIT)  # refuses eyes that are not parallel


def test_a_walk_starts_at_the_view_and_steps_turns_and_zooms_with_every_frame():
    cameras, meshes = frames_of(CAMERA, MESH, 3, "walk")
    assert cameras[0] == CAMERA
    assert meshes == (MESH,) * 3
    for frame, camera in enumerate(cameras):
        moved = np.subtract(camera.eye, CAMERA.eye)
        np.testing.assert_allclose(moved, frame * STEP * DIAGONAL * CAMERA.axes[2], atol=1e-12)
        turned = np.degrees(np.arccos(np.clip(camera.axes[2] @ CAMERA.axes[2], -1, 1)))
        assert turned == pytest.approx(frame * STEP_TURN_DEGREES, abs=1e-5)
        assert camera.fov_y_degrees == pytest.approx(CAMERA.fov_y_degrees * STEP_ZOOM**frame)
    assert cameras[1].axes[2] @ CAMERA.axes[0] < 0  # to its left


def test_a_turning_mesh_has_vertices_of_its_own_every_frame_and_keeps_its_shape_and_triangles():
    cameras, meshes = frames_of(CAMERA, MESH, 3, "turn")
    assert cameras == (CAMERA,) * 3
    assert meshes[0] is MESH
    axis = np.array(CAMERA.target)
    for frame, mesh in enumerate(meshes):
        np.testing.assert_array_equal(mesh.faces, MESH.faces)
        before, after = MESH.vertices - axis, mesh.vertices - axis
        np.testing.assert_allclose(after[:, 1], before[:, 1], atol=1e-6)  # the camera's up is y
        angle = np.radians(frame * MESH_TURN_DEGREES)
        # Counter-clockwise from above turns z towards x.
        expected = before[:, 2] * np.sin(angle) + before[:, 0] * np.cos(angle)
        np.testing.assert_allclose(after[:, 0], expected, atol=1e-6)
    assert np.abs(meshes[2].vertices - MESH.vertices).max() > 0.01


def test_a_view_that_widens_to_half_a_circle_is_refused():
    wide = Camera(CAMERA.eye, CAMERA.target, fov_y_degrees=179.5)
    with pytest.raises(InputError, match="fov_y_degrees is 18"):
        frames_of(wide, MESH, 3, "walk")


PACKETS_HERE = {f"packets_{width}" for width in expert_packet_widths()}
SAMPLES = {
    "own": [2.0, 4.0, 4.0], "rtcIntersect1": [8.0, 8.0, 8.0], "packets_8": [4.0, 4.0, 4.0],
    "separate": [2.0, 8.0, 6.0], "visible_first": [1.0, 1.0, 1.0],
    "rasteriser": [0.5, 2.0, 2.0],
}  # fmt: skip


def configuration(frames=2, motion="walk", method="aligned", **options):
    """options: of the method, by default 4 cells; one frame is a point of the workload that knows no others."""
    asked = ("frame", {}) if frames == 1 else ("multiframe", {"frames": frames, "motion": motion})
    return configured(method, asked[0], asked=asked[1], options=options)


def planned(**fields):
    """Beside a point that can be measured: alone, a point with a problem is an error at once."""
    one, _ = plan_points([configuration(**fields), configuration()])
    return one


def point(**fields):
    one = planned(**fields)
    assert one.problem is None
    return one.point


def frames_record(**fields):
    own = {"workload": "multiframe", "workload_options": {"frames": 2, "motion": "eyes"}}
    results = MEASURED.results | {"separate_embree_bytes": 40}
    given = {"point_id": "f", "configuration": MEASURED.configuration | own, "samples": SAMPLES, "results": results}
    return Record(**{**vars(MEASURED), **given, **fields})


@pytest.mark.parametrize(("frames", "motion", "expected"), [
    (1, "walk", "frames is 1, expected at least 2"),
    (3, "eyes", "frames is 3 with .*motion=eyes, expected 2"),
])  # fmt: skip
def test_several_frames_are_at_least_two_and_eyes_are_two(frames, motion, expected):
    with pytest.raises(InputError, match=expected):
        MultiframeOptions(frames, motion)


@pytest.mark.parametrize("method", ["visible_first", "pixel", "tiles", "embreex"])
def test_what_knows_one_frame_only_is_a_problem_of_that_point(method):
    told = str(planned(method=method).problem)
    assert f"workload=multiframe with method={method}, which traces one frame; use method=aligned" in told


def test_the_memory_budget_counts_the_copies_of_every_frame():
    several = configuration(4, "turn", culling=False)
    several.measure.memory_budget_gib = 0.001
    planned_point, _ = plan_points([several, configuration()])
    assert "17,792 triangle copies over 16 cells" in str(planned_point.problem)


@pytest.mark.parametrize(("frames", "motion"), [(2, "eyes"), (3, "walk"), (3, "turn")])
def test_a_time_has_samples_of_every_way_and_judges_every_pixel_of_every_frame(frames, motion):
    one = point(frames=frames, motion=motion)
    assert f"multiframe, frames {frames}, motion {motion}" in say_label(one)
    outcome = measure_point(one)
    ways = {"own", "rtcIntersect1", "separate", "visible_first", "rasteriser", *PACKETS_HERE}
    assert {name: len(values) for name, values in outcome.samples.items()} == dict.fromkeys(ways, 3)
    assert sum(outcome.results[f"pixels_{kind}"] for kind in ("equal", "tied", "edge", "wrong")) == frames * 48 * 32
    assert outcome.results["pixels_wrong"] == 0
    assert outcome.results["separate_embree_bytes"] > 0


@pytest.mark.parametrize("motion", MOTIONS)
def test_frame_by_frame_is_traced_with_each_frame_s_own_camera_and_mesh(motion):
    one = point(motion=motion)
    mesh = load_scene(SceneSource.procedural, "cornell_box", None).mesh
    with ExitStack() as stack:
        own = stack.enter_context(make_together(one, mesh, one.camera))
        separate = [stack.enter_context(make_single(one, mesh, camera)) for mesh, camera in own.views]
        together, alone = own.trace(), [tracer.trace() for tracer in separate]
    assert [_wrong(frame, other) for frame, other in zip(together, alone, strict=True)] == [0, 0]
    assert (alone[0].prim_id != alone[1].prim_id).any()
    assert all(_wrong(alone[i], _with_image(alone[i], alone[1 - i])) > 0 for i in (0, 1))


def _wrong(frame, other):
    return compare(frame, other).pixels_wrong


def _with_image(frame, other):
    return Hits(other.depth, other.prim_id, other.offset, frame.mesh, frame.camera)


def test_the_table_has_paired_speed_ups_over_frames_traced_separately():
    row = make_table([frames_record(), MEASURED]).iloc[0]
    assert (row["frames"], row["motion"], row["separate_embree_bytes"]) == (2, "eyes", 40)
    assert (row["separate_render_time_s"], row["visible_first_render_time_s"]) == (6.0, 1.0)
    assert row["speedup_vs_separate"] == 1.5  # of 1, 2, 1.5
    assert row["speedup_vs_visible_first"] == 0.25  # of 0.5, 0.25, 0.25
    assert (row["rasteriser_render_time_s"], row["speedup_vs_rasteriser"]) == (2.0, 0.5)  # of 0.25, 0.5, 0.5
    alone = make_table([MEASURED]).iloc[0]
    assert alone[["frames", "separate_render_time_s", "speedup_vs_separate", "separate_embree_bytes"]].isna().all()


def test_the_terminal_tells_the_speed_up_over_separate_frames(tmp_path):
    assert say_outcome(frames_record()) == "4000.0 ms, 2.00x rtcIntersect1, 1.50x separate frames"
    assert "separate" not in say_outcome(MEASURED)
    four = frames_record().configuration | {
        "method_options": frames_record().configuration["method_options"] | {"split_x": 4}
    }
    skipped = frames_record(
        point_id="s", status="skipped", error="needs 9 GiB", configuration=four, samples={}, results={}
    )
    shown = io.StringIO()
    print_sweep(make_tables([frames_record(), skipped, MEASURED]), tmp_path, Console(file=shown, width=80))
    told = " ".join(shown.getvalue().split())
    assert "4,000.0 ms 1.50 0.25 0.50 1.00 0" in told
    assert f"skipped: box, multiframe, frames 2, motion eyes, aligned, 4 {TIMES} 1, culling on" in shown.getvalue()


def test_frames_are_no_evidence_for_the_paper_s_claims_about_one_image():
    triangles = {"scene": "cornell_box", "triangles": 1112}
    several = make_table([frames_record(configuration=frames_record().configuration | triangles)])
    with pytest.raises(NotMeasuredError):
        collect_scenes(several)
    one = Record(**{**vars(MEASURED), "configuration": MEASURED.configuration | triangles})
    both = pd.concat([several, make_table([one])])
    assert len(collect_scenes(both)["cornell_box"].rows) == 1
