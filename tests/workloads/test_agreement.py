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
from experiments.harness.records import Record, write_record
from experiments.methods import METHODS, find_method
from experiments.results.table import make_table
from experiments.workloads import agreement, rounds
from experiments.workloads.agreement import AgreementOptions
from experiments.workloads.agreement.oracle import examine
from experiments.workloads.agreement.shown import (
    agreement_figure,
    errs_too_often,
    read_disagreements,
    sweep_lines,
    write,
)
from tests.drawn import save, words
from tests.judge.reference import brute_force
from tests.meshes import EYE_AT_ORIGIN, quads
from tests.points import planned

pytestmark = pytest.mark.uncovered

OFFSETS = ((0.5, 0.5), (0.25, 0.75))
WIDTH, HEIGHT = 48, 32
FAULT = (20, 10)  # x, y of the pixel that is spoilt


def make_point(**options):
    asked = {"offsets": OFFSETS, "sample_rays": 50, **options}
    return planned("aligned", "agreement", (WIDTH, HEIGHT), asked=asked).point


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


MAKERS = {"method": (rounds, "make_own"), "baseline": (agreement, "make_single")}


def spoil(monkeypatch, who, change):
    """Put a fault into the tracer of the method or of the baseline."""
    module, name = MAKERS[who]
    make = getattr(module, name)
    monkeypatch.setattr(module, name, lambda *arguments: Spoilt(make(*arguments), change))


def at_fault(found):
    listed = pd.DataFrame(found.results["disagreements"])
    return listed[(listed["x"] == FAULT[0]) & (listed["y"] == FAULT[1])]


@pytest.fixture(scope="module")
def sound():
    return agreement.measure(make_point())


def test_every_offset_is_an_image_every_disagreement_a_row(sound):
    results = sound.results
    assert results["images"] == len(OFFSETS)
    kinds = ("equal", "tied", "edge", "wrong")
    assert sum(results[f"pixels_{kind}"] for kind in kinds) == len(OFFSETS) * WIDTH * HEIGHT
    assert results["pixels_wrong"] == 0
    assert results["rays_sampled"] == len(OFFSETS) * 50
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
    found = agreement.measure(make_point())
    rows = at_fault(found)
    assert list(zip(rows["offset_x"], rows["offset_y"], strict=True)) == list(OFFSETS)
    assert set(rows["verdict"]) == {"wrong"}
    assert set(rows[f"{who}_correctness"]) == {correctness}
    assert set(rows[f"{other}_correctness"]) == {"right"}
    assert (rows[f"{other}_prim_id"] == rows["truth_prim_id"]).all()
    assert found.results[f"{who}_wrong"] == sound.results[f"{who}_wrong"] + len(OFFSETS)
    assert found.results[f"{other}_wrong"] == sound.results[f"{other}_wrong"]
    assert found.results["pixels_wrong"] == len(OFFSETS)


def test_the_sample_counts_what_both_get_wrong_alike(sound, monkeypatch):
    for who in MAKERS:
        spoil(monkeypatch, who, see_nothing)
    found = agreement.measure(make_point(sample_rays=WIDTH * HEIGHT))
    rows = at_fault(found)
    assert set(rows["verdict"]) == {"equal"}
    assert rows["sampled"].all()
    assert (found.results["sampled_method_wrong"], found.results["sampled_baseline_wrong"]) >= (2, 2)
    assert found.results["method_wrong"] == sound.results["method_wrong"]


def test_a_tie_is_listed_though_nobody_is_wrong_and_a_miss_is_an_empty_field():
    square = [(-4.0, -4.0, 2.0), (4.0, -4.0, 2.0), (4.0, 4.0, 2.0), (-4.0, 4.0, 2.0)]
    mesh = quads([square, square])
    camera = atra.Camera(**EYE_AT_ORIGIN, fov_y_degrees=60.0, width=4, height=4)
    reference = brute_force(mesh, camera)
    prim_id, depth = reference.prim_id.copy(), reference.depth.copy()
    prim_id[1, 2] += 2  # its twin
    prim_id[3, 0], depth[3, 0] = MISS, np.inf
    hits = replace(reference, prim_id=prim_id, depth=depth)
    found = examine(mesh, camera, hits, reference, atra.compare(hits, reference))
    listed = agreement._disagreements(found, (0.5, 0.5))
    assert list(zip(listed["x"], listed["y"], listed["verdict"], strict=True)) == [(2, 1, "tied"), (0, 3, "wrong")]
    assert listed["method_correctness"] == ["tied", "hole"]
    assert listed["method_prim_id"] == [int(prim_id[1, 2]), None]
    assert listed["method_stored_depth"] == listed["method_depth"] == [2.0, None]


@pytest.mark.parametrize(("options", "message"), [
    ({"offsets": [[0.5, 1.0]]}, r"workload.offsets is \(0.5, 1.0\), expected two numbers in \[0, 1\)"),
    ({"offsets": [[0.5]]}, r"workload.offsets is \(0.5,\)"),
    ({"offsets": []}, "workload.offsets is empty"),
    ({"sample_rays": -1}, "workload.sample_rays is -1"),
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


def rows_of_three():
    """A tie, a wrong method beside the triangle, and a pixel of the sample where both see nothing."""
    columns = {
        "offset_x": [0.5, 0.5, 0.25], "offset_y": [0.5, 0.5, 0.75], "x": [1, 7, 3], "y": [2, 5, 0],
        "verdict": ["tied", "edge", "equal"], "sampled": [False, False, True],
        "truth_prim_id": [4, 5, 6], "truth_depth": [1.0, 2.0, 3.0], "truth_edge_distance": [0.1, 0.2, 0.3],
        "truth_exhaustive": [True, True, True],
    }  # fmt: skip
    for who, standings in (
        ("method", ["tied", "wrong triangle", "wrong triangle"]),
        ("baseline", ["right", "right", "wrong triangle"]),
    ):
        columns |= {
            f"{who}_prim_id": [4, 7, None], f"{who}_stored_depth": [1.0, 2.5, None], f"{who}_depth": [1.0, 2.5, None],
            f"{who}_edge_distance": [0.1, -1e-5, None], f"{who}_correctness": standings,
            f"{who}_off_by": [0.0, 1e-5, 0.3],
        }  # fmt: skip
    return columns


def written(folder, *records):
    for record in records:
        write_record(folder, record)
    return make_table(records)


def test_the_list_says_of_every_row_which_point_it_is_from_and_who_was_wrong(tmp_path):
    table = written(tmp_path, make_record("a", rows_of_three()), make_record("b"), make_record("c", rows_of_three(), split_x=4))  # fmt: skip  # noqa: E501
    write(tmp_path, tmp_path, table)
    rows = list(csv.DictReader(io.StringIO((tmp_path / "disagreements.csv").read_text())))
    assert [(row["scene"], row["split_x"], row["x"], row["y"], row["wrong"]) for row in rows] == [
        ("box", split, *place)
        for split in "24"
        for place in (("1", "2", "neither"), ("7", "5", "method"), ("3", "0", "both"))
    ]  # fmt: skip
    assert (rows[1]["method_prim_id"], rows[1]["method_edge_distance"], rows[2]["method_prim_id"]) == (
        "7",
        "-1e-05",
        "",
    )


def test_the_list_blames_the_baseline_where_it_alone_is_wrong(tmp_path):
    columns = rows_of_three() | {"method_correctness": ["right"] * 3, "baseline_correctness": ["wrong depth"] * 3}
    table = written(tmp_path, make_record("a", columns))
    assert list(read_disagreements(table, tmp_path)["wrong"]) == ["baseline"] * 3


def test_the_picture_marks_the_pixels_that_differ(tmp_path):
    table = written(tmp_path, make_record("a", rows_of_three()), make_record("b", scene="../none"))
    write(tmp_path, tmp_path, table)
    pictures = {path.name: np.asarray(Image.open(path).convert("RGB")) for path in tmp_path.glob("*.png")}
    assert set(pictures) == {"disagreements_box_8x6.png", "disagreements_.._none_8x6.png"}
    marked = pictures["disagreements_box_8x6.png"]
    assert marked.shape == (6, 8, 3)
    assert (tuple(marked[2, 1]), tuple(marked[5, 7]), tuple(marked[0, 7])) == ((0, 114, 178), (230, 159, 0), (255,) * 3)
    assert (pictures["disagreements_.._none_8x6.png"] == 255).all()


def test_a_table_without_agreement_leaves_no_list(tmp_path):
    write(tmp_path, tmp_path, make_table([]))
    assert list(tmp_path.iterdir()) == []


def test_the_line_of_a_scene_sums_its_points_and_names_who_errs_too_often():
    fine, beyond = make_record("a"), make_record("b", method="tiles", method_wrong=3)
    (line,) = sweep_lines(make_table([fine, beyond]))
    assert line == (
        "box: 200 pixels in 4 images, 0 wrong, 6 edge, 4 tied; by float64 methods err at 5 of these, rtcIntersect1 at "
        "2, more than 2 times as often: culled tiles 3 against 1; of 20 sampled rays at 2 and 0"
    )
    other = make_record("c", scene="ball")
    assert [one.partition(":")[0] for one in sweep_lines(make_table([fine, other]))] == ["box", "ball"]
    assert "no method over 2 times" in next(sweep_lines(make_table([fine])))


@pytest.mark.parametrize(
    ("method", "baseline", "too_often"), [(0, 0, False), (2, 1, False), (3, 1, True), (1, 0, True)]
)
def test_twice_the_baseline_s_errors_are_allowed_and_no_more(method, baseline, too_often):
    table = make_table([make_record("a", method_wrong=method, baseline_wrong=baseline)])
    assert errs_too_often(table) is too_often


def said(table):
    figure = agreement_figure(table)
    save(figure)
    return words(figure)


def test_the_figure_draws_method_beside_baseline_and_writes_the_counts():
    table = make_table(
        [make_record("a"), make_record("b", split_x=4), make_record("c", method="tiles", method_wrong=9)]
    )
    (panel,) = agreement_figure(table).panels
    assert [bar.value for bar in panel.bars] == [4, 2, 9, 1]
    told = said(table)
    assert "4 : 2 of 0.0002 M pixels; 0 wrong, 6 edge, 4 tied" in told
    assert "9 : 1, over 2\N{MULTIPLICATION SIGN}" in told
    assert "of 30 rays drawn from all pixels" in told.replace("\n   ", " ")
    assert "6 images" in told


def test_the_figure_copes_with_no_rows_with_points_not_measured_and_with_missing_values():
    skipped = replace(make_record("s", method="tiles"), status="skipped", error="needs 9 GiB of memory", results={})
    table = make_table([make_record("a"), skipped])
    assert "tiles, 2 \N{MULTIPLICATION SIGN} 1: skipped, needs more memory than its budget" in " ".join(
        said(table).split()
    )
    missing = table.copy()
    kept = ["scene", "status", "method", "geometry", "split_x", "split_y", "workload"]
    missing[[name for name in table.columns if name not in kept]] = pd.NA
    for part in (table.iloc[:0], missing, table.iloc[1:]):
        said(part)
    assert "not measured" in said(missing)


def test_every_method_has_a_name_in_the_figure():
    rows = [make_record(method.name, method=method.name) for method in METHODS]
    rows += [make_record("i", geometry="instanced", culling=False), make_record("s", packet_width=1)]
    told = said(make_table(rows))
    for name in ("aligned, culling on", "aligned, instanced", "packets of 8 per pixel", "visible-first", "embreex"):
        assert name in told
