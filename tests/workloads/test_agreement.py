"""From disagreement to line: a fault put into one pixel is counted against the right one."""

import numpy as np
import pytest

import atra
from atra.prim_ids import MISS
from experiments.harness import point
from experiments.harness.records import Record
from experiments.methods import find_method
from experiments.results.table import make_table
from experiments.workloads import agreement
from experiments.workloads.agreement import AgreementOptions
from experiments.workloads.agreement.shown import errs_too_often, sweep_lines
from tests.points import planned

pytestmark = pytest.mark.uncovered

OFFSETS = ((0.5, 0.5), (0.25, 0.75))
WIDTH, HEIGHT = 48, 32
FAULT = (20, 10)
"""x, y of the pixel that is spoilt."""


def measured(**options):
    asked = {"offsets": OFFSETS, "sample_rays": 50, **options}
    return agreement.measure(planned("aligned", "agreement", (WIDTH, HEIGHT), asked=asked).point)


class Spoilt:
    """A tracer whose image has one answer changed at FAULT, at every offset."""

    def __init__(self, tracer, change):
        self._tracer, self._change = tracer, change

    def __getattr__(self, name):
        return getattr(self._tracer, name)

    def __enter__(self):
        self._tracer.__enter__()
        return self

    def __exit__(self, *error):
        self._tracer.close()

    def trace(self, offset):
        hits = self._tracer.trace(offset)
        self._change(hits, (FAULT[1], FAULT[0]))
        return hits


def name_another_triangle(hits, place):
    hits.prim_id[place] = (hits.prim_id[place] + 500) % hits.mesh.triangle_count


def store_another_depth(hits, place):
    hits.depth[place] *= 1.01


def see_nothing(hits, place):
    hits.prim_id[place], hits.depth[place] = MISS, np.inf


HOLES = {"method": "pixels_hole", "baseline": "baseline_pixels_hole"}
MAKERS = {"method": (point, "make_own"), "baseline": (agreement, "make_single")}


def spoil(monkeypatch, who, change):
    """Put a fault into the tracer of the method or of the baseline."""
    module, name = MAKERS[who]
    make = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *arguments: Spoilt(make(*arguments), change))


@pytest.fixture(scope="module")
def sound():
    return measured()


def test_every_offset_is_an_image(sound):
    results, kinds = sound.results, ("equal", "tied", "edge", "wrong")
    assert (results["images"], results["rays_sampled"], results["pixels_wrong"]) == (2, 2 * 50, 0)
    assert sum(results[f"pixels_{kind}"] for kind in kinds) == 2 * WIDTH * HEIGHT


@pytest.mark.parametrize(("who", "other"), [("method", "baseline"), ("baseline", "method")])
@pytest.mark.parametrize(("change", "holes"), [(name_another_triangle, 0), (see_nothing, 1), (store_another_depth, 0)])
def test_a_fault_in_one_pixel_is_counted_against_who_made_it(sound, monkeypatch, who, other, change, holes):
    spoil(monkeypatch, who, change)
    got = measured()
    assert got.results[f"{who}_wrong"] == sound.results[f"{who}_wrong"] + len(OFFSETS)
    assert got.results[f"{other}_wrong"] == sound.results[f"{other}_wrong"]
    assert got.results[HOLES[who]] == sound.results[HOLES[who]] + holes * len(OFFSETS)
    assert got.results[HOLES[other]] == sound.results[HOLES[other]]
    assert got.results["pixels_wrong"] == len(OFFSETS)


def test_the_sample_counts_what_both_get_wrong_alike(sound, monkeypatch):
    whole = measured(sample_rays=WIDTH * HEIGHT)
    for who in MAKERS:
        spoil(monkeypatch, who, see_nothing)
    got = measured(sample_rays=WIDTH * HEIGHT)
    for who in MAKERS:
        assert got.results[f"sampled_{who}_wrong"] == whole.results[f"sampled_{who}_wrong"] + len(OFFSETS)
    assert got.results["method_wrong"] == sound.results["method_wrong"]


@pytest.mark.parametrize(("options", "message"), [
    ({"offsets": [[0.5, 1.0]]}, r"workload.offsets is \(0.5, 1.0\), expected two numbers in \[0, 1\)"),
    ({"offsets": []}, "workload.offsets is empty"), ({"sample_rays": -1}, "workload.sample_rays is -1"),
])  # fmt: skip
def test_offsets_outside_the_pixel_and_negative_samples_are_refused(options, message):
    with pytest.raises(atra.InputError, match=message):
        AgreementOptions(**options)


COUNTS = {
    "pixels_equal": 95, "pixels_tied": 2, "pixels_edge": 3, "pixels_wrong": 0, "images": 2, "method_wrong": 2,
    "baseline_wrong": 1, "rays_sampled": 10, "sampled_method_wrong": 1, "sampled_baseline_wrong": 0,
    "packet_width": 8,
}  # fmt: skip


def make_record(name, **fields):
    configuration = {
        "scene": "box", "triangles": 10, "width": 8, "height": 6, "method": "aligned", "threads": 1,
        "workload": "agreement", "view": "own", "fov_y_degrees": 60.0, "workload_options": {},
    }  # fmt: skip
    options = {"split_x": 2, "split_y": 1, "culling": True, "geometry": "copied", "packet_width": 8}
    configuration, options, counts = (
        known | {key: value for key, value in fields.items() if key in known}
        for known in (configuration, options, COUNTS)
    )
    method = find_method(configuration["method"])
    configuration["method_options"] = {key: value for key, value in options.items() if method.has(key)}
    return Record(name, "ok", None, configuration, {"cpu": "some cpu"}, results=counts)


def test_the_line_of_a_scene_sums_its_points_and_names_who_errs_too_often():
    fine, beyond = make_record("a"), make_record("b", method="tiles", method_wrong=3)
    (line,) = sweep_lines(make_table([fine, beyond]))
    assert line == (
        "box: 200 pixels in 4 images, 0 wrong, 6 edge, 4 tied; by float64 methods err at 5 of these, rtcIntersect1 at "
        "2, more than 2 times as often: culled tiles 3 against 1; of 20 sampled rays at 2 and 0"
    )
    lines = list(sweep_lines(make_table([fine, make_record("c", scene="ball")])))
    assert [line.partition(":")[0] for line in lines] == ["box", "ball"]
    assert "no method over 2 times" in lines[0]


@pytest.mark.parametrize(
    ("method", "baseline", "too_often"), [(0, 0, False), (2, 1, False), (3, 1, True), (1, 0, True)]
)
def test_twice_the_baseline_s_errors_are_allowed_and_no_more(method, baseline, too_often):
    table = make_table([make_record("a", method_wrong=method, baseline_wrong=baseline)])
    assert errs_too_often(table) is too_often
