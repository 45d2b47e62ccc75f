"""A worker may end in any way: its point becomes a row with a reason, and the sweep goes on."""

from __future__ import annotations

import sys
from dataclasses import replace

import pytest

from experiments.launch import run_worker
from experiments.point import Point

POINT = Point(
    scene="box", scene_source="procedural", scene_path=None, mesh_sha256="0", triangles=1, eye=(0.0, 0.0, 1.0),
    target=(0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), fov_y_degrees=60.0, width=8, height=8, method="aligned",
    geometry="copied", split_x=1, split_y=1, culling=True, packet_width=1, packet_rows=None, threads=1, ties="lowest",
    build_quality="medium", quantity="time", rounds=3, warmup=0, frame_budget_s=1.0, time_limit_s=30.0,
    memory_budget_gib=1.0,
)  # fmt: skip


def worker(code: str) -> list[str]:
    """A worker that runs `code`; `job` is what it was given."""
    return [sys.executable, "-c", f"import json, os, sys, time; job = json.load(sys.stdin)\n{code}"]


def test_the_point_reaches_the_worker_and_the_outcome_comes_back() -> None:
    code = "json.dump({'status': 'ok', 'results': job['point']}, open(job['result_path'], 'w')); print('noise')"
    outcome = run_worker(POINT, worker(code))
    assert outcome.status == "ok"
    assert Point.from_fields(outcome.results) == POINT


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("print('the last words'); sys.exit(3)", "exit code 3; it said: the last words"),
        ("pass", "without a result"),
        ("open(job['result_path'], 'w').write('{\"status\": ')", "unreadable"),
        ("open(job['result_path'], 'w').write('[1, 2]')", "unreadable"),
        ("open(job['result_path'], 'w').write('{\"nonsense\": 1}')", "unreadable"),
    ],
)
def test_a_worker_without_a_good_result_fails_with_the_reason(code: str, reason: str) -> None:
    outcome = run_worker(POINT, worker(code))
    assert outcome.status == "failed"
    assert reason in str(outcome.error)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals of this kind")
def test_a_killed_worker_fails_with_the_signal() -> None:
    outcome = run_worker(POINT, worker("os.kill(os.getpid(), 9)"))
    assert (outcome.status, outcome.error) == ("failed", "the worker was killed by SIGKILL (out of memory?)")


def test_a_worker_past_its_time_limit_is_stopped() -> None:
    outcome = run_worker(replace(POINT, time_limit_s=1.0), worker("time.sleep(60)"))
    assert outcome.status == "failed"
    assert "time limit of 1 s" in str(outcome.error)


def test_a_worker_that_does_not_listen_fails() -> None:
    outcome = run_worker(POINT, [sys.executable, "-c", "raise SystemExit(4)"])
    assert outcome.status == "failed"
    assert "exit code 4" in str(outcome.error)
