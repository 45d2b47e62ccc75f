"""Records: identity, whole files or none, bad files set aside."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import pytest

from atra.errors import RecordError, StorageError
from experiments.harness.records import Record, load_record, point_id, read_record, record_path, write_record

CONFIGURATION: dict[str, Any] = {"scene": "box", "split_x": 4, "culling": True, "eye": [0.0, 1.0, 2.0], "threads": None}
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


def test_a_record_survives_the_file(tmp_path: Path) -> None:
    write_record(tmp_path / "made" / "on demand", RECORD)
    assert read_record(tmp_path / "made" / "on demand", RECORD.point_id) == RECORD


def test_a_missing_record_is_none(tmp_path: Path) -> None:
    assert read_record(tmp_path, RECORD.point_id) is None


@pytest.mark.parametrize(
    ("configuration", "machine"),
    [
        ({**CONFIGURATION, "split_x": 8}, MACHINE),
        ({**CONFIGURATION, "culling": False}, MACHINE),
        ({**CONFIGURATION, "eye": [0.0, -1.0, 2.0]}, MACHINE),
        ({**CONFIGURATION, "eye": [0.0, 0.1, 2.0]}, MACHINE),
        (CONFIGURATION, {**MACHINE, "logical_cores": 4}),
    ],
)
def test_the_identity_changes_with_every_field(configuration: dict[str, Any], machine: dict[str, Any]) -> None:
    assert point_id(configuration, machine) != RECORD.point_id


def test_the_identity_ignores_the_order_of_keys() -> None:
    assert point_id(dict(reversed(CONFIGURATION.items())), MACHINE) == RECORD.point_id


def signed(fields: dict[str, Any]) -> str:
    """A file's text with the digest of its fields, whatever they are."""
    content = {name: value for name, value in fields.items() if name not in ("format", "sha256")}
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return json.dumps({"format": 2, **fields, "sha256": hashlib.sha256(canonical.encode()).hexdigest()})


def test_a_half_written_record_is_set_aside_with_a_warning(tmp_path: Path) -> None:
    path = write_record(tmp_path, RECORD)
    half = path.read_text()[:100]
    path.write_text(half)
    with pytest.warns(UserWarning, match=rf"{path.name} is damaged .*kept as .*corrupt, measuring the point again"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()
    assert (tmp_path / f"{RECORD.point_id}.json.corrupt").read_text() == half


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("1.5", "1.4"),
        ("123", "124"),
        ('"some cpu"', '"another cpu"'),
        ('"culling": true', '"culling": false'),
        ('"culling": true', '"culling": 1'),
        ('"error": null', '"error": null, "note": 1'),
        ('"sha256": "', '"sha256": "0'),
        ('"sha256"', '"sha257"'),
    ],
)
def test_a_record_changed_after_it_was_written_is_refused(tmp_path: Path, before: str, after: str) -> None:
    path = write_record(tmp_path, RECORD)
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(RecordError, match=rf"{path.name} was changed after it was written.*start its sweep again"):
        load_record(tmp_path, RECORD.point_id)
    assert path.exists()
    with pytest.warns(UserWarning, match="was changed after it was written"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()


def test_how_a_record_is_laid_out_is_no_change(tmp_path: Path) -> None:
    path = write_record(tmp_path, RECORD)
    path.write_text(json.dumps(dict(reversed(json.loads(path.read_text()).items()))))
    assert read_record(tmp_path, RECORD.point_id) == RECORD


@pytest.mark.parametrize("version", [1, 3, None, "2"])
def test_a_record_of_another_format_is_refused_by_its_number(tmp_path: Path, version: object) -> None:
    path = write_record(tmp_path, RECORD)
    fields = {**json.loads(path.read_text()), "format": version}
    if version == 1:  # which knew no digest
        del fields["sha256"]
    path.write_text(json.dumps(fields))
    with pytest.raises(RecordError, match=rf"is of format {version!r}, this version of atra reads format 2"):
        load_record(tmp_path, RECORD.point_id)


@pytest.mark.parametrize(
    "edit",
    [
        {"status": "fine"},
        {"status": "failed"},
        {"error": 3, "status": "failed"},
        {"point_id": "another"},
        {"unknown": 1},
        {"results": []},
        {"environment": None},
        {"samples": {"own": [1.0], "rtcIntersect1": [1.0, 2.0]}},
        {"warmup_samples": {"own": [1.0], "rtcIntersect1": []}},
        {"samples": {"own": [0.0]}},
        {"samples": {"own": [-1.0]}},
        {"samples": {"own": [True]}},
        {"samples": {"own": [10**400]}},
        {"samples": {"own": ["1"]}},
        {"samples": {"own": "1"}},
        {"samples": 3},
    ],
)
def test_a_record_that_makes_no_sense_is_set_aside_even_if_its_digest_fits(
    tmp_path: Path, edit: dict[str, Any]
) -> None:
    path = write_record(tmp_path, RECORD)
    path.write_text(signed({**json.loads(path.read_text()), **edit}))
    with pytest.warns(UserWarning, match=r"makes no sense .*measuring the point again|holds point another"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()


def test_the_digest_of_these_tests_is_that_of_the_file(tmp_path: Path) -> None:
    path = write_record(tmp_path, RECORD)
    fields = json.loads(path.read_text())
    assert json.loads(signed(fields)) == fields


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff\xfe", b"null", b"[" * 200_000, b'{"format": 2, "a": NaN}'])
def test_a_file_that_is_no_record_is_set_aside(tmp_path: Path, content: bytes) -> None:
    record_path(tmp_path, RECORD.point_id).write_bytes(content)
    with pytest.warns(UserWarning, match="measuring the point again"):
        assert read_record(tmp_path, RECORD.point_id) is None


def test_nesting_is_refused_at_every_depth(tmp_path: Path) -> None:
    # Somewhere here reading still works and the digest no longer does.
    for depth in range(sys.getrecursionlimit() - 200, sys.getrecursionlimit() + 10):
        nested = f'{{"format": 2, "sha256": "0", "a": {"[" * depth}{"]" * depth}}}'
        record_path(tmp_path, RECORD.point_id).write_text(nested)
        with pytest.raises(RecordError, match="start its sweep again"):
            load_record(tmp_path, RECORD.point_id)


def test_a_folder_in_the_place_of_a_record_is_set_aside(tmp_path: Path) -> None:
    record_path(tmp_path, RECORD.point_id).mkdir()
    with pytest.warns(UserWarning, match="cannot be read"):
        assert read_record(tmp_path, RECORD.point_id) is None


def test_a_bad_record_that_cannot_be_set_aside_stops_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_path(tmp_path, RECORD.point_id).write_text("{")
    monkeypatch.setattr(os, "replace", refuse(errno.EROFS))
    with pytest.raises(StorageError, match=r"is damaged .*cannot be set aside: Read-only file system; remove it"):
        read_record(tmp_path, RECORD.point_id)


def refuse(code: int) -> Callable[..., NoReturn]:
    """A call of the system that fails with error `code`."""

    def call(*_: object, **__: object) -> NoReturn:
        raise OSError(code, os.strerror(code))

    return call


@pytest.mark.parametrize(
    ("module", "call"),
    [(tempfile, "mkstemp"), (os, "fsync"), (os, "chmod"), (os, "replace"), (Path, "mkdir")],
    ids=lambda one: getattr(one, "__name__", one),
)
@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT])
def test_a_failed_write_names_the_file_and_leaves_the_earlier_record_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: Any, call: str, code: int
) -> None:
    path = write_record(tmp_path, RECORD)
    with monkeypatch.context() as broken:
        broken.setattr(module, call, refuse(code))
        with pytest.raises(StorageError) as failed:
            write_record(tmp_path, replace(RECORD, results={"rss_bytes": 456}))
    assert str(failed.value).startswith(f"{path} cannot be written: {os.strerror(code)}; ")
    assert read_record(tmp_path, RECORD.point_id) == RECORD
    assert [path.name for path in tmp_path.iterdir()] == [f"{RECORD.point_id}.json"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no device that is always full")
def test_a_disk_that_is_really_full_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def on_a_full_disk(*_: object, **__: object) -> tuple[int, str]:
        return os.open("/dev/full", os.O_WRONLY), str(tmp_path / "temporary")

    monkeypatch.setattr(tempfile, "mkstemp", on_a_full_disk)
    with pytest.raises(StorageError, match="No space left on device"):
        write_record(tmp_path, RECORD)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit on the size of files")
def test_a_file_larger_than_the_system_allows_is_refused_whole(tmp_path: Path) -> None:
    # What a full disk does, the system does here: the first bytes are written, the others are not.
    code = (
        "import resource, sys; from pathlib import Path; from experiments.harness.records import write_atomically; "
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)); write_atomically(Path(sys.argv[1]), bytes(100_000))"
    )
    root = Path(__file__).resolve().parents[1]
    path = tmp_path / "table.parquet"
    path.write_bytes(b"the earlier table")
    done = subprocess.run([sys.executable, "-c", code, str(path)], cwd=root, capture_output=True, text=True)
    assert f"StorageError: {path} cannot be written: File too large" in done.stderr
    assert path.read_bytes() == b"the earlier table"
    assert list(tmp_path.iterdir()) == [path]


def test_only_failed_points_are_worth_a_retry() -> None:
    assert RECORD.finished
    assert replace(RECORD, status="skipped", error="too large").finished
    assert not replace(RECORD, status="failed", error="killed").finished
