"""Two runs never share a results folder."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from atra.errors import InputError
from experiments.lock import exclusive

HOLD = """
import sys
from pathlib import Path
from experiments.lock import exclusive
with exclusive(Path(sys.argv[1]), Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_run_is_told_who_holds_the_folder_and_may_go_on_when_that_one_is_killed(tmp_path: Path) -> None:
    command = [sys.executable, "-c", HOLD, str(tmp_path)]
    root = Path(__file__).resolve().parents[1]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(InputError, match=rf"in use by process {other.pid} on .*choose another results_dir"):
            exclusive(tmp_path, tmp_path).__enter__()
        other.kill()
        other.wait()
    with exclusive(tmp_path, tmp_path):
        pass


def test_half_written_files_of_a_killed_run_are_removed_and_nothing_else(tmp_path: Path) -> None:
    names = [".a.json.x1.unfinished", "a.json", "a.json.corrupt"]
    for name in names:
        (tmp_path / name).write_text("{")
    with exclusive(tmp_path, tmp_path):
        pass
    left = {path.name for path in tmp_path.iterdir()} - {".lock"}
    assert left == {"a.json", "a.json.corrupt"}
