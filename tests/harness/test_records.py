"""Records: identity, whole files or none, bad files set aside; two runs never share a folder of results."""

import errno
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from atra.errors import InputError, RecordError, StorageError
from experiments.harness.records import (
    LACKED_MEMORY,
    Record,
    exclusive,
    load_record,
    point_id,
    read_record,
    record_path,
    write_record,
)
from experiments.report.writing import rewrite_report
from tests.folders import ROOT
from tests.sweeps import configuration

CONFIGURATION = {"scene": "box", "split_x": 4, "culling": True, "eye": [0.0, 1.0, 2.0], "threads": None}
MACHINE = {"cpu": "some cpu", "logical_cores": 2}
RECORD = Record(
    point_id=point_id(CONFIGURATION, MACHINE),
    status="ok",
    error=None,
    configuration=CONFIGURATION,
    environment=MACHINE,
    warmup_samples={"own": [2.0]},
    samples={"own": [1.0, 1.5], "rtcIntersect1": [3.0, 3.5]},
    results={"rss_bytes": 123},
)


def test_a_record_survives_the_file_and_a_missing_one_is_none(tmp_path):
    assert read_record(tmp_path / "made" / "on demand", RECORD.point_id) is None
    write_record(tmp_path / "made" / "on demand", RECORD)
    assert read_record(tmp_path / "made" / "on demand", RECORD.point_id) == RECORD


def test_the_identity_changes_with_every_field_and_not_with_the_order_of_keys():
    assert point_id(dict(reversed(CONFIGURATION.items())), MACHINE) == RECORD.point_id
    for change in ({"split_x": 8}, {"culling": False}, {"eye": [0.0, -1.0, 2.0]}, {"eye": [0.0, 0.1, 2.0]}):
        assert point_id(CONFIGURATION | change, MACHINE) != RECORD.point_id
    assert point_id(CONFIGURATION, MACHINE | {"logical_cores": 4}) != RECORD.point_id


def test_a_half_written_record_is_set_aside_with_a_warning(tmp_path):
    path = write_record(tmp_path, RECORD)
    half = path.read_text()[:100]
    path.write_text(half)
    with pytest.warns(UserWarning, match=rf"{path.name} cannot be read .*kept as .*corrupt, measuring the point again"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()
    assert (tmp_path / f"{RECORD.point_id}.json.corrupt").read_text() == half


@pytest.mark.parametrize("content", [b"", b"[]", b"null", b"\xff\xfe", b'{"format": 2, "status": "ok", "unknown": 1}'])
def test_a_file_that_is_no_record_is_set_aside(tmp_path, content):
    record_path(tmp_path, RECORD.point_id).write_bytes(content)
    with pytest.raises(RecordError, match="start its sweep again"):
        load_record(tmp_path, RECORD.point_id)
    assert record_path(tmp_path, RECORD.point_id).exists()
    with pytest.warns(UserWarning, match="measuring the point again"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not record_path(tmp_path, RECORD.point_id).exists()


def test_a_record_of_another_format_is_refused_and_one_of_an_earlier_version_of_this_one_is_read(tmp_path):
    path = write_record(tmp_path, RECORD)
    fields = json.loads(path.read_text())
    for version in (1, 3, None):
        path.write_text(json.dumps(fields | {"format": version}))
        with pytest.raises(RecordError, match=rf"it is of format {version}, expected 2\); start its sweep again"):
            load_record(tmp_path, RECORD.point_id)
    del fields["files"]
    path.write_text(json.dumps(fields | {"sha256": "0"}))
    assert load_record(tmp_path, RECORD.point_id) == RECORD


def refuse(*_, **__):
    """A call of the system for which there is no room."""
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    ("module", "call"),
    [(tempfile, "mkstemp"), (os, "fsync"), (os, "chmod"), (os, "replace"), (Path, "mkdir")],
    ids=lambda one: getattr(one, "__name__", one),
)
def test_a_failed_write_names_the_file_and_leaves_the_earlier_record_and_no_litter(tmp_path, monkeypatch, module, call):
    path = write_record(tmp_path, RECORD)
    with monkeypatch.context() as broken:
        broken.setattr(module, call, refuse)
        with pytest.raises(StorageError) as failed:
            write_record(tmp_path, replace(RECORD, results={"rss_bytes": 456}))
    assert str(failed.value).startswith(f"{path} cannot be written: {os.strerror(errno.ENOSPC)}; ")
    assert read_record(tmp_path, RECORD.point_id) == RECORD
    assert [path.name for path in tmp_path.iterdir()] == [f"{RECORD.point_id}.json"]


def test_only_points_that_failed_or_lacked_memory_are_worth_a_retry():
    assert RECORD.finished
    assert replace(RECORD, status="skipped", error="too large").finished
    assert not replace(RECORD, status="skipped", error="too large", results={LACKED_MEMORY: True}).finished
    assert not replace(RECORD, status="failed", error="killed").finished


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
