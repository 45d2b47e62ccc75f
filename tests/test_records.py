"""Records: identity, whole files or none, bad files set aside."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from atra.records import Record, point_id, read_record, record_path, write_record

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


def test_a_half_written_record_is_set_aside_with_a_warning(tmp_path: Path) -> None:
    path = write_record(tmp_path, RECORD)
    half = path.read_text()[:100]
    path.write_text(half)
    with pytest.warns(UserWarning, match="unreadable"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()
    assert (tmp_path / f"{RECORD.point_id}.json.corrupt").read_text() == half


@pytest.mark.parametrize(
    "edit",
    [
        {"format": 999},
        {"status": "fine"},
        {"status": "failed"},
        {"point_id": "another"},
        {"unknown": 1},
        {"samples": {"own": [1.0], "rtcIntersect1": [1.0, 2.0]}},
        {"samples": {"own": [0.0]}},
        {"samples": {"own": ["1"]}},
        {"samples": 3},
    ],
)
def test_a_record_that_makes_no_sense_is_set_aside(tmp_path: Path, edit: dict[str, Any]) -> None:
    path = write_record(tmp_path, RECORD)
    path.write_text(json.dumps({**json.loads(path.read_text()), **edit}))
    with pytest.warns(UserWarning, match="measuring again"):
        assert read_record(tmp_path, RECORD.point_id) is None
    assert not path.exists()


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff\xfe", b"null"])
def test_a_file_that_is_no_record_is_set_aside(tmp_path: Path, content: bytes) -> None:
    record_path(tmp_path, RECORD.point_id).write_bytes(content)
    with pytest.warns(UserWarning, match="measuring again"):
        assert read_record(tmp_path, RECORD.point_id) is None


def test_a_failed_write_leaves_the_earlier_record_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_record(tmp_path, RECORD)

    def full_disk(_: int) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space left"):
        write_record(tmp_path, replace(RECORD, results={"rss_bytes": 456}))
    assert read_record(tmp_path, RECORD.point_id) == RECORD
    assert [path.name for path in tmp_path.iterdir()] == [f"{RECORD.point_id}.json"]


def test_only_failed_points_are_worth_a_retry() -> None:
    assert RECORD.finished
    assert replace(RECORD, status="skipped", error="too large").finished
    assert not replace(RECORD, status="failed", error="killed").finished
