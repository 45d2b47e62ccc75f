"""`atra render`: files of every view, from cameras as people have them, and one line for whatever is wrong."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import atra
from atra.command.main import main
from atra.command.render import file_stems
from tests.meshes import cornell_box

LOOKING = {"eye": [0.0, 0.3, 4.0], "target": [0.0, 0.0, 0.0], "fov_y_degrees": 50.0, "width": 24, "height": 16}
K = [[20.0, 0.0, 11.5], [0.0, 22.0, 6.5], [0.0, 0.0, 1.0]]
CALIBRATED = {"K": K, "R": np.diag([1.0, -1.0, -1.0]).tolist(), "t": [0.0, 0.0, 4.0], "width": 24, "height": 16}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, with `model.glb` and `cameras.json`."""
    monkeypatch.chdir(tmp_path)
    mesh = cornell_box()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "model.glb")
    write_cameras({"left/0001.jpg": LOOKING, "calibrated": CALIBRATED})
    return tmp_path


def write_cameras(cameras):
    Path("cameras.json").write_text(json.dumps(cameras), encoding="utf-8")


def render(monkeypatch, *arguments):
    given = ["atra", "render", "model.glb", "--camera", "cameras.json", "--out", "out/deep", *arguments]
    monkeypatch.setattr(sys, "argv", given)
    return main()


def test_every_view_is_written_as_the_library_traces_it(folder, monkeypatch, capsys):
    assert render(monkeypatch, "--format", "npz", "ply") == 0
    mesh = atra.load_mesh("model.glb")
    looking = atra.Camera(**{name: tuple(one) if isinstance(one, list) else one for name, one in LOOKING.items()})
    views = {"left_0001": looking, "calibrated": atra.Camera.from_opencv(**CALIBRATED)}
    told = capsys.readouterr()
    for number, (name, camera) in enumerate(views.items(), 1):
        with atra.RasterTracer(mesh, camera) as tracer:
            hits = tracer.trace()
        with np.load(folder / "out" / "deep" / f"{name}.npz") as written:
            for layer in ("depth", "prim_id", "normals"):
                np.testing.assert_array_equal(written[layer], getattr(hits, layer))
        cloud = trimesh.load(folder / "out" / "deep" / f"{name}.ply")
        assert len(cloud.vertices) == hits.hit.sum() > 50
        paths = " and ".join(str(Path("out", "deep", f"{name}.{suffix}")) for suffix in ("npz", "ply"))
        line = told.out.splitlines()[number - 1]
        assert line == f"[{number}/2] {paths.replace(' and ', ', ')}: {hits.hit.mean():.1%} hit"
    assert told.err == f"model.glb: {mesh.triangle_count:,} triangles; 2 views\n"


def test_a_transforms_json_and_a_colmap_model_are_read_too(folder, monkeypatch):
    pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]
    write_cameras({"camera_angle_x": 0.8, "frames": [{"file_path": "./train/r_0", "transform_matrix": pose}]})
    assert render(monkeypatch, "--size", "24", "16", "--threads", "1") == 0
    (folder / "model").mkdir()
    (folder / "model" / "cameras.txt").write_text("1 PINHOLE 24 16 20 22 12 7\n", encoding="utf-8")
    (folder / "model" / "images.txt").write_text("1 0 1 0 0 0 0 4 1 photo.png\n\n", encoding="utf-8")
    assert render(monkeypatch, "--camera", "model") == 0
    images = {path.stem: np.load(path)["depth"] for path in (folder / "out" / "deep").iterdir()}
    assert {name: image.shape for name, image in images.items()} == {"train_r_0": (16, 24), "photo": (16, 24)}
    assert all(np.isfinite(image).any() for image in images.values())


@pytest.mark.parametrize(("cameras", "arguments", "message"), [
    ({}, [], "cameras.json has no camera, expected at least one"),
    ([], [], "cameras.json holds a list"),
    ({"a": {"eye": [0, 0, 1]}}, [], "cameras.json, camera 'a': it has neither eye and target nor K, R and t"),
    ({"a": [1]}, [], "cameras.json, camera 'a': it has neither eye and target nor K, R and t"),
    ({"a": LOOKING | {"fov": 3}}, [], "camera 'a': its field 'fov' is unknown, expected eye, target, width, height"),
    ({"a": CALIBRATED | {"up": 3}}, [], "camera 'a': its field 'up' is unknown, expected K, R, t, width, height"),
    ({"a": LOOKING | {"width": 0}}, [], "camera 'a': width is 0, expected a whole number of pixels of at least 1"),
    ({"a": LOOKING | {"eye": [0, 0, 0]}}, [], "cameras.json, camera 'a': "),
    ({"a": CALIBRATED | {"R": np.ones((3, 3)).tolist()}}, [], "cameras.json, camera 'a': R is"),
    ({"a": {"eye": [0, 0, 1], "target": [0, 0, 0]}}, [], "the size of the image is missing, expected width and"),
    ({"x/a.jpg": LOOKING, "x/a.png": LOOKING}, [], "'x/a.jpg' and 'x/a.png' would both be written to x_a; rename"),
    ({"a": LOOKING}, ["--camera", "none.json"], "none.json cannot be read: "),
    ({"a": LOOKING}, ["--out", "model.glb"], "model.glb cannot be made: "),
    ({"a": LOOKING}, ["--threads", "0"], "threads is 0, expected a whole number of at least 1"),
])  # fmt: skip
def test_what_cannot_be_used_is_one_line_before_anything_is_traced(
    cameras, arguments, message, folder, monkeypatch, capsys
):
    write_cameras(cameras)
    assert render(monkeypatch, *arguments) != 0
    told = capsys.readouterr()
    assert message in told.err
    assert "Traceback" not in told.err
    assert told.out == ""
    assert not list(folder.glob("out/deep/*"))


def test_views_that_cannot_be_read_traced_or_written_are_named_at_the_end_and_do_not_cost_the_others(
    folder, monkeypatch, capsys
):
    write_cameras({
        "a": LOOKING, "flat": CALIBRATED | {"K": np.zeros((3, 3)).tolist()}, "far": LOOKING | {"eye": [1e30, 0.0, 0.0]},
        "away": LOOKING | {"target": [0.0, 0.0, 9.0]}, "b": LOOKING,
    })  # fmt: skip
    assert render(monkeypatch, "--format", "ply") == 1
    told = capsys.readouterr()
    assert [path.stem for path in sorted((folder / "out" / "deep").iterdir())] == ["a", "b"]
    assert len(told.out.splitlines()) == 2
    *reasons, last = told.err.splitlines()[-4:]
    assert all(reason.startswith("atra: ") for reason in reasons)
    for said in ("camera 'flat': K is singular", "would have no point", "(in view 'away')", "(in view 'far')"):
        assert sum(said in reason for reason in reasons) == 1
    assert last == "atra: 2 of 5 views are written"


def test_a_package_that_a_format_needs_is_missed_before_anything_is_traced(folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "OpenEXR", None)
    assert render(monkeypatch, "--format", "npz", "exr") == 2
    assert ".exr files need the package OpenEXR, which is not installed: pip install openexr" in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_names_of_views_never_lead_out_of_the_folder():
    names = ["../../etc/passwd", "a/b.c.jpg", "C:\\x.png", "...", "", "r_0"]
    with pytest.raises(atra.InputError, match="both be written to view"):
        file_stems(names)
    names.remove("")
    assert list(file_stems(names).values()) == ["etc_passwd", "a_b.c", "C_x", "view", "r_0"]
