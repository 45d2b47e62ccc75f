"""From disagreement to list, line and figure: a fault put into one pixel comes out with the right name on it."""

import csv
import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import atra
from atra.prim_ids import MISS
from experiments.drawing.style import TIMES
from experiments.harness import point
from experiments.harness.records import Record, write_record
from experiments.methods import METHODS, find_method
from experiments.results.table import make_table
from experiments.workloads import agreement
from experiments.workloads.agreement import AgreementOptions
from experiments.workloads.agreement.shown import agreement_figure, errs_too_often, sweep_lines, write
from tests.drawn import save, unfolded
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


MAKERS = {"method": (point, "make_own"), "baseline": (agreement, "make_single")}


def spoil(monkeypatch, who, change):
    """Put a fault into the tracer of the method or of the baseline."""
    module, name = MAKERS[who]
    make = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *arguments: Spoilt(make(*arguments), change))


def at_fault(got):
    listed = pd.DataFrame(got.results["disagreements"])
    return listed[(listed["x"] == FAULT[0]) & (listed["y"] == FAULT[1])]


@pytest.fixture(scope="module")
def sound():
    return measured()


def test_every_offset_is_an_image_every_disagreement_a_row(sound):
    results, kinds = sound.results, ("equal", "tied", "edge", "wrong")
    assert (results["images"], results["rays_sampled"], results["pixels_wrong"]) == (2, 2 * 50, 0)
    assert sum(results[f"pixels_{kind}"] for kind in kinds) == 2 * WIDTH * HEIGHT
    listed = pd.DataFrame(results["disagreements"])
    for kind in kinds[1:]:
        assert (listed["verdict"] == kind).sum() == results[f"pixels_{kind}"]


@pytest.mark.parametrize(("who", "other"), [("method", "baseline"), ("baseline", "method")])
@pytest.mark.parametrize(("change", "correctness"), [
    (name_another_triangle, "wrong triangle"), (see_nothing, "hole"), (store_another_depth, "wrong depth"),
])  # fmt: skip
def test_a_fault_in_one_pixel_is_listed_and_counted_against_who_made_it(
    sound, monkeypatch, who, other, change, correctness
):
    spoil(monkeypatch, who, change)
    got = measured()
    rows = at_fault(got)
    assert list(zip(rows["offset_x"], rows["offset_y"], strict=True)) == list(OFFSETS)
    assert set(rows["verdict"]) == {"wrong"}
    assert (set(rows[f"{who}_correctness"]), set(rows[f"{other}_correctness"])) == ({correctness}, {"right"})
    assert (rows[f"{other}_prim_id"] == rows["truth_prim_id"]).all()
    assert got.results[f"{who}_wrong"] == sound.results[f"{who}_wrong"] + len(OFFSETS)
    assert got.results[f"{other}_wrong"] == sound.results[f"{other}_wrong"]
    assert got.results["pixels_wrong"] == len(OFFSETS)


def test_the_sample_counts_what_both_get_wrong_alike(sound, monkeypatch):
    for who in MAKERS:
        spoil(monkeypatch, who, see_nothing)
    got = measured(sample_rays=WIDTH * HEIGHT)
    assert set(at_fault(got)["verdict"]) == {"equal"}
    assert (got.results["sampled_method_wrong"], got.results["sampled_baseline_wrong"]) >= (2, 2)
    assert got.results["method_wrong"] == sound.results["method_wrong"]
    assert at_fault(got)["method_prim_id"].isna().all()  # a miss is an empty field


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


def make_record(name, listed=None, **fields):
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
    results = counts | {"disagreements": listed or {"x": []}}
    return Record(name, "ok", None, configuration, {"cpu": "some cpu"}, results=results)


def rows_of_four():
    """A tie, a wrong method beside the triangle, a pixel of the sample where both see nothing, a wrong baseline."""
    columns = {
        "offset_x": [0.5, 0.5, 0.25, 0.5], "offset_y": [0.5, 0.5, 0.75, 0.5], "x": [1, 7, 3, 4], "y": [2, 5, 0, 0],
        "verdict": ["tied", "edge", "equal", "wrong"], "sampled": [False, False, True, False],
        "truth_prim_id": [4, 5, 6, 7], "truth_depth": [1.0, 2.0, 3.0, 4.0], "truth_edge_distance": [0.1] * 4,
        "truth_exhaustive": [True] * 4,
    }  # fmt: skip
    for who, standings in (
        ("method", ["tied", "wrong triangle", "wrong triangle", "right"]),
        ("baseline", ["right", "right", "wrong triangle", "wrong depth"]),
    ):
        columns |= {
            f"{who}_prim_id": [4, 7, None, 7], f"{who}_stored_depth": [1.0, 2.5, None, 4.0],
            f"{who}_depth": [1.0, 2.5, None, 4.0], f"{who}_edge_distance": [0.1, -1e-5, None, 0.1],
            f"{who}_correctness": standings, f"{who}_off_by": [0.0, 1e-5, 0.3, 0.0],
        }  # fmt: skip
    return columns


def write_of(folder, *records):
    for record in records:
        write_record(folder, record)
    write(folder, folder, make_table(records))


def test_the_list_says_of_every_row_which_point_it_is_from_and_who_was_wrong(tmp_path):
    write_of(tmp_path, make_record("a", rows_of_four()), make_record("b"), make_record("c", rows_of_four(), split_x=4))
    rows = list(csv.DictReader(io.StringIO((tmp_path / "disagreements.csv").read_text())))
    assert [(row["scene"], row["split_x"], row["x"], row["wrong"]) for row in rows] == [
        ("box", split, *told)
        for split in "24"
        for told in (("1", "neither"), ("7", "method"), ("3", "both"), ("4", "baseline"))
    ]
    told = (rows[1]["method_prim_id"], rows[1]["method_edge_distance"], rows[2]["method_prim_id"])
    assert told == ("7", "-1e-05", "")


def test_the_picture_marks_the_pixels_that_differ_and_a_table_without_agreement_leaves_none(tmp_path):
    write(tmp_path, tmp_path, make_table([]))
    assert list(tmp_path.iterdir()) == []
    write_of(tmp_path, make_record("a", rows_of_four()), make_record("b", scene="../none"))
    pictures = {path.name: np.asarray(Image.open(path).convert("RGB")) for path in tmp_path.glob("*.png")}
    assert set(pictures) == {"disagreements_box_8x6.png", "disagreements_.._none_8x6.png"}
    marked = pictures["disagreements_box_8x6.png"]
    assert marked.shape == (6, 8, 3)
    assert (tuple(marked[2, 1]), tuple(marked[5, 7]), tuple(marked[0, 7])) == ((0, 114, 178), (230, 159, 0), (255,) * 3)
    assert (pictures["disagreements_.._none_8x6.png"] == 255).all()


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


def said(table):
    figure = agreement_figure(table)
    save(figure)
    return unfolded(figure)


def test_the_figure_draws_every_method_beside_the_baseline_and_writes_the_counts():
    records = [make_record("a"), make_record("b", split_x=4), make_record("c", method="tiles", method_wrong=9)]
    (panel,) = agreement_figure(make_table(records)).panels
    assert [bar.value for bar in panel.bars] == [4, 2, 9, 1]
    told = said(make_table(records))
    for text in ("4 : 2 of 0.0002 M pixels; 0 wrong, 6 edge, 4 tied", f"9 : 1, over 2{TIMES}", "6 images",
                 "of 30 rays drawn from all pixels"):  # fmt: skip
        assert text in told
    rows = [make_record(method.name, method=method.name) for method in METHODS]
    rows += [make_record("i", geometry="instanced", culling=False), make_record("s", packet_width=1)]
    told = said(make_table(rows))
    for name in ("aligned, culling on", "aligned, instanced", "packets of 8 per pixel", "visible-first", "embreex"):
        assert name in told


def test_the_figure_copes_with_no_rows_with_points_not_measured_and_with_missing_values():
    skipped = replace(make_record("s", method="tiles"), status="skipped", error="needs 9 GiB of memory", results={})
    table = make_table([make_record("a"), skipped])
    assert f"tiles, 2 {TIMES} 1: skipped, needs more memory than its budget" in said(table)
    missing = table.copy()
    kept = ["scene", "status", "method", "geometry", "split_x", "split_y", "workload"]
    missing[[name for name in table.columns if name not in kept]] = pd.NA
    said(table.iloc[:0])
    assert "not measured" in said(missing)
