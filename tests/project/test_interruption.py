"""A killed run loses no finished point: a smoke sweep is killed with its whole process group and started again."""

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

pytestmark = [pytest.mark.uncovered, pytest.mark.slow]

ROOT = Path(__file__).resolve().parents[2]
KILLS = int(os.environ.get("ATRA_KILLS", "0"))
"""`ATRA_KILLS=20` is the long form: all of sweep=smoke, killed 20 times."""
SWEEP = (
    ["sweep=smoke"]
    if KILLS
    else ["sweep=horizontal", "method.split_x=1,4", "width=32", "height=32", "measure.processes=1", "measure.rounds=3"]
)


def start(folder):
    environment = {name: value for name, value in os.environ.items() if name != "ATRA_SCENES"}
    return subprocess.Popen(
        [sys.executable, str(ROOT / "run.py"), *SWEEP], cwd=folder, env=environment, stdout=subprocess.DEVNULL,
        stderr=(folder / "printed").open("ab"), start_new_session=True,
    )  # fmt: skip


def finished_records(folder):
    """Content of every record that says it is finished, by name."""
    contents = {path.name: path.read_bytes() for path in (folder / "results" / "records").glob("*.json")}
    return {name: content for name, content in contents.items() if json.loads(content)["status"] in ("ok", "skipped")}


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no process groups to kill")
def test_kill_9_at_any_moment_loses_no_finished_point_and_the_table_is_complete_in_the_end(tmp_path):
    moments = random.Random(7)
    kept = {}
    for _ in range(KILLS or 2):
        running = start(tmp_path)
        time.sleep(moments.uniform(1.0, 6.0))  # from while it reads its configuration to a few points later
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
    table = pd.read_parquet(next((tmp_path / "results").glob("*/table.parquet")))
    assert (table["status"] == "ok").all()
    assert set(table["point_id"]) == {name.removesuffix(".json") for name in now}
    leftovers = [path.name for path in (tmp_path / "results" / "records").iterdir() if path.suffix != ".json"]
    assert leftovers == [], "temporary files of killed runs stay behind"
