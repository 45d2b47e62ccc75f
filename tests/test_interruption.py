"""A killed run loses no finished point: a smoke sweep is killed with its whole process group and started again."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).resolve().parents[1]
SWEEP = ["sweep=smoke", "split_x=1,4", "split_y=1", "packet_width=8", "scene=cornell_box", "width=32", "height=32"]
KILLS = int(os.environ.get("ATRA_KILLS", "2"))
"""`ATRA_KILLS=20 python -m pytest tests/test_interruption.py` is the long form."""


def start(folder: Path) -> subprocess.Popen[bytes]:
    environment = {name: value for name, value in os.environ.items() if name != "ATRA_SCENES"}
    return subprocess.Popen(
        [sys.executable, str(ROOT / "run.py"), *SWEEP], cwd=folder, env=environment, stdout=subprocess.DEVNULL,
        stderr=(folder / "printed").open("ab"), start_new_session=True,
    )  # fmt: skip


def finished_records(folder: Path) -> dict[str, bytes]:
    """Content of every record that says it is finished, by name."""
    contents = {path.name: path.read_bytes() for path in (folder / "results" / "records").glob("*.json")}
    return {name: content for name, content in contents.items() if json.loads(content)["status"] in ("ok", "skipped")}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups to kill")
def test_kill_9_at_any_moment_loses_no_finished_point_and_the_table_is_complete_in_the_end(tmp_path: Path) -> None:
    moments = random.Random(7)
    kept: dict[str, bytes] = {}
    for _ in range(KILLS):
        running = start(tmp_path)
        # The first seconds only read the configuration: anywhere from there to a few points later.
        time.sleep(moments.uniform(0.5, 12.0))
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
        running.wait()
        now = finished_records(tmp_path)
        assert {name: now.get(name) for name in kept} == kept, "a finished point was lost or measured again"
        kept = now
    last = start(tmp_path)
    assert last.wait(timeout=300) == 0, (tmp_path / "printed").read_text()
    now = finished_records(tmp_path)
    assert {name: now.get(name) for name in kept} == kept, "a finished point was lost or measured again"
    table = pd.read_parquet(tmp_path / "results" / "smoke" / "table.parquet")
    assert (table["status"] == "ok").all()
    assert set(table["point_id"]) == {name.removesuffix(".json") for name in now}
    leftovers = [path.name for path in (tmp_path / "results" / "records").iterdir() if path.suffix != ".json"]
    assert leftovers == [], "temporary files of killed runs stay behind"
