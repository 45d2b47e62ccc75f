"""Files of rays: their digests are those that are kept, and what they hold is what their kinds say."""

import csv
from itertools import product

import numpy as np
import pytest

from atra.command.cameras import read_cameras
from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.geometry.camera import Camera
from experiments.classification.ray_files import KINDS, SIZES, run_rays, scene_of
from scenes.built_in import BUILT_IN
from scenes.generated import FAMILIES, generated_scene
from scenes.views import VIEWS
from tests.folders import ROOT

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
