"""`atra judge`: images in files, what is printed, and exit codes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import atra
from atra.command.main import main
from atra.files.saving import encode_exr
from atra.judge.compare import Verdict
from atra.judge.marks import COLOURS
from tests.meshes import cornell_box, cornell_camera


@pytest.fixture
def hits(tmp_path, monkeypatch):
    """A right image, and the working directory with the files of its mesh and camera."""
    monkeypatch.chdir(tmp_path)
    mesh, camera = cornell_box(), cornell_camera(48, 36)
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export("box.ply")
    fields = {"eye": camera.eye, "target": camera.target, "fov_y_degrees": camera.fov_y_degrees}
    cameras = {"front": {**fields, "width": 48, "height": 36}}
    Path("camera.json").write_text(json.dumps(cameras), encoding="utf-8")
    Path("two.json").write_text(json.dumps({**cameras, "back": cameras["front"]}), encoding="utf-8")
    with atra.RasterTracer(mesh, camera) as tracer:
        return tracer.trace()


def judge(monkeypatch, image, *arguments):
    given = ["atra", "judge", image, "--mesh", "box.ply", "--camera", "camera.json", *arguments]
    monkeypatch.setattr(sys, "argv", given)
    return main()


def millimetres(depth):
    return np.where(np.isfinite(depth), np.rint(depth / 0.001), 0).astype(np.uint16)


@pytest.mark.parametrize("suffix", ["npz", "npy", "exr", "png"])
def test_a_right_image_of_each_format_is_right(suffix, hits, monkeypatch, capsys):
    if suffix == "npy":
        np.save("image.npy", hits.depth)
    elif suffix == "png":
        Image.fromarray(millimetres(hits.depth)).save("image.png")
    elif suffix == "exr":
        Path("image.exr").write_bytes(encode_exr({"Z": hits.depth, "prim_id": hits.prim_id}))
    else:
        np.savez("image.npz", depth=hits.depth, prim_id=hits.prim_id)
    assert judge(monkeypatch, f"image.{suffix}") == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == f"image.{suffix} of box.ply, view 'front'"
    assert said[1] == "convention  rays through pixel centres; depth along the view axis"
    assert said[2].endswith("of pixels speak for it, atra's own")
    assert said[-1] == "nothing is wrong"


@pytest.mark.parametrize("step", [4687, 4688])
def test_a_depth_at_half_a_step_of_a_png_may_be_rounded_either_way(hits, monkeypatch, step, capsys):
    wall = atra.Mesh([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2), (0, 2, 3)])
    trimesh.Trimesh(wall.vertices, wall.faces, process=False).export("box.ply")
    camera = {"eye": (0, 0, 4.6875), "target": (0, 0, 0), "fov_y_degrees": 40, "width": 48, "height": 36}
    Path("camera.json").write_text(json.dumps({"front": camera}), encoding="utf-8")
    Image.fromarray(np.full((36, 48), step, np.uint16)).save("image.png")
    assert judge(monkeypatch, "image.png") == 0, capsys.readouterr().out


def test_another_convention_is_named_and_right_unless_our_own_is_asked_for(hits, monkeypatch, capsys):
    np.save("image.npy", hits.depth[::-1])
    assert judge(monkeypatch, "image.npy") == 0
    assert "rows are flipped: the first is the bottom" in capsys.readouterr().out
    assert judge(monkeypatch, "image.npy", "--own") == 1


def test_a_wrong_pixel_is_told_counted_and_drawn(hits, monkeypatch, capsys):
    depth = hits.depth.copy()
    depth[20, 30] *= 1.5
    np.save("image.npy", depth)
    assert judge(monkeypatch, "image.npy", "--picture", "where.png") == 1
    said = capsys.readouterr().out
    assert "(30, 20) wrong: the image shows triangle" in said
    assert said.splitlines()[-1] == "1 pixel is wrong"
    picture = np.asarray(Image.open("where.png"))
    assert picture.shape == (36, 48, 3)
    assert (picture[20, 30] == COLOURS[Verdict.WRONG]).all()
    assert (picture[:, :20] == 255).all()
    assert judge(monkeypatch, "image.npy", "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert (found["right"], found["pixels"], found["pixels_wrong"], found["pixels_hole"]) == (False, 48 * 36, 1, 0)
    assert found["pixels_equal"] + found["pixels_tied"] + found["pixels_edge"] == 48 * 36 - 1
    assert found["convention"]["flips_rows"] is False
    assert len(found["explained"]) == 1


@pytest.mark.parametrize("suffix", ["npy", "png"])
def test_an_image_of_triangle_numbers_is_told_from_wrong_depths(suffix, hits, monkeypatch, capsys):
    (path,) = hits.save_planes("ids", ["prim_id"], suffix)
    assert judge(monkeypatch, str(path)) == 1
    assert f"hint        {path} holds triangle numbers, expected depths" in capsys.readouterr().out
    np.save("image.npy", hits.depth * np.float32(1.1))
    assert judge(monkeypatch, "image.npy") == 1
    assert "hint" not in capsys.readouterr().out


def test_two_images_are_compared(hits, monkeypatch, capsys):
    np.save("one.npy", hits.depth)
    np.save("other.npy", hits.depth[::-1])
    assert judge(monkeypatch, "one.npy", "--against", "other.npy") == 0
    np.save("other.npy", hits.depth * np.float32(1.1))
    assert judge(monkeypatch, "one.npy", "--against", "other.npy") == 1


@pytest.mark.parametrize(("arguments", "said"), [
    (("image.tif",), "image.tif has the suffix '.tif', expected one of .exr, .npz, .npy, .png"),
    (("gone.npz",), "gone.npz is no file"), (("broken.npy",), "broken.npy cannot be read: "),
    (("nothing.npz",), "nothing.npz has no depths, expected an array or channel called depth, Z"),
    (("grey.png",), "grey.png has pixels of mode 'L', expected 16-bit grey: I;16"),
    (("small.npy",), "the image is (3, 4), expected the camera's (36, 48) (height, width)"),
    (("image.npy", "--view", "top"), "--view is 'top', expected one of front"),
    (("image.npy", "--camera", "two.json"), "two.json has 2 cameras, expected --view with one of front, back"),
    (("image.npy", "--depth-scale", "0"), "--depth-scale is 0.0, expected a number above 0"),
    (("image.npy", "--rounding", "nan"), "image.npy: rounding is nan, expected a number of at least 0"),
    (("image.npy", "--picture", "where.jpg"), "--picture is where.jpg, expected a name that ends with .png"),
])  # fmt: skip
def test_what_cannot_be_judged_is_told(arguments, said, hits, monkeypatch, capsys):
    np.save("image.npy", hits.depth)
    np.save("small.npy", hits.depth[:3, :4])
    np.savez("nothing.npz", colour=hits.depth)
    Path("broken.npy").write_bytes(b"\x93NUMPY broken")
    Image.fromarray(np.zeros((36, 48), np.uint8)).save("grey.png")
    assert judge(monkeypatch, *arguments) == 2
    assert said in capsys.readouterr().err
