"""`new-method` writes a file that works as it is, and is measured without an edit here."""

import re
import subprocess
import sys

import pytest

from experiments.commands.new_method import run_new_method
from experiments.harness.processes.launching import project_environment
from tests.command import run_here
from tests.folders import ROOT

pytestmark = [pytest.mark.uncovered, pytest.mark.usefixtures("methods_as_before")]


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
