"""`new-method` writes a file that works as it is; modules beside a file are found, and are part of its code."""

import os
import re
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

import numpy
import pytest

from atra.errors import InputError
from experiments import methods
from experiments.commands.new_method import run_new_method
from experiments.harness.configuration import results_folder
from experiments.harness.identity import current_environment, identity
from experiments.harness.points import GridPoint
from experiments.harness.processes.launching import project_environment, run_worker
from experiments.results.table import read_tables
from experiments.sweep import run_sweep
from tests.command import run_here
from tests.folders import ROOT
from tests.outside.test_misbehaving import GOOD
from tests.points import configured, planned

pytestmark = [pytest.mark.uncovered, pytest.mark.usefixtures("methods_as_before", "figures_unsaved")]


def test_the_file_is_measured_by_the_command_it_names_and_its_own_test_passes(tmp_path):
    assert run_here(tmp_path, "new-method", "mine").returncode == 0
    done = run_here(tmp_path, "method_file=mine.py", "scene=cornell_box", "width=48", "height=32", "measure.rounds=3")
    assert done.returncode == 0, done.stderr
    assert "cornell_box, frame, mine" in done.stderr
    assert re.search(r"pixels wrong +│ 0 ", done.stdout)
    command = [sys.executable, "mine.py"]
    tested = subprocess.run(command, cwd=tmp_path, env=project_environment(), capture_output=True, text=True)
    assert (tested.returncode, tested.stdout) == (0, "no pixel is wrong\n"), tested.stderr


def test_an_option_of_the_file_is_set_on_the_command_line_and_an_unknown_one_is_refused(tmp_path):
    run_here(tmp_path, "new-method", "mine")
    toy = ["method_file=mine.py", "width=16", "height=16", "measure.rounds=3"]
    assert run_here(tmp_path, *toy, "method.rows=3").returncode == 0
    assert "method.rows: " in run_here(tmp_path, "--help", *toy).stdout
    assert "method.rows: " in run_here(tmp_path, *toy, "--help").stdout
    done = run_here(tmp_path, *toy, "method.columns=3")
    assert done.returncode == 2
    assert "expected rows" in done.stderr


TAKEN = "Python has a module of that name, in whose place numpy.py would be imported"


@pytest.mark.parametrize(("name", "told"), [("pixel", "cannot be called"), ("9lives", "cannot be called"),
                                            ("", "cannot be called"), ("numpy", TAKEN)])  # fmt: skip
def test_a_name_that_no_method_can_have_is_refused(tmp_path, name, told):
    done = run_here(tmp_path, "new-method", name)
    assert done.returncode == 2
    assert told in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_of_data_does_not_take_its_name_a_file_that_is_there_stays_and_a_missing_one_is_refused(
    tmp_path, monkeypatch
):
    (tmp_path / "results").mkdir()
    assert run_here(tmp_path, "new-method", "results").returncode == 0
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("mine", encoding="utf-8")
    with pytest.raises(ValueError, match="is there already"):
        run_new_method(["mine"])
    assert (tmp_path / "mine.py").read_text(encoding="utf-8") == "mine"
    done = run_here(tmp_path, "method_file=missing.py")
    assert (done.returncode, "expected a Python file" in done.stderr) == (2, True)


def test_the_template_is_no_wider_than_our_own_files():
    text = (ROOT / "experiments" / "commands" / "new_method_template.txt").read_text(encoding="utf-8")
    assert max(map(len, text.splitlines())) <= 120


HELPED = GOOD.replace("= hits.depth, hits.prim_id", "= shifted(hits.depth), hits.prim_id")
SHIFTED = "def shifted(depth):\n    return depth + SHIFT\n"


@pytest.fixture
def write(tmp_path, methods_as_before):
    """Writes files below a folder."""

    def write(**files):
        for name, text in files.items():
            path = tmp_path / f"{name}.py"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")

    return write


def use(folder, name="mine"):
    return methods.use_method_file(str(folder / f"{name}.py"))


def test_a_helper_that_changes_makes_a_sweep_measure_again_and_its_fault_is_seen(write, tmp_path):
    def statuses():
        use(tmp_path)
        one = configured("mine", "frame", measure={"processes": 1, "rounds": 3, "warmup": 1})
        one = replace(one, results_dir=str(tmp_path / "results"))
        with suppress(SystemExit):  # where an image is wrong
            run_sweep([GridPoint("all", one)], run=run_worker)
        return list(read_tables(results_folder(one)).points["status"])

    write(mine="from shifting import shifted\n" + HELPED, shifting="SHIFT = 0.0\n" + SHIFTED)
    assert statuses() == ["ok"]
    write(shifting="SHIFT = 1.0\n" + SHIFTED)
    assert statuses() == ["wrong"]


@pytest.mark.parametrize(("helper", "files"), [
    ("shifting", {"mine": "from shifting import shifted\n"}),
    ("shifting", {"mine": "def shifted(depth):\n    import shifting\n    return shifting.shifted(depth)\n"}),
    ("shifting", {"mine": "from between import shifted\n", "between": "from shifting import *\n"}),
    ("inner/shifting", {"mine": "from inner.shifting import shifted\n", "inner/__init__": ""}),
    ("inner/shifting", {"mine": "from inner.shifting import shifted\n"}),
    ("inner/shifting", {"mine": "from inner import shifted\n", "inner/__init__": "from .shifting import shifted\n"}),
], ids=["at the top", "when called", "through another", "by its package", "by its folder", "in a package"])  # fmt: skip
def test_whatever_way_a_helper_is_imported_it_is_found_and_part_of_the_identity(write, tmp_path, helper, files):
    environment, found = current_environment(), []
    for shift in ("0.0", "1.0", "0.0"):
        write(**{**files, "mine": files["mine"] + HELPED, helper: f"SHIFT = {shift}\n{SHIFTED}"})
        use(tmp_path)
        found.append(identity(planned("mine", "frame").point, environment))
    assert found[0] == found[2] != found[1]
    point = planned("mine", "frame", (16, 16)).point
    outcome = run_worker(replace(point, rounds=1, warmup=0))
    assert outcome.status == "ok", outcome.error


def test_a_helper_that_changes_while_a_sweep_runs_is_not_measured(write, tmp_path):
    write(mine="from shifting import shifted\n" + HELPED, shifting="SHIFT = 0.0\n" + SHIFTED)
    use(tmp_path)
    point = planned("mine", "frame").point
    write(shifting="SHIFT = 1.0\n" + SHIFTED)
    assert "changed since this run began" in run_worker(point).error


def test_a_file_beside_it_hides_no_installed_package_and_what_it_does_not_name_is_no_part_of_it(write, tmp_path):
    write(mine=GOOD, numpy="raise RuntimeError('shadow')\n", other="A = 1\n")
    before = use(tmp_path).version()
    write(numpy="", other="A = 2\n")
    assert use(tmp_path).version() == before
    assert sys.modules["numpy"] is numpy
    write(mine="import importlib\nimportlib.import_module('oth' + 'er')\n" + GOOD)
    with pytest.raises(InputError, match="cannot be imported, ModuleNotFoundError: No module named 'other'"):
        use(tmp_path)
    write(mine=GOOD)
    use(tmp_path)
    point = planned("mine", "frame", (16, 16)).point
    assert run_worker(replace(point, rounds=1, warmup=0)).status == "ok"


def test_two_files_with_helpers_of_one_name_in_two_folders_are_refused(write, tmp_path):
    imports = "from shifting import shifted\n" + HELPED
    for name in ("one/first", "one/other", "two/second"):
        write(**{name: imports, f"{name[:3]}/shifting": "SHIFT = 0.0\n" + SHIFTED})
    assert use(tmp_path / "one", "other").name == "other"  # files of one folder share a helper
    use(tmp_path / "one", "first")
    with pytest.raises(
        InputError, match=r"second\.py and .*other\.py each import a module shifting of their own folder"
    ):
        use(tmp_path / "two", "second")
    os.environ[methods.METHOD_FILES] = ""  # another run
    assert use(tmp_path / "two", "second").name == "second"


@pytest.mark.parametrize("where", ["mine", "shifting"])
def test_what_a_file_or_its_helper_imports_of_this_project_is_part_of_its_code(write, tmp_path, where):
    files = {"mine": "import shifting\n" + GOOD, "shifting": ""}

    def code(line):
        write(**files | {where: line + files[where]})
        use(tmp_path)
        point = planned("mine", "frame", (16, 16)).point
        return run_worker(replace(point, rounds=1, warmup=0)).files

    room = "atra/trees/building.py"
    assert room not in code("")
    assert room in code("from atra.trees.building import cheapest_split\n")
