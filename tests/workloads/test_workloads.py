"""Each workload of a point, measured for real at toy size."""

import base64
import io
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from atra.alignment.visible_first import VisibleFirst
from experiments.harness.processes.worker import read_point
from experiments.methods import METHODS
from experiments.registry import KINDS
from experiments.workloads import WORKLOADS, rounds
from experiments.workloads.rounds import expert_packet_widths
from tests import points
from tests.points import POINT

pytestmark = pytest.mark.uncovered


def measured(workload, method="aligned", **options):
    """What a point of the workload tells; options are the method's, by default 4 cells."""
    return points.measured(method, workload, options=options)


@pytest.mark.parametrize("workload", WORKLOADS, ids=lambda workload: workload.name)
def test_a_point_of_any_method_and_workload_comes_back_from_plain_values(workload):
    for method in METHODS:
        of = {"method": method, "options": method.options(), "workload": workload}
        point = replace(POINT, **of, workload_options=workload.options())
        assert read_point(json.loads(json.dumps(point.configuration())), KINDS) == point


def test_a_frame_has_samples_of_every_native_width_from_8_on_and_judges_every_pixel():
    outcome = measured("frame")
    methods = {"own", "rtcIntersect1", *(f"packets_{width}" for width in expert_packet_widths())}
    assert {name: len(values) for name, values in outcome.samples.items()} == dict.fromkeys(methods, 3)
    assert {name: len(values) for name, values in outcome.warmup_samples.items()} == dict.fromkeys(methods, 1)
    assert sum(outcome.results[f"pixels_{kind}"] for kind in ("equal", "tied", "edge", "wrong")) == 48 * 32
    assert outcome.results["pixels_wrong"] == 0


def test_an_expert_tries_every_native_width_from_8_on_or_else_the_widest(monkeypatch):
    expected = {(1, 4, 8, 16): (8, 16), (1, 4, 8): (8,), (1, 4): (4,), (1,): (1,)}
    for native, widths in expected.items():
        library = SimpleNamespace(native_packet_widths=native)
        monkeypatch.setattr(rounds, "load_library", lambda library=library: library)
        assert expert_packet_widths() == widths


def test_a_timed_point_plans_and_builds_five_times_but_not_again_what_takes_long(monkeypatch):
    results = measured("frame").results
    for name in ("plan", "build"):
        assert len(results[f"{name}_samples_s"]) == 5
        assert results[f"{name}_time_s"] == sorted(results[f"{name}_samples_s"])[2]
    monkeypatch.setattr(rounds, "BUILDS_BUDGET_S", 0.0)
    results = measured("frame").results
    assert len(results["plan_samples_s"]) == len(results["build_samples_s"]) == 1


BUILT = ("plan", "build", "baseline_build")


def test_a_build_is_timed_by_the_method_s_own_clocks(monkeypatch):
    prepare = VisibleFirst.prepare

    def slowly(*arguments):
        prepared = prepare(*arguments)
        prepared.plan_time_s += 1000.0
        prepared.build_time_s += 2000.0
        return prepared

    monkeypatch.setattr(VisibleFirst, "prepare", slowly)
    outcome = measured("build", method="visible_first")
    assert all(1000 < plan < 1100 for plan in outcome.samples["plan"])
    assert all(2000 < build < 2100 for build in outcome.samples["build"])
    assert all(0 < build < 100 for build in outcome.samples["baseline_build"])
    for samples, count in ((outcome.samples, 3), (outcome.warmup_samples, 1)):
        assert {name: len(values) for name, values in samples.items()} == dict.fromkeys(BUILT, count)


@pytest.mark.parametrize("fields", [{}, {"geometry": "instanced"}, {"method": "pixel"}])
def test_a_memory_has_the_bytes_of_each_step_and_no_times(fields):
    outcome = measured("memory", **fields)
    results = outcome.results
    assert outcome.samples == {}
    assert min(results[name] for name in ("rss_start_bytes", "rss_mesh_bytes", "embree_bytes")) > 0
    assert results["rss_bytes"] <= results["peak_rss_bytes"]
    assert not [name for name in results if name.endswith("_s")]
    # But for the one that no copy can show, four cells of an instance share its triangles.
    if "geometry" in fields:
        copied = measured("memory", culling=False).results
        assert 0.99 < copied["triangles_traced"] / (4 * results["triangles_traced"]) <= 1


def test_the_pictures_have_the_image_s_size_and_the_difference_marks_what_the_counts_tell():
    results = measured("picture").results
    files = {name: io.BytesIO(base64.b64decode(text)) for name, text in results["pictures"].items()}
    images = {name: np.asarray(Image.open(file).convert("RGB")) for name, file in files.items()}
    shapes = {name: image.shape for name, image in images.items()}
    assert shapes == dict.fromkeys(("aligned", "pixel", "difference"), (32, 48, 3))
    assert results["pixels_wrong"] == 0
    assert len(np.unique(images["aligned"].reshape(-1, 3), axis=0)) > 5  # a shaded scene, no blank
    if results["pixels_equal"] == 48 * 32:
        assert (images["aligned"] == images["pixel"]).all()
        assert (images["difference"] == 255).all()
