"""Claims on ray classification and its figures, from tables judged by hand, and files of rays beside those kept."""

import csv
from itertools import product

import numpy as np
import pytest

from atra.command.cameras import read_cameras
from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.geometry.camera import Camera
from experiments.classification.classified import CLASSIFIED, ClassifiedOptions
from experiments.classification.ray_files import KINDS, SIZES, run_rays, scene_of
from experiments.classification.workload.claims import CLAIMS, usual_value
from experiments.classification.workload.shown import FIGURES, figure
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED, judge_claim
from experiments.results.table import frame_of
from scenes.built_in import BUILT_IN
from scenes.generated import FAMILIES, generated_scene
from scenes.views import VIEWS
from tests.folders import ROOT
from tests.three_processes import three_processes

pytestmark = pytest.mark.uncovered


BY_ID = {claim.id: claim for claim in CLAIMS}
MEASURED = {
    "steps_ratio": 0.5, "speedup_vs_bvh": 1.3, "speedup_vs_bvh_low": 1.2, "speedup_vs_bvh_high": 1.4,
    "rays_traced": 10**6, "rays_wrong": 0, "rays_different": 0, "rays_from_root": 0, "bytes_touched": 60,
    "plain_bytes_touched": 100, "shafts": 96, "shafts_built": 96, "list_length_mean": 4.0, "list_bytes": 960,
    "lookup_bytes": 400, "entry_height_mean": 5.0, "root_height": 20,
}  # fmt: skip


def row(kind="primary", scene="box", **changes):
    options = {name: usual_value(name) for name in ClassifiedOptions.__dataclass_fields__}
    told = {"scene": scene, "method": CLASSIFIED.name, "workload": "classification", "status": "ok", "ray_kind": kind}
    return told | {"triangles": 12, "stands_for": None} | options | MEASURED | changes


def of_all_kinds(**changes):
    return [row(kind, **changes) for kind in ("primary", "occlusion", "diffuse")]


def quick(speed):
    """A speed over the root that is known well."""
    return {"speedup_vs_bvh": speed, "speedup_vs_bvh_low": 0.999 * speed, "speedup_vs_bvh_high": 1.001 * speed}


def table(*rows):
    return frame_of([{"point_id": str(number)} | row for number, row in enumerate(rows)])


def verdict(claim, *rows):
    (judged,) = judge_claim(BY_ID[claim], three_processes(table(*rows)))
    return judged.verdict


@pytest.mark.parametrize(
    ("claim", "holds", "fails"),
    [
        ("same-hits", [row()], [row(rays_wrong=1)]),
        ("same-hits", [row(rays_different=1)], [row(rays_different=2)]),
        ("fewer-steps", [row(steps_ratio=0.6), row("diffuse"), row("occlusion")],
         [row(steps_ratio=0.8), row("diffuse"), row("occlusion")]),
        ("less-time", of_all_kinds(), of_all_kinds(speedup_vs_bvh_low=1.1, speedup_vs_bvh_high=1.12)),
        ("less-traffic", [row()], [row(), row("diffuse", bytes_touched=101)]),
        ("equal-lists", [row()], [row(list_bytes=96 * 20)]),
        ("lower-subtrees", [row()], [row(entry_height_mean=11.0)]),
        (
            "half-is-best",
            [row(), row(shaft_probability=0.25, steps_ratio=0.495), row(shaft_probability=1.0, steps_ratio=0.9)],
            [row(), row(shaft_probability=0.25, steps_ratio=0.4), row(shaft_probability=1.0, steps_ratio=0.9)],
        ),
        (
            "extremes-lose",
            [row(), row(shaft_probability=0.25, steps_ratio=1.1), row(shaft_probability=1.0, steps_ratio=0.95)],
            [row(), row(shaft_probability=0.25, steps_ratio=0.9), row(shaft_probability=1.0, steps_ratio=0.95)],
        ),
        (
            "occupied-serves-secondary",
            [row("diffuse", shaft_subset="occupied"), row(shaft_subset="occupied", rays_from_root=9)],
            [row("diffuse", shaft_subset="occupied", rays_from_root=9)],
        ),
        (
            "occlusion-helps",
            [row(), row(shaft_occlusion=False, steps_ratio=0.6, list_length_mean=5.0)],
            [row(), row(shaft_occlusion=False, steps_ratio=0.4, list_length_mean=5.0)],
        ),
        (
            "subset-is-efficient",
            [row(), row(shaft_subset="sampled", list_bytes=480, steps_ratio=0.52)],
            [row(), row(shaft_subset="sampled", list_bytes=490, steps_ratio=0.52)],
        ),
        (
            "occupied-as-fast",
            [row("diffuse", **quick(1.3)), row("diffuse", shaft_subset="occupied", **quick(1.25))],
            [row("diffuse", **quick(1.3)), row("diffuse", shaft_subset="occupied", **quick(1.2))],
        ),
        (
            "grows-with-shafts",
            [row(shaft_cells=str(n), shafts=n, shafts_built=n, lookup_bytes=4 * n) for n in (10, 100, 1000, 10000)],
            [row(shaft_cells=str(n), shafts=n, shafts_built=10, lookup_bytes=40) for n in (10, 100, 1000, 10000)],
        ),
        (
            "built-shaft-by-shaft",
            [row(shaft_cells=str(n), shafts=n, shaft_build_time_s=3e-6 * n) for n in (10, 100, 1000, 10000)],
            [row(shaft_cells=str(n), shafts=n, shaft_build_time_s=3e-6 * n**1.2) for n in (10, 100, 1000, 10000)],
        ),
    ],
)  # fmt: skip
def test_a_claim_holds_and_fails_by_what_was_measured(claim, holds, fails):
    assert (verdict(claim, *holds), verdict(claim, *fails)) == (HOLDS, DOES_NOT_HOLD)


def test_every_claim_is_not_measured_without_its_points_and_undecided_without_an_interval():
    other = row() | {"method": "bvh", "status": "failed"}
    assert {verdict(claim, other) for claim in BY_ID} == {NOT_MEASURED}
    assert judge_claim(CLAIMS[0], None)[0].verdict == NOT_MEASURED
    assert verdict("fewer-steps", row()) == NOT_MEASURED  # of one kind alone
    assert verdict("less-time", *of_all_kinds(speedup_vs_bvh_low=None, speedup_vs_bvh_high=None)) == UNDECIDED


def test_sampled_shafts_are_held_against_all_of_as_many_voxels():
    rows = [row(shaft_cells=cells, steps_ratio=ratio) for cells, ratio in (("8", 0.1), ("512", 0.5))]
    sampled = row(shaft_cells="512", shaft_subset="sampled", list_bytes=480, steps_ratio=0.52)
    assert verdict("subset-is-efficient", *rows, sampled) == HOLDS
    assert verdict("subset-is-efficient", rows[0], sampled) == NOT_MEASURED


def test_figures_draw_a_line_for_each_kind_of_rays_and_nothing_where_nothing_varies():
    probable, shafts = FIGURES
    rows = [row(kind, shaft_probability=p, steps_ratio=p) for kind in ("primary", "diffuse") for p in (0.25, 0.5, 1.0)]
    drawn = probable.rows(table(*rows))
    assert len(drawn) == 6
    assert not len(shafts.rows(table(*rows)))
    (panel,) = figure(drawn, "shaft_probability").panels
    lines = {line.label: line.y.tolist() for line in panel.lines}
    assert lines == {"primary": [0.25, 0.5, 1.0], "diffuse": [0.25, 0.5, 1.0]}


KEPT = ROOT / "reports" / "reference" / "rays.csv"
KEPT_VIEWS = ROOT / "reports" / "reference" / "views.csv"


def rows_of(path):
    return list(csv.DictReader(path.open(encoding="utf-8")))


def assert_kept(path, kept):
    rows, known = rows_of(path), rows_of(kept)
    assert rows
    assert [row for row in rows if row not in known] == []


def test_files_of_a_scene_have_the_digests_that_are_kept(tmp_path):
    _, _, *paths, table, _ = run_rays(["cornell_box", "size=small", f"output={tmp_path}"])
    assert [path.name for path in paths] == [f"cornell_box_{kind}_small.npz" for kind in KINDS]
    assert_kept(table, KEPT)
    rays = dict(np.load(paths[KINDS.index("shadow")]))
    assert set(rays["tfar"]) == {1.0}
    lamp = rays["origins"] + rays["directions"]
    assert np.ptp(lamp, axis=0).max() < 1e-5
    assert len(set(map(tuple, np.load(paths[KINDS.index("parallel")])["directions"]))) == 1


def test_triangles_and_views_are_written_so_that_an_image_of_them_can_be_judged(tmp_path):
    mesh_file, camera_file, *_ = run_rays(["needles_1000", "size=small,middle", f"output={tmp_path}"])
    scene = scene_of("needles_1000")
    mesh, cameras = load_mesh(mesh_file), read_cameras(camera_file, None, {})
    assert np.array_equal(mesh.vertices, scene.mesh.vertices)
    assert np.array_equal(mesh.faces, scene.mesh.faces)
    assert cameras == {size: Camera(**scene.camera, width=SIZES[size], height=SIZES[size]) for size in cameras}
    assert list(cameras) == ["small", "middle"]


def test_the_lists_that_are_kept_have_every_kind_size_and_view_of_built_in_and_generated_scenes():
    generated = {f"{family}_{10**digits}" for family in FAMILIES for digits in (3, 4, 5, 6, 7)}
    generated -= {"needles_10000000"}  # its rays take very long
    kept = {(row["scene"], row["kind"], row["size"]) for row in rows_of(KEPT)}
    assert set(product({*BUILT_IN, *generated}, KINDS, SIZES)) <= kept
    assert set(product(generated, VIEWS)) <= {(row["scene"], row["view"]) for row in rows_of(KEPT_VIEWS)}


def test_every_generated_family_has_the_bits_that_are_kept():
    kept = {row["scene"]: row["mesh_sha256"] for row in rows_of(KEPT_VIEWS)}
    for family in FAMILIES:
        assert generated_scene(family, 1000).mesh_sha256 == kept[f"{family}_1000"]


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_rays_and_views_of_every_family_are_those_that_are_kept(tmp_path, family):
    tables = run_rays([f"{family}_1000", "size=small", "files=false", f"output={tmp_path}"])
    assert [one.name for one in tmp_path.iterdir() if one.suffix == ".npz"] == []
    for table, kept in zip(tables, (KEPT, KEPT_VIEWS), strict=True):
        assert_kept(table, kept)


@pytest.mark.parametrize(
    "arguments",
    [[], ["size=small"], ["cornell_box", "size=huge"], ["cornell_box", "kind=all"], ["cornell_box", "files=some"]],
)
def test_other_arguments_are_refused(arguments):
    with pytest.raises(InputError, match="expected: "):
        run_rays(arguments)
