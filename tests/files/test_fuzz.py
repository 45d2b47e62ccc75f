"""Files nobody vouches for are used or refused; nothing else happens.

ATRA_FUZZ is how many mutated inputs are read: 150 unless set, 10000 for a night.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

if not sys.platform.startswith("linux"):
    pytest.skip("bounds the memory of a process as Linux does it", allow_module_level=True)

from tests import fuzzing

ROOT = Path(__file__).resolve().parents[2]
COUNT = int(os.environ.get("ATRA_FUZZ", "150"))


@pytest.mark.slow
def test_a_mutated_file_is_used_or_refused_within_memory_and_time_and_leaves_nothing_elsewhere(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzzing", str(COUNT)],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        timeout=60 + COUNT,
    )  # fmt: skip
    reading = (tmp_path / "now.txt").read_text() if (tmp_path / "now.txt").exists() else "a healthy file"
    if done.returncode < 0:
        pytest.fail(f"ended by {signal.Signals(-done.returncode).name} while reading {reading}\n{done.stderr[-2000:]}")
    assert done.returncode == 0, f"while reading {reading}: {done.stderr[-2000:]}"
    told = json.loads(done.stdout.splitlines()[-1])  # OpenEXR prints, too
    assert told["wrong"] == []
    assert set(told["healthy"]) == set(told["tally"]) - fuzzing.NEVER_USED
    assert sum(sum(counts.values()) for counts in told["tally"].values()) == COUNT
    # Mutations that change nothing, or of which everything is refused at the door, would prove nothing.
    assert all(counts["refused"] for counts in told["tally"].values())
    assert sum(counts["used"] for counts in told["tally"].values()) > COUNT / 20


def test_an_input_is_the_same_every_time_and_no_two_are_equal():
    kind = fuzzing.kinds()["mesh.off"]
    inputs = [fuzzing.make_input(kind, "mesh.off", seed) for seed in range(30)]
    assert inputs == [fuzzing.make_input(kind, "mesh.off", seed) for seed in range(30)]
    assert len(set(inputs) | set(kind.samples)) > 28
