"""run.py as people use it who know Hydra: flags, groups, sweeps, files of their own, other sweepers, completion."""

import os
import re
import subprocess
import sys

import pandas as pd
import pytest

from experiments.cli import verbs
from experiments.methods import METHODS
from experiments.workloads import WORKLOADS
from tests.command import ROOT, run_here

pytestmark = pytest.mark.uncovered

TOY = ["width=16", "height=16", "measure.processes=1", "measure.rounds=3", "measure.warmup=1", "scene=cornell_box"]

WINGS = {"bvh", "classified", "bake_rays", "classification"}


@pytest.fixture
def own(tmp_path):
    """A folder with a sweep and a preset method of the user's own; its name ends as a file's does."""
    folder = tmp_path / "own.d"
    for group, name, text in (
        ("sweep", "mine", "# @package _global_\nsweep:\n  name: mine\n  grids:\n    few: {method: 'wide,aligned'}\n"
         "hydra:\n  mode: MULTIRUN\n"),
        ("method", "wide", "defaults: [pixel]\npacket_rows: 1\n"),
    ):  # fmt: skip
        (folder / group).mkdir(parents=True)
        (folder / group / f"{name}.yaml").write_text(text, encoding="utf-8")
    return folder


def one_line(done):
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.strip().splitlines()
    assert "Traceback" not in line
    return line


def test_the_value_of_a_flag_is_no_verb_and_no_model(tmp_path, own):
    shown = run_here(tmp_path, "--cfg", "hydra", "-p", "hydra.sweeper")
    assert (shown.returncode, "PointsSweeper" in shown.stdout) == (0, True), shown.stderr
    shown = run_here(tmp_path, "--cfg", "job", "--config-dir", "own.d", "method=wide", "-p", "method")
    assert (shown.returncode, "packet_rows: 1" in shown.stdout) == (0, True), shown.stderr
    (tmp_path / "report" / "method").mkdir(parents=True)
    shown = run_here(tmp_path, "--config-dir", "report", "--cfg", "job", "-p", "threads")
    assert (shown.returncode, shown.stdout) == (0, "1\n"), shown.stderr


def test_a_sweep_and_a_preset_of_one_s_own_are_measured_and_reported_anew_by_the_command_that_is_kept(tmp_path, own):
    asked = ["--config-dir", "own.d", "sweep=mine", *TOY]
    done = run_here(tmp_path, *asked)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "results" / "mine"
    table = pd.read_parquet(folder / "table.parquet")
    assert sorted(zip(table["method"], table["packet_rows"], strict=True)) == [("aligned", "automatic"), ("pixel", "1")]
    assert "--config-dir own.d sweep=mine" in (folder / "command.txt").read_text(encoding="utf-8")
    again = run_here(tmp_path, "--config-dir", "own.d", "report", "sweep=mine")
    assert (again.returncode, again.stdout) == (0, f"report: {os.path.join('results', 'mine', 'report.html')}\n")


def test_an_option_of_another_method_is_told_with_the_methods_that_have_it(tmp_path):
    line = one_line(run_here(tmp_path, "method=pixel", "method.split_x=4"))
    assert line.endswith("; it is an option of method=visible_first, aligned, tiles")
    assert "split_y" not in line
    assert "did you mean method.packet_rows?" in one_line(run_here(tmp_path, "method=pixel", "method.packet_row=4"))


def test_help_lists_every_verb_and_all_that_is_registered_wings_too(tmp_path):
    shown = run_here(tmp_path, "--help")
    assert shown.returncode == 0, shown.stderr
    told = set(re.findall(r"^python run\.py (\S+)", shown.stdout, re.MULTILINE))
    assert verbs().keys() - {"measure"} <= told
    listing = shown.stdout.partition("== Config ==")[0]
    groups = dict(re.findall(r"^(method|workload): (.*)$", listing, re.MULTILINE))
    listed = {group: set(names.split(", ")) for group, names in groups.items()}
    assert listed == {"method": {one.name for one in METHODS}, "workload": {one.name for one in WORKLOADS}}
    assert listed["method"] | listed["workload"] > WINGS
    assert "method.culling: keep only triangles" in shown.stdout
    scenes = dict(re.findall(r"^(scene\S*): (.*)$", listing, re.MULTILINE))
    assert scenes.keys() == {"scene"}, "a group that is no choice of its own"
    assert "generated_terrain" in scenes["scene"]


def test_a_verb_is_found_behind_flags_and_says_how_it_is_called(tmp_path):
    for verb in verbs():
        shown = run_here(tmp_path, "--config-dir", ".", verb, "--help")
        assert shown.returncode == 0, shown.stderr
        assert shown.stdout.startswith("usage: "), verb
        if verb in ("new-method", "pack", "board", "rays"):  # which have no configuration
            assert re.match(rf"usage: \S+.* {verb} .*\n\n`atra {verb} ", shown.stdout)
    assert not list(tmp_path.iterdir())


HEAVY = {"numba", "llvmlite", "pandas", "matplotlib", "scipy", "trimesh"}
"""Packages whose import takes most of a second."""


@pytest.mark.parametrize(("arguments", "line", "expected"), [
    (["--help"], "", "method.culling: "), (["--version"], "", "Hydra 1.3"), (["--cfg", "job"], "", "method_file: null"),
    (["-sc", "query=bash"], "run.py method=vis", "method=visible_first"),
    (["-sc", "query=bash"], "run.py method.cul", "method.culling="),
    (["-sc", "query=bash"], "run.py method=pixel method.coh", "method.coherent="),
    (["-sc", "query=bash"], "run.py workload=class", "workload=classification"),
    (["-sc", "query=bash"], "run.py sweep=hor", "sweep=horizontal"),
])  # fmt: skip
def test_help_completion_and_version_wait_for_no_package_that_measures(tmp_path, arguments, line, expected):
    code = (
        "import sys, atexit; from experiments.cli import main\n"
        f"atexit.register(lambda: print('loaded', *{HEAVY!r} & sys.modules.keys()))\n"
        f"sys.argv = ['run.py', *{arguments!r}]\nsys.exit(main())"
    )
    variables = {**os.environ, "COMP_LINE": line, "COMP_POINT": str(len(line)), "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=variables, capture_output=True, text=True, check=True
    )
    *told, loaded = done.stdout.splitlines()
    assert expected in "\n".join(told)
    assert loaded == "loaded"
