"""Two runs never share a results folder."""

import subprocess
import sys

import pytest

from atra.errors import InputError, StorageError
from experiments.harness.records import exclusive
from experiments.report.writing import rewrite_report
from tests.folders import ROOT
from tests.sweeps import configuration

HOLD = """
import sys
from pathlib import Path
from experiments.harness.records import exclusive
with exclusive(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""
IN_USE = "in use by another run; wait for it to end or choose another results_dir"


def test_a_second_run_or_report_is_refused_and_may_go_on_when_the_first_is_killed(tmp_path):
    (tmp_path / "one").mkdir()
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(InputError, match=IN_USE):
            exclusive(tmp_path).__enter__()
        with pytest.raises(InputError, match=IN_USE):
            rewrite_report(configuration(tmp_path))
        other.kill()
        other.wait()
    with exclusive(tmp_path):
        pass


def test_a_folder_that_cannot_be_locked_is_refused(tmp_path):
    (tmp_path / ".lock").mkdir()
    with pytest.raises(StorageError, match=r"cannot be locked: .*choose another results_dir"):
        exclusive(tmp_path).__enter__()


def test_half_written_files_of_a_killed_run_are_removed_and_nothing_else(tmp_path):
    for name in (".a.json.x1.unfinished", "a.json", "a.json.corrupt"):
        (tmp_path / name).write_text("{")
    with exclusive(tmp_path, tmp_path):
        pass
    assert {path.name for path in tmp_path.iterdir()} - {".lock"} == {"a.json", "a.json.corrupt"}
