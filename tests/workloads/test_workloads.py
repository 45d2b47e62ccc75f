"""Workloads of a point at toy size: frames, builds, memory, pictures, gathered hits, questions of rays."""

import base64
import io
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import atra
from atra.alignment.visible_first import VisibleFirst
from atra.errors import InputError
from experiments.drawing.style import TIMES
from experiments.harness.processes.worker import read_point
from experiments.methods import METHODS
from experiments.registry import KINDS
from experiments.workloads import WORKLOADS, rounds
from experiments.workloads.frame.shown import best_baselines, process_lines
from experiments.workloads.gather import CLOSED, GatherOptions, differences
from experiments.workloads.rays.judging import judged, sample_of, truth_of
from experiments.workloads.rounds import expert_packet_widths, own_and_baselines, warm_up
from tests import points
from tests.closed_meshes import box
from tests.drawn import make_rows, method_row
from tests.meshes import cornell_box, cornell_camera
from tests.points import POINT, planned

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


def counted(count):
    return atra.CountResult(np.array(count, np.uint32), (0.5, 0.5), cornell_box(), cornell_camera(2, 2))


def test_lost_and_doubled_hits_are_counted_and_do_not_cancel():
    found = differences(counted([[1, 5], [0, 2]]), counted([[2, 4], [0, 2]]), atra.Count())
    assert found == {"hits_in_all": 8, "hits_missing": 1, "hits_too_many": 1, "pixels_different": 2}


def test_a_layer_of_another_triangle_is_a_different_pixel_and_the_same_depth_to_rounding_is_none():
    with atra.PixelTracer(cornell_box(), cornell_camera(8, 8), threads=1) as tracer:
        single = tracer.gather(atra.Layers(2))
    nudged = replace(single, depth=single.depth * np.float32(1 + 1e-7))
    assert differences(nudged, single, atra.Layers(2))["pixels_different"] == 0
    other = single.prim_id.copy()
    other[0, 3, 4] ^= 1
    assert differences(replace(single, prim_id=other), single, atra.Layers(2))["pixels_different"] == 1


def test_what_no_ray_could_gather_is_refused_before_anything_is_measured():
    with pytest.raises(InputError, match="k is 0"):
        GatherOptions("layers", layers=0)
    with pytest.raises(InputError, match="transmittance is 2"):
        GatherOptions("transmittance", factor=2.0)
    with pytest.raises(InputError, match="method=trimesh finds the nearest hit"):
        planned("trimesh", "gather")


def test_a_warm_up_has_something_that_no_copy_shows_and_leaves_few_samples_undecided():
    point = planned("aligned", "gather", (64, 64)).point
    left_out, undecided = [], []

    def gather(tracer):
        tracer.gather(atra.Count())
        left_out.append(tracer.counters.get("triangles_left_out"))
        undecided.append(len(tracer.prepared._all_hits._undecided[1].keys))

    warm_up(point, own_and_baselines(), gather, CLOSED)
    assert left_out[0] > 0
    assert 0 < max(undecided) < 64 * 64 / 4


MISS = np.uint32(atra.MISS)


@pytest.fixture(scope="module")
def rays():
    """Four rays upwards at the unit square of triangles 0 and 1 at z = 1, and of 2 and 3 at z = 2; the last misses."""
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    vertices = np.concatenate([np.insert(square, 2, z, axis=1) for z in (1, 2)])
    mesh = atra.Mesh(vertices, np.array([(0, 1, 2), (0, 2, 3), (4, 5, 6), (4, 6, 7)]))
    origins = np.array([(0.75, 0.25, 0), (0.25, 0.75, 0), (0.75, 0.25, 1.5), (2, 2, 0)], np.float32)
    return mesh, origins, np.tile(np.array([(0, 0, 1)], np.float32), (4, 1))


@pytest.mark.parametrize(
    ("question", "answer", "lost", "extra"),
    [
        ("closest", [0, 1, 2, MISS], 0, 0),
        ("closest", [0, MISS, 2, MISS], 1, 0),
        ("closest", [2, 1, 2, MISS], 1, 0),  # the farther one
        ("closest", [0, 1, 2, 3], 0, 1),
        ("any", [True, True, True, False], 0, 0),
        ("any", [False, True, True, True], 1, 1),
        ("count", [2, 2, 1, 0], 0, 0),
        ("count", [0, 3, 1, 0], 2, 1),
        ("all", ([0, 0, 1, 1, 2], [0, 2, 3, 1, 2]), 0, 0),
        ("all", ([0, 1, 1, 1, 2, 3], [0, 3, 1, 1, 2, 0]), 1, 2),  # one lacks, one is there twice, one not at all
    ],
)
def test_lost_and_extra_hits_are_counted(rays, question, answer, lost, extra):
    mesh, origins, directions = rays
    truth = truth_of(question, mesh, origins, directions)
    given = tuple(map(np.array, answer)) if isinstance(answer, tuple) else np.array(answer)
    assert judged(question, given, np.arange(4), truth, mesh, (origins, directions)) == (lost, extra)
    assert truth.hits == (5 if question in ("count", "all") else 3)


def test_only_sampled_rays_are_judged(rays):
    mesh, origins, directions = rays
    sample = np.array([1, 3])
    some = origins[sample], directions[sample]
    truth = truth_of("all", mesh, *some)
    answer = np.array([0, 1, 3]), np.array([0, 1, 0])  # of ray 0 nothing is known, ray 1 lacks one, ray 3 has none
    assert judged("all", answer, sample, truth, mesh, some) == (1, 1)
    assert list(sample_of(5, 9)) == [0, 1, 2, 3, 4]


def test_points_are_judged_by_parity():
    points = np.array([(0, 0, 0), (0.5, 0.5, 0.5), (3, 0, 0)], np.float32)
    truth = truth_of("contains", box(), points)
    assert truth.hits == 2
    answer = np.array([True, False, True])
    assert judged("contains", answer, np.arange(3), truth, box(), (points,)) == (1, 1)


NOISE = (0.99, 1.01, 1.0, 1.005, 0.995, 1.0)


def rows_of(name, ratios, **fields):
    return [
        method_row("pixel", ratio=ratio, point_id=name, packet_width=16, coherent=True, process=place) | fields
        for place, ratio in enumerate(ratios)
    ]


def table(*rows):
    return make_rows(*(one for several in rows for one in several))


def test_the_fastest_of_a_scene_is_told_with_its_margin():
    usual, wide = rows_of("usual", NOISE), rows_of("wide", tuple(1.1 * one for one in NOISE), packet_rows="2")
    others = [rows_of(name, NOISE, scene="flat", packet_rows=rows) for name, rows in (("a", "1"), ("b", "automatic"))]
    best, flat = best_baselines(table(usual, wide, *others))
    assert (best.scene, best.name, best.tried) == ("box", f"packets of 16 per pixel, 8 {TIMES} 2 pixels", 2)
    assert best.margin.value == pytest.approx(1.1, rel=0.01)
    assert best.is_faster
    assert not flat.is_faster


def test_what_stood_out_in_the_processes_that_chose_it_alone_is_noise():
    lucky = rows_of("lucky", (1.3, 1.3, 1.3, 1.0, 1.01, 0.99), coherent=False)
    lines = list(process_lines(table(rows_of("usual", NOISE), lucky)))
    assert "incoherent, 1.00 [0.98, 1.03] times as fast as the usual packets (no more than noise)" in lines[0]
    assert lines[1] == "nowhere are ray packets faster than the usual ones by more than noise"


def test_too_few_processes_decide_nothing_and_the_usual_packets_alone_leave_no_choice():
    rows = table(rows_of("usual", (1.0, 1.0)), rows_of("robust", (1.2, 1.2), robust=True))
    assert list(process_lines(rows)) == ["best of 2 ray packets, box: packets of 16 per pixel, robust (not decided)"]
    single = [row | {"packet_width": 1} for row in rows_of("single", NOISE)]
    assert not list(best_baselines(table(rows_of("usual", NOISE), single)))
