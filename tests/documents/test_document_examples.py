"""README and docs: every Python block runs in the order of its page, and every command is understood."""

import json
import os
import re
import shlex
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from unittest.mock import Mock, patch

import pytest
import trimesh

import experiments.commands.single
import experiments.sweep
from atra.command.main import _VERBS
from atra.command.main import main as run_console
from experiments import cli
from experiments.commands.new_method import run_new_method
from tests.command import run_here
from tests.folders import ROOT
from tests.meshes import cornell_box

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

AS_PRINTED = "start.md"
"""The tutorial runs at its own size, and what it says is printed is printed."""
A_PROGRAM = "clusters.md"
"""Its block is a whole program, which processes import."""

SMALLER = {
    "model.ply": "model.obj",
    "width=1024, height=1024": "width=256, height=32",
    "size=512": "size=16",
    "size=256": "size=16",
    "advance(256)": "advance(2)",
    "target=64": "target=2",
    "0.5, 1, 0)], 1024)": "0.5, 1, 0)], 64)",
}
"""What pages say, and what the tests run in place of it, to be done sooner."""

CALIBRATED = {"K": [[900, 0, 320], [0, 910, 240], [0, 0, 1]], "R": [[1, 0, 0], [0, -1, 0], [0, 0, -1]], "t": [0, 0, 3],
              "width": 64, "height": 48}  # fmt: skip
LAUNCHER = "hydra/launcher="


def text_of(page):
    return page.read_text(encoding="utf-8")


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", text_of(page), re.S)


def commands(page):
    """Every `atra ...` and `python run.py ...` of the page's shell blocks and text, but for the synopsis."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    lines += [" ".join(one.split()) for one in re.findall(r"`(atra [^`]*=[^`]*)`", text_of(page))]
    parts = [part.strip() for line in lines for part in line.split(" #")[0].split("&&")]
    found = (re.fullmatch(r"(?:\.venv/bin/)?atra (.*)|python run\.py (.*)", part) for part in parts)
    return [shlex.split(one[1] or one[2]) for one in found if one and "VERB" not in one[0]]


def say(argument):
    """A page's name or a command, as part of a test's name."""
    return argument if isinstance(argument, str) else " ".join(argument)


WITH_CODE = [page for page in PAGES if blocks(page, "python") and page.name not in (AS_PRINTED, A_PROGRAM)]
COMMANDS = sorted({(page.name, tuple(one)) for page in PAGES for one in commands(page)})
OF_MODELS = [(page, one) for page, one in COMMANDS if one[0] in ("render", "view", "bake")]
FOR_FILES = [(page, one) for page, one in OF_MODELS if one[0] == "render" and "--camera" in one]


def for_the_harness():
    """The others, each once, without the launchers that a cluster would have, and the first page that has it."""
    first_pages = {}
    for page, one in COMMANDS:
        if (page, one) not in OF_MODELS and one != ("doctor",):
            given = tuple(part for part in one if LAUNCHER not in part and "hydra.launcher." not in part)
            first_pages.setdefault(given, page)
    return [(page, given) for given, page in first_pages.items()]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working directory, with a model, cameras in every kind of file that the pages name, and a method."""
    mesh = cornell_box()
    for kind in ("obj", "glb", "ply"):
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(tmp_path / f"model.{kind}")
    (tmp_path / "sparse" / "0").mkdir(parents=True)
    (tmp_path / "sparse" / "0" / "cameras.txt").write_text("1 PINHOLE 64 48 60 60 32 24\n")
    (tmp_path / "sparse" / "0" / "images.txt").write_text("1 0 1 0 0 0 0 3 1 front.jpg\n\n")
    frame = {"file_path": "front", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 3], [0, 0, 0, 1]]}
    (tmp_path / "transforms.json").write_text(json.dumps({"camera_angle_x": 0.8, "frames": [frame], "w": 64, "h": 48}))
    (tmp_path / "cameras.json").write_text(json.dumps({"front": CALIBRATED}))
    monkeypatch.chdir(tmp_path)
    run_new_method(["mine"])
    return tmp_path


def run_blocks(page, smaller):
    names = {"__name__": page.name}
    for block in blocks(page, "python"):
        for said, run in smaller.items():
            block = block.replace(said, run)
        exec(compile(block, page.name, "exec"), names)
    return names


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda page: page.name)
@pytest.mark.usefixtures("folder")
def test_the_python_of_a_page_runs_in_its_order(page):
    assert run_blocks(page, SMALLER)


@pytest.mark.usefixtures("folder")
def test_two_methods_of_a_page_find_the_same_image(capsys):
    run_blocks(ROOT / "docs" / "views.md", SMALLER)
    assert re.search(r"^\d+ of 8192 pixels equal, \d+ tied, \d+ edge, 0 wrong", capsys.readouterr().out, re.M)


def test_the_tutorial_prints_what_it_says(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = ROOT / "docs" / AS_PRINTED
    run_blocks(page, {})
    *printed, of_the_sweep = blocks(page, "text")
    assert capsys.readouterr().out == "".join(printed)
    assert {"model.obj", "view.png", "thickness.png"} <= {path.name for path in tmp_path.iterdir()}
    (sweep,) = [one for one in commands(page) if one[0].startswith("sweep=")]
    done = run_here(tmp_path, *sweep, "method.split_x=1,4", "width=32", "height=32", "measure.processes=1")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-len(of_the_sweep.splitlines()) :] == of_the_sweep.splitlines()


@pytest.mark.slow
def test_the_program_for_processes_runs(folder):
    (program,) = blocks(ROOT / "docs" / A_PROGRAM, "python")
    (folder / "program.py").write_text(program, encoding="utf-8")
    variables = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "program.py"], cwd=folder, env=variables, check=True, timeout=600)
    assert (folder / "front.jpg.npz").exists()


@pytest.mark.parametrize(("page", "arguments"), FOR_FILES, ids=say)
@pytest.mark.usefixtures("folder")
def test_a_command_for_files_writes_its_views(page, arguments):
    with patch.object(sys, "argv", ["atra", *arguments]):
        assert run_console() == 0
    assert list(Path("out").iterdir())


@pytest.mark.parametrize(("page", "arguments"), [one for one in OF_MODELS if one not in FOR_FILES], ids=say)
def test_another_command_for_models_is_understood(page, arguments):
    module = import_module(f"atra.command.{_VERBS[arguments[0]][0]}")
    done = Mock(return_value=0)
    with patch.object(sys, "argv", ["atra", *arguments]), patch.object(module, f"run_{arguments[0]}", done):
        assert run_console() == 0
    done.assert_called_once()


@pytest.mark.parametrize(("page", "given"), for_the_harness(), ids=say)
def test_a_command_for_the_harness_names_what_there_is(page, given, folder):
    """Its fields are read and its points are planned, those of a sweep for one scene; nothing is measured."""
    names_scene = any(one.partition("=")[0] == "scene" for one in given)
    one_scene = ["scene=cornell_box"] if given[0].startswith("sweep=") and not names_scene else []
    done = Mock(return_value=None)
    with (
        patch.object(cli, "resolve_name", Mock(return_value=done)),
        patch.object(experiments.sweep, "run_sweep", done),
        patch.object(experiments.commands.single, "run_single_point", done),
    ):
        told = run_here(folder, *given, *one_scene)
    assert told.returncode == 0, told.stderr
    done.assert_called_once()


def test_commands_of_every_kind_are_found():
    found = {one[0].partition("=")[0] for _, one in COMMANDS}
    assert {"doctor", "measure", "sweep", "-m", "report", "fetch", "render", "bake", "view"} <= found
