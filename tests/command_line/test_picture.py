"""`atra render MESH -o picture.png`: a picture of a file with its materials, from wherever it is asked for."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra.command.main import main
from atra.geometry.camera import Camera
from tests.meshes import cornell_box


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, with `model.glb`: a red box."""
    monkeypatch.chdir(tmp_path)
    mesh = cornell_box()
    red = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255], metallicFactor=0.0)
    visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)), material=red)
    trimesh.Trimesh(mesh.vertices, mesh.faces, visual=visual, process=False).export(tmp_path / "model.glb")
    return tmp_path


def render(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["atra", "render", "model.glb", "--size", "24", "16", *arguments])
    return main()


def test_a_model_becomes_a_picture_in_its_colours(folder, monkeypatch, capsys):
    assert render(monkeypatch, "--samples", "2", "-o", "out/picture.png") == 0
    picture = np.asarray(Image.open(folder / "out" / "picture.png")).astype(int)
    assert picture.shape == (16, 24, 3)
    red, green, blue = picture[4:12, 8:16].mean(axis=(0, 1))
    assert red > 1.1 * max(green, blue)
    told = capsys.readouterr()
    assert told.out.startswith(f"written: {Path('out', 'picture.png')}, exposure ")
    assert told.out.endswith(" stops\n")
    assert "2 of 2 samples" in told.err
    assert [path.name for path in (folder / "out").iterdir()] == ["picture.png"], "a state is left"


def test_a_transparent_picture_has_no_sky(folder, monkeypatch):
    assert render(monkeypatch, "--samples", "4", "--transparent", "-o", "seen.png") == 0
    picture = np.asarray(Image.open(folder / "seen.png"))
    assert picture.shape == (16, 24, 4)
    assert picture[0, 0, 3] == 0
    assert picture[8, 12, 3] == 255


def test_samples_alone_make_a_picture_and_planes_alone_none(folder, monkeypatch):
    assert render(monkeypatch, "--samples", "1") == 0
    assert (folder / "model_picture.png").exists()
    assert render(monkeypatch, "--planes", "depth") == 0
    assert (folder / "model_views" / "model.npz").exists()


@pytest.mark.parametrize(("name", "way"), [
    ("front", (0, 0, 1)), ("back", (0, 0, -1)), ("left", (-1, 0, 0)), ("right", (1, 0, 0)), ("top", (0, 1, 0)),
    ("bottom", (0, -1, 0)), ("desk", (0.6, 0.8, 0)),
])  # fmt: skip
def test_sides_of_a_model_and_cameras_of_its_file_are_taken_by_name(folder, monkeypatch, name, way):
    seen, mesh = [], atra.load_mesh("model.glb")
    own = {"desk": Camera((6, 8, 0), (0, 0, 0), width=8, height=8)}
    monkeypatch.setattr("atra.command.render.load_with_cameras", lambda given: (mesh, own))
    monkeypatch.setattr("atra.command.render.render_views", lambda mesh, cameras, threads: seen.append(cameras) or [])
    assert render(monkeypatch, "--camera", name) == 0
    ((called, camera),) = seen[0].items()
    away = np.subtract(camera.eye, camera.target if name == "desk" else mesh.bounds.mean(axis=0))
    np.testing.assert_allclose(away / np.linalg.norm(away), way, atol=1e-6)
    assert (called, camera.width, camera.height) == (name, 24, 16)


@pytest.mark.parametrize(("arguments", "told"), [
    (("--camera", "table"), "the camera is 'table', expected a file, one of front, back, "),
    (("-o", "a.jpg"), "expected a name that ends in .png or .exr"),
    (("-o", "a.png", "--planes", "depth"), "--output makes a picture and --planes makes planes"),
    (("-o", "a.png", "--exposure", "bright"), "exposure is 'bright', expected auto or a number of stops"),
    (("--samples", "0"), "samples is 0"),
    (("-o", "a.png", "--aperture", "0.1"), "--aperture and --focus belong together"),
    (("-o", "a.png", "--aperture", "-1", "--focus", "2"), "aperture_radius is -1.0, expected"),
    (("--samples", "1", "--sky", "none.exr"), "none.exr"),
    (("--samples", "1", "--sky", "neutral", "--sky-rotation", "90"), "--sky-rotation is 90 without a panorama"),
    (("--samples", "2", "--denoise"), "denoising needs the package pyoidn"),
])  # fmt: skip
def test_what_makes_no_picture_is_refused_in_one_line(folder, monkeypatch, capsys, arguments, told):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert render(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert error.splitlines()[-1].startswith("atra: ")
    assert told in error.splitlines()[-1]
    assert "2 samples" not in error
    assert not list(folder.glob("*.png"))
