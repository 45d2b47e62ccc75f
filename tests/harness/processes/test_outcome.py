"""A worker's result comes through unchanged, and an incomplete one is refused with the reason."""

from dataclasses import replace

import pytest

from experiments.harness.options import NoOptions
from experiments.harness.point import Point
from experiments.harness.processes.worker import read_result
from experiments.harness.records import Record
from experiments.methods.aligned import ALIGNED, AlignedOptions
from experiments.workloads.build import BUILD
from experiments.workloads.frame import FRAME
from experiments.workloads.memory import MEMORY as MEMORY_WORKLOAD
from experiments.workloads.multiframe import MULTIFRAME, MultiframeOptions
from experiments.workloads.picture import PICTURE

POINT = Point(
    scene="box", scene_source="procedural", scene_path=None, mesh_sha256="0", triangles=1, view="own",
    eye=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov_y_degrees=60.0, width=8, height=8,
    method=ALIGNED, options=AlignedOptions(split_x=1, packet_width=1), workload=FRAME, workload_options=NoOptions(),
    threads=1, ties="lowest", build_quality="medium", rounds=4, warmup=1, frame_budget_s=1.0, time_limit_s=30.0,
    memory_budget_gib=1.0,
)  # fmt: skip
MEMORY = {
    "triangles_traced": 1, "packet_width": 1, "threads": 1, "rss_start_bytes": 60, "rss_mesh_bytes": 80,
    "rss_bytes": 100, "peak_rss_bytes": 120,
}  # fmt: skip
COUNTS = {
    "pixels_equal": 60, "pixels_tied": 2, "pixels_edge": 1, "pixels_wrong": 1, "pixels_hole": 0,
    "baseline_pixels_hole": 0, "depth_error_max": 1e-7, "depth_error_p999": 1e-7, "baseline_depth_error_max": 1e-7,
    "baseline_depth_error_p999": 1e-7,
}  # fmt: skip
TIMES = {"plan_time_s": 0.0, "build_time_s": 0.1, "baseline_build_time_s": 0.1, "rounds": 3}
ROUNDS = {"rounds": 4}
METHODS = ("own", "rtcIntersect1", "packets_8")
GOOD = Record(
    "",
    "ok",
    warmup_samples={name: [1.0] for name in METHODS},
    samples={name: [0.5, 0.25, 0.5] for name in METHODS},
    results=MEMORY | COUNTS | TIMES,
)


def test_a_good_result_comes_through_unchanged():
    assert read_result(GOOD.to_json(), POINT) == GOOD


def timed(*names):
    return {"warmup_samples": {name: [1.0] for name in names}, "samples": {name: [1.0] * 4 for name in names}}


@pytest.mark.parametrize(("point", "changes"), [
    (replace(POINT, workload=MEMORY_WORKLOAD), timed() | {"results": MEMORY}),
    (replace(POINT, workload=BUILD), timed("plan", "build", "baseline_build") | {"results": MEMORY | ROUNDS}),
    (replace(POINT, workload=PICTURE), timed() | {"results": MEMORY | COUNTS | {"pictures": {}}}),
    (
        replace(POINT, workload=MULTIFRAME, workload_options=MultiframeOptions()),
        timed(*METHODS, "separate", "visible_first", "rasteriser")
        | {"results": MEMORY | COUNTS | TIMES | ROUNDS | {"pixels_equal": 124, "separate_embree_bytes": 9}},
    ),
])  # fmt: skip
def test_each_workload_has_results_of_its_own(point, changes):
    outcome = replace(GOOD, **changes)
    assert read_result(outcome.to_json(), point) == outcome


@pytest.mark.parametrize("name", sorted({*GOOD.results, *METHODS} - {"rounds"}))
def test_a_measured_point_with_something_missing_is_refused(name):
    results = {key: value for key, value in GOOD.results.items() if key != name}
    samples = {key: value for key, value in GOOD.samples.items() if key != name}
    with pytest.raises(ValueError, match=f"status ok without .*{name}"):
        read_result(replace(GOOD, results=results, samples=samples).to_json(), POINT)


@pytest.mark.parametrize("status", ["failed", "skipped"])
def test_what_was_not_measured_needs_nothing_but_a_reason(status):
    outcome = Record("", status, "the reason")
    assert read_result(outcome.to_json(), POINT) == outcome


def test_a_worker_cannot_write_a_number_that_is_none():
    with pytest.raises(ValueError, match="not JSON compliant"):
        replace(GOOD, results={"build_time_s": float("nan")}).to_json()
