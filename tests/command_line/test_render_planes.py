"""`atra render` of planes, of a mesh without cameras, and of cameras with a lens."""

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import atra
from atra.command.main import main
from tests.meshes import cornell_box


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    mesh = cornell_box()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export("model.ply")
    return tmp_path


def write_cameras(cameras):
    Path("cameras.json").write_text(json.dumps(cameras), encoding="utf-8")


def run(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["atra", "render", *map(str, arguments)])
    return main()


def test_without_a_camera_the_mesh_is_framed_and_its_planes_are_written(folder, monkeypatch, capsys):
    assert run(monkeypatch, "model.ply", "--size", 32, 24, "--planes", "depth,normal", "mask", "--format", "npz") == 0
    with np.load("model_views/model.npz") as planes:
        assert list(planes) == ["depth", "normals", "mask"]
        assert planes["mask"].shape == (24, 32)
        camera = atra.Camera.framing(atra.load_mesh("model.ply"), width=32, height=24)
        with atra.RasterTracer(atra.load_mesh("model.ply"), camera) as tracer:
            np.testing.assert_array_equal(planes["depth"], tracer.trace().depth)


def test_cameras_with_a_lens_are_rendered(folder, monkeypatch):
    given = {"K": [[30, 0, 15.5], [0, 30, 11.5], [0, 0, 1]], "R": np.diag([1, -1, -1]).tolist(), "t": [0, 0.8, 2.3],
             "width": 32, "height": 24, "distortion": [-0.2, 0.05, 0, 0]}  # fmt: skip
    write_cameras({"bent": given, "fish": given | {"model": "fisheye"}})
    assert run(monkeypatch, "model.ply", "--camera", "cameras.json", "--out", "o", "--planes", "depth") == 0
    mesh = atra.load_mesh("model.ply")
    for name, model in (("bent", "pinhole"), ("fish", "fisheye")):
        camera = atra.Camera.from_opencv(**given | {"model": model})
        with atra.RasterTracer(mesh, camera) as tracer, np.load(f"o/{name}.npz") as planes:
            hits = tracer.trace()
            assert hits.hit.any()
            np.testing.assert_array_equal(planes["depth"], hits.depth)


@pytest.mark.parametrize(("eye", "target", "said"), [
    ([0, 0.8, 9], [0, 0.8, 20], "its centre lies behind the camera"),
    ([0, 0.8, 9], [9, 0.8, 8], "its centre would be at pixel ("),
])  # fmt: skip
def test_a_view_that_hits_nothing_says_so_and_where_the_mesh_is(eye, target, said, folder, monkeypatch, capsys):
    write_cameras({"a": {"eye": eye, "target": target, "width": 16, "height": 12}})
    assert run(monkeypatch, "model.ply", "--camera", "cameras.json") == 0
    told = " ".join(capsys.readouterr().err.split())
    assert "'a' sees nothing: the mesh reaches from (" in told
    assert said in told


def test_what_the_encoding_of_a_terminal_lacks_is_shown_escaped(monkeypatch):
    shown = io.TextIOWrapper(io.BytesIO(), encoding="latin-1")
    monkeypatch.setattr(sys, "stdout", shown)
    with pytest.raises(SystemExit) as left:
        run(monkeypatch, "--help")
    assert left.value.code == 0
    shown.flush()
    assert rb"\u2026" in shown.buffer.getvalue()


def test_the_help_starts_with_examples_and_its_errors_are_one_line(folder, monkeypatch, capsys):
    with pytest.raises(SystemExit) as left:
        run(monkeypatch, "--help")
    assert left.value.code == 0
    told = capsys.readouterr().out
    assert told.startswith("usage: atra render model.glb -o picture.png ")
    assert told.index("--planes depth,normals") < told.index("positional arguments")
    for arguments, said in (
        (["--planes", "colour"], "planes are colour, expected some of depth"),
        (["--planes", "depth", "--format", "ply"], "the format is ply, expected one of npz, npy, png, exr, tiff with"),
        (["--format", "tiff"], "the format is tiff, expected one of npz, exr, png, ply without --planes"),
    ):
        assert run(monkeypatch, "model.ply", *arguments) == 2
        assert capsys.readouterr().err.startswith(f"atra: {said}")


@pytest.mark.parametrize(("arguments", "said"), [
    (["--planes", "depth", "model.ply"], "no mesh is given, expected its file first"),
    (["model.ply", "size=3"], "unrecognized arguments: size=3; options begin with --, as in: --size 640 480"),
    (["model.ply", "--format", "jpg"], "argument --format: invalid choice: 'jpg'"),
    (["model.ply", "--size", 10], "argument --size: expected 2 arguments"),
])  # fmt: skip
def test_arguments_that_are_wrong_are_told_in_two_lines(arguments, said, folder, monkeypatch, capsys):
    with pytest.raises(SystemExit) as left:
        run(monkeypatch, *arguments)
    assert left.value.code == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith(f"atra: {said}")
    assert second.startswith("more by: atra")


def test_depths_that_do_not_fit_are_counted_for_their_view(folder, monkeypatch, capsys):
    planes = ("--planes", "depth", "--format", "png", "--size", 16, 12, "--depth-scale", 1e5)
    assert run(monkeypatch, "model.ply", *planes) == 1
    assert "depths do not fit 16 bits" in capsys.readouterr().err
    assert run(monkeypatch, "model.ply", *planes, "--saturate") == 0
