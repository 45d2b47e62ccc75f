"""Sweeps whose points Hydra's launchers measure, each in a job of its own."""

import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import metadata

import pandas as pd
import psutil
import pytest

from tests.folders import ROOT

pytestmark = pytest.mark.slow

TOY = [
    "sweep=horizontal", "method.split_x=1,2", "method.culling=true", "width=32", "height=32", "measure.processes=1",
    "measure.rounds=3", "measure.warmup=1",
]  # fmt: skip
PACKAGES = {"joblib": "hydra-joblib-launcher", "submitit_local": "hydra-submitit-launcher"}


def command(launcher, *more):
    try:
        metadata.version(PACKAGES[launcher])
    except metadata.PackageNotFoundError:
        pytest.skip(f"{PACKAGES[launcher]} is not installed: pip install 'atra[{launcher.partition('_')[0]}]'")
    return [sys.executable, str(ROOT / "run.py"), *TOY, f"hydra/launcher={launcher}", *more]


@pytest.mark.parametrize(("launcher", "more", "left"), [
    ("joblib", ["hydra.sweeper.max_batch_size=2", "hydra.launcher.n_jobs=2"], set()),
    ("submitit_local", [], {".submitit"}),
], ids=["joblib", "submitit_local"])  # fmt: skip
def test_launched_jobs_measure_every_point_once_and_litter_only_the_results_folder(launcher, more, left, tmp_path):
    start = command(launcher, *more)
    done = subprocess.run(start, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "[2/2] cornell_box" in done.stderr
    assert [entry.name for entry in tmp_path.iterdir()] == ["results"]
    kept = {entry.name for entry in (tmp_path / "results").iterdir()} - {".lock"}
    assert kept == {"horizontal", "records"} | left
    table = pd.read_csv(tmp_path / "results" / "horizontal" / "table.csv")
    assert list(zip(table["split_x"], table["status"], table["pixels_wrong"], strict=True)) == [
        (1, "ok", 0), (2, "ok", 0),
    ]  # fmt: skip
    assert (tmp_path / "results" / "horizontal" / "figure5.png").exists()

    again = subprocess.run(start, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert again.returncode == 0, again.stderr
    assert "2 points in 2 processes: 2 finished before, 0 cannot be measured, 0 to do" in again.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends no SIGINT to one process")
@pytest.mark.parametrize("launcher", PACKAGES)
def test_an_interrupt_ends_the_jobs_and_keeps_what_is_done(launcher, tmp_path):
    # Seed 0 keeps the order: a short point, and one that would take a minute.
    endless = ["method.split_x=1", "measure.rounds=3,1000000", "measure.frame_budget_s=60", "sweep.shuffle_seed=0"]
    start = command(launcher, *endless)
    with subprocess.Popen(start, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as running:
        for line in running.stderr:
            if line.startswith("[1/2]"):
                break
        started = processes_below(running.pid)
        running.send_signal(signal.SIGINT)
        assert running.wait(timeout=30) == 130
        _, alive = psutil.wait_procs(started, timeout=10)
        for process in alive:
            process.kill()
        rest = running.stderr.read()  # ends with the last of them
    assert "1 points left, the same command goes on from here" in rest
    assert "Traceback" not in rest
    assert not alive
    table = pd.read_csv(tmp_path / "results" / "horizontal" / "table.csv")
    assert list(table["status"]) == ["ok"]


def processes_below(pid):
    """All of them, once the worker of a point is among them."""
    for _ in range(600):
        below = psutil.Process(pid).children(recursive=True)
        with suppress(psutil.Error):  # one that has just ended
            if any("experiments.worker" in process.cmdline() for process in below):
                return below
        time.sleep(0.1)
    pytest.fail("no worker was started")
