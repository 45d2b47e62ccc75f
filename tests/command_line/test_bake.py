"""`atra bake MESH`: files of a lightmap, what an interruption leaves, what is refused; and the help of verbs."""

import importlib.util
import sys
import threading

import numpy as np
import pytest
import trimesh
from PIL import Image

from atra.command import baking
from atra.command.main import main
from atra.light import Baker
from atra.light.lightmaps.maps import LIGHTS
from tests.meshes import cornell_box

needs_xatlas = pytest.mark.skipif(
    importlib.util.find_spec("xatlas") is None, reason="xatlas is not installed (extra `bake`)"
)
FILES = {f"{name}.{end}" for name in (*LIGHTS, "openness") for end in ("exr", "png")}
FILES |= {"culling_map.png", "occupancy.png", "charts.png", "view_clay.png", "view.png", "scene.glb"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, with `room.obj`, a box without lights."""
    monkeypatch.chdir(tmp_path)
    mesh = cornell_box()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / "room.obj")
    return tmp_path


def bake(monkeypatch, *arguments):
    given = ["--size", "32", "--samples", "2", "--threads", "1", *arguments]
    monkeypatch.setattr(sys, "argv", ["atra", "bake", "room.obj", *given])
    return main()


@needs_xatlas
def test_a_model_becomes_maps_and_views_of_a_named_side_under_the_sky_of_a_file(folder, monkeypatch, capsys):
    (folder / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n" + bytes([128] * 4))
    assert bake(monkeypatch, "--sky", "sky.hdr", "--sky-rotation", "30", "--camera", "front", "--lights", "grid") == 0
    told = capsys.readouterr()
    assert "charts on 32 x 32" in told.out
    assert "baked 2 of 2 samples" in told.err
    assert {path.name for path in (folder / "room_baked").iterdir()} == FILES
    assert np.asarray(Image.open(folder / "room_baked" / "environment.png")).max() > 0


@needs_xatlas
@pytest.mark.parametrize("denoise", [[], ["--denoise"]])
def test_an_interrupted_bake_writes_what_there_is_and_shows_what_the_camera_saw(folder, monkeypatch, capsys, denoise):
    if denoise:
        pytest.importorskip("pyoidn", reason="pyoidn is not installed: pip install -e '.[denoise]'")
    passes, advance = [], Baker.advance

    def interrupted(self, target, stop=None):
        passes.append(target)
        if passes.count(16) == 2:
            raise KeyboardInterrupt
        return advance(self, target, stop)

    monkeypatch.setattr(Baker, "advance", interrupted)
    assert bake(monkeypatch, "--samples", "64", "--out", "out", *denoise) == 0
    assert "interrupted after 1 samples of every texel; writing these" in capsys.readouterr().err
    assert {path.name for path in (folder / "out").iterdir()} == FILES | {"bake.state"}
    assert np.asarray(Image.open(folder / "out" / "view.png"), float).std() > 10
    assert not [thread for thread in threading.enumerate() if thread.name == "atra-bake"]


@needs_xatlas
def test_a_bake_out_of_time_goes_on_to_the_bit_where_it_ended_and_ends_at_its_error(folder, monkeypatch, capsys):
    clock = iter(range(1000))
    monkeypatch.setattr(baking, "monotonic", lambda: float(next(clock)))
    assert bake(monkeypatch, "--samples", "64", "--out", "parts", "--minutes", "0.1") == 0
    assert "the same command goes on from parts/bake.state" in capsys.readouterr().err
    monkeypatch.setattr(baking, "monotonic", lambda: 0.0)
    assert bake(monkeypatch, "--samples", "32", "--out", "parts") == 0
    assert "goes on with parts/bake.state" in capsys.readouterr().err
    assert bake(monkeypatch, "--samples", "32", "--out", "whole") == 0
    for name in ("combined.exr", "openness.exr"):
        assert (folder / "parts" / name).read_bytes() == (folder / "whole" / name).read_bytes()
    assert {path.name for path in (folder / "parts").iterdir()} == FILES
    assert bake(monkeypatch, "--samples", "4096", "--error", "20", "--out", "fair") == 0
    assert "4096 of 4096" not in capsys.readouterr().err
    assert {path.name for path in (folder / "fair").iterdir()} == FILES
    (folder / "parts" / "bake.state").write_bytes(b"nothing")
    assert bake(monkeypatch, "--out", "parts") == 2
    assert "parts/bake.state is no state of a bake" in capsys.readouterr().err


@pytest.mark.parametrize(("given", "told"), [
    (("--samples", "0"), "samples is 0, expected a whole number from 1"),
    (("--minutes", "0"), "minutes is 0.0, expected a finite number above 0"),
    (("--live", "--error", "1"), "--live bakes until its page is left; leave out --error and --minutes"),
    (("--size", "7"), "size of a map is 7"),
    (("--camera", "table"), "the camera is 'table', expected a file, one of front, back"),
    (("--port", "-1"), "port is -1, expected a whole number from 0 to 65535"),
    (("--denoise",), "denoising needs the package pyoidn"),
])  # fmt: skip
def test_what_cannot_be_baked_is_refused_in_one_line(folder, monkeypatch, capsys, given, told):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    assert bake(monkeypatch, *given) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert [path.name for path in folder.iterdir()] == ["room.obj"]


@pytest.mark.parametrize("name", ["scene.glb", "lit.glb"])
def test_a_bake_refuses_to_overwrite_the_model_that_it_reads(folder, monkeypatch, capsys, name):
    box = cornell_box()
    trimesh.Trimesh(box.vertices, box.faces, process=False).export(folder / name)
    before = (folder / name).read_bytes()
    monkeypatch.setattr(sys, "argv", ["atra", "bake", name, "--out", ".", "--size", "32", "--samples", "1"])
    assert main() == 2
    assert f"--out . would overwrite {name}, which is baked; give another folder" in capsys.readouterr().err
    assert (folder / name).read_bytes() == before


@pytest.mark.parametrize(("verb", "most"), [("view", 40), ("bake", 40), ("render", 50)])
def test_the_help_of_a_verb_fits_a_screen(monkeypatch, capsys, verb, most):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys, "argv", ["atra", verb, "--help"])
    with pytest.raises(SystemExit, match="0"):
        main()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= most
    assert max(map(len, lines)) <= 80
