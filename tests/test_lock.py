"""Two runs never share a results folder."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from atra.errors import InputError, StorageError
from experiments.harness.lock import exclusive
from experiments.report.writing import rewrite_report
from tests.test_sweep import configuration

HOLD = """
import sys
from pathlib import Path
from experiments.harness.lock import exclusive
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


def test_a_folder_that_is_deleted_during_a_run_still_is_in_use_by_it(tmp_path: Path) -> None:
    results = tmp_path / "results"
    results.mkdir()
    command = [sys.executable, "-c", HOLD, str(results)]
    root = Path(__file__).resolve().parents[1]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=root) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        shutil.rmtree(results)
        results.mkdir()
        with pytest.raises(InputError, match=rf"in use by process {other.pid} on .*choose another results_dir"):
            exclusive(results).__enter__()
        other.kill()
        other.wait()
    with exclusive(results):
        pass


def test_a_run_leaves_no_lock_among_the_temporary_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    with exclusive(tmp_path):
        assert len(list((tmp_path / "temporary").iterdir())) == 2
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_report_is_refused_while_a_run_holds_the_folder(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    with (
        exclusive(tmp_path),
        pytest.raises(InputError, match=rf"in use by process {os.getpid()} on .*choose another results_dir"),
    ):
        rewrite_report(configuration(tmp_path))


@pytest.mark.parametrize("content", ["", "{", "[1]", '{"process": 1}', "\0"])
def test_a_holder_that_left_no_name_is_another_run(tmp_path: Path, content: str) -> None:
    with exclusive(tmp_path):
        (tmp_path / ".lock.holder").write_text(content)
        with pytest.raises(InputError, match="in use by another run"):
            exclusive(tmp_path).__enter__()


def test_a_folder_that_cannot_be_locked_is_refused(tmp_path: Path) -> None:
    (tmp_path / ".lock").mkdir()
    with pytest.raises(StorageError, match=r"cannot be locked: .*choose another results_dir"):
        exclusive(tmp_path).__enter__()


def test_no_room_for_the_holder_s_name_lets_go_of_the_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", full)
        with pytest.raises(StorageError, match=r"lock\.holder cannot be written: No space left on device"):
            exclusive(tmp_path).__enter__()
    with exclusive(tmp_path):
        pass


def test_a_half_written_file_that_cannot_be_removed_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def open_elsewhere(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "being used by another process")  # as Windows says

    left = tmp_path / ".a.json.x1.unfinished"
    left.touch()
    with monkeypatch.context() as busy:
        busy.setattr(Path, "unlink", open_elsewhere)
        with exclusive(tmp_path, tmp_path):
            pass
    assert left.exists()


def test_half_written_files_of_a_killed_run_are_removed_and_nothing_else(tmp_path: Path) -> None:
    names = [".a.json.x1.unfinished", "a.json", "a.json.corrupt"]
    for name in names:
        (tmp_path / name).write_text("{")
    with exclusive(tmp_path, tmp_path):
        pass
    left = {path.name for path in tmp_path.iterdir()} - {".lock"}
    assert left == {"a.json", "a.json.corrupt"}
