"""Files nobody vouches for are used or refused; nothing else happens.

ATRA_FUZZ is how many mutated inputs are read: 500 unless set, 10000 for a night.
"""

from __future__ import annotations

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

ROOT = Path(__file__).resolve().parents[1]
COUNT = int(os.environ.get("ATRA_FUZZ", "500"))


def test_a_mutated_file_is_used_or_refused_within_memory_and_time_and_leaves_nothing_elsewhere(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.fuzzing", str(COUNT)],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
        timeout=60 + COUNT,
    )  # fmt: skip
    reading = (tmp_path / "now.txt").read_text() if (tmp_path / "now.txt").exists() else "a healthy file"
    if done.returncode < 0:
        pytest.fail(f"ended by {signal.Signals(-done.returncode).name} while reading {reading}\n{done.stderr[-2000:]}")
    assert done.returncode == 0, f"while reading {reading}: {done.stderr[-2000:]}"
    told = json.loads(done.stdout)
    assert told["wrong"] == []
    assert set(told["healthy"]) == set(told["tally"]) - fuzzing.NEVER_USED
    assert sum(sum(counts.values()) for counts in told["tally"].values()) == COUNT
    # Mutations that change nothing, or of which everything is refused at the door, would prove nothing.
    assert all(counts["refused"] for counts in told["tally"].values())
    assert sum(counts["used"] for counts in told["tally"].values()) > COUNT / 20


def test_an_input_is_the_same_every_time_and_no_two_are_equal() -> None:
    kind = fuzzing.kinds()["mesh.off"]
    inputs = [fuzzing.make_input(kind, "mesh.off", seed) for seed in range(30)]
    assert inputs == [fuzzing.make_input(kind, "mesh.off", seed) for seed in range(30)]
    assert len(set(inputs) | set(kind.samples)) > 28


@pytest.mark.parametrize("fault", ["hang", "hoard", "litter", "crash", "shout"])
def test_a_reader_that_misbehaves_is_found(fault: str, tmp_path: Path) -> None:
    faults = {
        "hang": "import time; time.sleep(60)",
        "hoard": "import numpy; error = InputError('too large'); error.__cause__ = grab(); raise error",
        "litter": "(path.parents[1] / 'litter').write_text('')",
        "crash": "raise KeyError('x')",
        "shout": "error = InputError('x'); error.args = ('\\x1b[31m',); raise error",
    }
    program = f"""
import json, sys
from pathlib import Path
from atra.errors import InputError
from tests import fuzzing

def grab():
    import numpy
    try:
        numpy.ones(2 * fuzzing.MEMORY_BYTES, numpy.uint8)
    except MemoryError as error:
        return error

def read(path):
    if healthy:
        return True
    {faults[fault]}

fuzzing.kinds = lambda: {{"one": fuzzing.Kind("one", (b"x",), read)}}
fuzzing.TIME_S = 1
healthy = True
bound = fuzzing._bound_memory
def bound_then_fail():
    global healthy
    bound()
    healthy = False
fuzzing._bound_memory = bound_then_fail
print(json.dumps(fuzzing.work(1, Path.cwd())["wrong"]))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    if fault == "hang":
        assert done.returncode == -signal.SIGALRM
        return
    assert done.returncode == 0, done.stderr
    (wrong,) = json.loads(done.stdout)
    expected = {
        "hoard": "memory was asked for",
        "litter": "outside the folder",
        "crash": "KeyError",
        "shout": "raw control",
    }
    assert wrong.startswith("one 0: ")
    assert expected[fault] in wrong
