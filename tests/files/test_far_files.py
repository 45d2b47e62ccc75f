"""Files of meshes at map coordinates: what is read keeps the file's digits, and what is saved those of positions."""

from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

import atra
from atra.command.main import main
from experiments.commands.scene_files import ply_of
from tests.far import AWAY, FAR, NEAR, SEEN_FAR, SEEN_NEAR
from tests.files.samples import obj, off, three_mf, written

UTM = np.array([512345.67, 4598765.43, 120.25])


def write_glb(path, mesh):
    """The near mesh in float32, placed by its node."""
    scene, place = trimesh.Scene(), np.eye(4)
    place[:3, 3] = mesh.origin
    near = trimesh.Trimesh(mesh.local_vertices, mesh.faces, process=False)
    scene.add_geometry(near, node_name="placed", transform=place)
    scene.export(path)


def write_3mf(path, mesh):
    """The near mesh, placed by the transform of its item."""
    place = "1 0 0 0 1 0 0 0 1 " + " ".join(map(repr, mesh.origin.tolist()))
    three_mf(path, [place], vertices=mesh.local_vertices.tolist(), faces=mesh.faces.tolist())


WRITERS = {
    "obj": lambda path, mesh: written(path.parent, path.name, obj(mesh.vertices.tolist(), mesh.faces.tolist())),
    "off": lambda path, mesh: written(path.parent, path.name, off(mesh.vertices.tolist(), mesh.faces.tolist())),
    "ply": lambda path, mesh: path.write_bytes(ply_of(mesh)), "glb": write_glb, "3mf": write_3mf,
}  # fmt: skip


@pytest.mark.parametrize("kind", WRITERS)
def test_a_file_at_map_coordinates_is_read_with_all_its_digits(kind, tmp_path):
    path = tmp_path / f"far.{kind}"
    WRITERS[kind](path, FAR)
    mesh = atra.load_mesh(path)
    assert mesh.has_origin
    np.testing.assert_array_equal(np.sort(mesh.vertices[mesh.faces], axis=1), np.sort(FAR.vertices[FAR.faces], axis=1))
    np.testing.assert_array_equal(mesh.origin, FAR.origin)


def test_a_scaled_file_is_read_with_all_its_digits(tmp_path):
    WRITERS["obj"](tmp_path / "far.obj", FAR)
    mesh = atra.load_mesh(tmp_path / "far.obj", scale=0.5)
    np.testing.assert_array_equal(mesh.vertices, 0.5 * FAR.vertices)


def test_a_file_in_float32_needs_no_origin_wherever_it_lies(tmp_path):
    mesh = atra.Mesh((NEAR.vertices + UTM).astype(np.float32), NEAR.faces)
    WRITERS["ply"](tmp_path / "far.ply", mesh)
    again = atra.load_mesh(tmp_path / "far.ply")
    assert not again.has_origin
    np.testing.assert_array_equal(again.vertices, mesh.vertices)


@pytest.fixture
def seen():
    return atra.RasterTracer(FAR, SEEN_FAR["pinhole"], threads=1).trace()


def test_saved_positions_keep_their_digits(seen, tmp_path):
    seen.save(tmp_path / "view.npz")
    with np.load(tmp_path / "view.npz") as stored:
        assert stored["points"].dtype == np.float64
        np.testing.assert_array_equal(stored["points"], seen.points)
    seen.save(tmp_path / "view.ply")
    np.testing.assert_array_equal(trimesh.load(tmp_path / "view.ply").vertices, seen.points[seen.hit])
    seen.save_planes(tmp_path / "planes", ["points"], "npy")
    np.testing.assert_array_equal(np.load(tmp_path / "planes.points.npy"), seen.points)
    tifffile = pytest.importorskip("tifffile")
    seen.save_planes(tmp_path / "planes", ["points"], "tiff")
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "planes.points.tiff"), seen.points)


def test_positions_that_a_format_would_round_are_refused_in_it(seen, tmp_path):
    pytest.importorskip("OpenEXR")
    seen.save(tmp_path / "view.exr")  # without positions
    with pytest.raises(
        atra.InputError, match="points of this mesh as EXR would lose digits, expected npz, npy or tiff"
    ):
        seen.save_planes(tmp_path / "planes", ["depth", "points"], "exr")
    assert not (tmp_path / "planes.exr").exists()


@pytest.mark.parametrize("kind", ["obj", "glb"])
def test_atra_render_shows_a_file_at_map_coordinates_as_the_same_near_the_origin(kind, tmp_path, monkeypatch, capsys):
    WRITERS["obj"](tmp_path / "near.obj", NEAR)
    WRITERS[kind](tmp_path / f"far.{kind}", FAR)
    images = []
    for name, camera in (("near.obj", SEEN_NEAR["pinhole"]), (f"far.{kind}", SEEN_FAR["pinhole"])):
        fields = {one: getattr(camera, one) for one in ("eye", "target", "up", "fov_y_degrees", "width", "height")}
        (tmp_path / "cameras.json").write_text(json.dumps({"view": fields}), encoding="utf-8")
        given = ["atra", "render", str(tmp_path / name), "--camera", str(tmp_path / "cameras.json")]
        monkeypatch.setattr("sys.argv", [*given, "--out", str(tmp_path / name[:4]), "--format", "npz"])
        assert main() == 0
        with np.load(next((tmp_path / name[:4]).glob("*.npz"))) as stored:
            images.append(dict(stored))
    near, far = images
    assert np.isfinite(near["depth"]).sum() > 100
    for plane in ("depth", "prim_id", "normals"):
        np.testing.assert_array_equal(far[plane], near[plane])
    np.testing.assert_array_equal(far["points"], near["points"] + AWAY)


def test_a_framed_camera_sees_the_whole_of_a_far_mesh():
    camera, other = atra.Camera.framing(FAR, width=64, height=64), atra.Camera.framing(NEAR, width=64, height=64)
    np.testing.assert_allclose(np.array(camera.eye) - AWAY, other.eye, rtol=0.0, atol=1e-8)
    far, near = (atra.RasterTracer(*given, threads=1).trace() for given in ((FAR, camera), (NEAR, other)))
    assert (far.prim_id == near.prim_id).mean() > 0.999
