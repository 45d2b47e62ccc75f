"""External programs: the example in C++ where there is a compiler, the one in Python everywhere; both judged."""

import shlex
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from atra.errors import AtraError, ClockError, InputError
from atra.prim_ids import MISS
from experiments.methods.outside.guards import ClockGuard, check_images, delays_s
from tests.folders import ROOT
from tests.points import measured, planned

pytestmark = pytest.mark.uncovered

EXAMPLES = ROOT / "examples" / "external"
COMPILER = shutil.which("c++") or shutil.which("g++")
IN_PYTHON = shlex.join([sys.executable, str(EXAMPLES / "trace.py")])


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """The command of the example in C++."""
    if COMPILER is None:
        pytest.skip("no C++ compiler here")
    program = tmp_path_factory.mktemp("external") / "trace"
    subprocess.run([COMPILER, "-O2", "-std=c++17", "-o", str(program), str(EXAMPLES / "trace.cpp")], check=True)
    return shlex.join([str(program)])


@pytest.mark.parametrize(("language", "size"), [("python", (16, 12)), ("cpp", (64, 48))])
def test_an_example_sees_what_single_rays_see_through_any_place_of_a_pixel(language, size, request):
    command = IN_PYTHON if language == "python" else request.getfixturevalue("compiled")
    asked = {"sample_rays": 20, "offsets": [[0.5, 0.5], [0.0, 0.25]]}
    results = measured("program", "agreement", options={"command": command}, asked=asked, size=size).results
    assert results["pixels_wrong"] == results["pixels_hole"] == 0
    assert results["pixels_equal"] > 0.9 * 2 * size[0] * size[1]


def test_a_program_that_traces_the_first_rays_again_for_every_place_in_a_pixel_is_wrong(tmp_path):
    example, path = (EXAMPLES / "trace.py").read_text(encoding="utf-8"), tmp_path / "trace.py"
    reads = "        self.rays = np.fromfile"
    path.write_text(example.replace(reads, f"        if not len(self.rays):\n    {reads}"), encoding="utf-8")
    command = shlex.join([sys.executable, str(path)])
    results = measured("program", "frame", options={"command": command}, size=(16, 12)).results
    assert results["pixels_wrong"] > 16 * 12 / 2


def test_its_own_clock_counts_for_frames_and_builds(compiled):
    got = measured("program", "frame", options={"command": compiled}, size=(64, 48))
    assert all(0.0 < one < 1.0 for one in got.samples["own"])
    assert got.results["build_time_s"] < 0.1  # starting a program and writing files is no part of it


def program(text):
    """The command of a program that answers `ok` to everything, changed by `text`."""
    code = "import sys, time, struct\nfor line in sys.stdin:\n    word = line.split()[0]\n    answer = 'ok 1e-9'\n"
    return shlex.join([sys.executable, "-c", f"{code}{text}\n    print(answer, flush=True)"])


@pytest.mark.parametrize(("text", "reason"), [
    ("    if word == 'mesh': sys.exit(3)", "ended with exit code 3 when asked to mesh"),
    ("    if word == 'rays': answer = 'error no room'", "answered 'error no room' to rays"),
    ("    if word == 'mesh': answer = 'ok soon'", "answered 'soon' to mesh, expected seconds"),
    ("    if word == 'mesh': answer = 'ok 100'", "says that mesh took 100 s; the harness waited"),
    ("    if word == 'mesh': answer = 'x' * 10000", "answered 'xxx"),
    ("    pass", "wrote 0 bytes of hits, expected 6,144"),
])  # fmt: skip
def test_a_program_that_answers_wrongly_is_told(text, reason):
    with pytest.raises(AtraError, match=reason):
        measured("program", "picture", options={"command": program(text)}, size=(32, 24))


def test_a_program_that_is_not_there_and_one_that_changed_are_refused(tmp_path):
    with pytest.raises(InputError, match="expected a program that is there"):
        planned("program", "frame", options={"command": "no-such-program-anywhere"})
    path = tmp_path / "mine.py"
    path.write_text("1", encoding="utf-8")
    command = shlex.join([sys.executable, str(path)])
    point = planned("program", "frame", options={"command": command}).point
    path.write_text("2", encoding="utf-8")
    changed = planned("program", "frame", options={"command": command}).point
    assert changed.options.program_sha256 != point.options.program_sha256  # another point
    with pytest.raises(InputError, match="changed since this run began"):
        point.method.make(None, point.camera, point.options, point.tracing)


MISSES = np.full((2, 3), np.inf, np.float32), np.full((2, 3), MISS)


@pytest.mark.parametrize(("depth", "prim_id", "reason"), [
    (np.zeros((2, 3), np.float32), MISSES[1], "expected inf and 0xffffffff for a miss"),
    (MISSES[0], np.zeros((2, 3), np.uint32), "expected inf and 0xffffffff for a miss"),
    (np.zeros((2, 3), np.float32), np.full((2, 3), 7, np.uint32), "prim_id 7, expected one below 5"),
    (np.full((2, 3), np.nan, np.float32), MISSES[1], r"NaN at pixel \(0, 0\)"),
])  # fmt: skip
def test_images_that_are_none_are_refused(depth, prim_id, reason):
    check_images(*MISSES, 5)
    with pytest.raises(InputError, match=reason):
        check_images(depth, prim_id, 5)


def test_a_clock_may_leave_out_handing_over_and_waiting_for_a_core_but_not_the_tracing():
    guard = ClockGuard(rays=1_000_000)  # 16 ms may be handing over
    assert [guard.frame_time_s(0.030, 0.010) for _ in range(5)] == [0.010] * 5
    assert guard.frame_time_s(0.5, 0.4) == 0.4  # one that was disturbed
    with pytest.raises(ClockError, match=r"never waited less than 0\.03"):
        guard.frame_time_s(0.030, 0.001)
    guard = ClockGuard(rays=1)
    assert [guard.frame_time_s(0.030, 0.001, delayed_s=0.028) for _ in range(5)] == [0.001] * 5
    with pytest.raises(ClockError, match=r"never waited less than 0\.0"):
        guard.frame_time_s(0.012, 0.0001, delayed_s=0.010)


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="this system does not tell of delays")
def test_a_process_that_shares_its_core_is_delayed():
    code = "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nprint(flush=True)\nwhile True: pass"
    rivals = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE) for _ in range(2)]
    try:
        for rival in rivals:
            rival.stdout.readline()
        processes = [psutil.Process(rival.pid) for rival in rivals]
        before_s, end_s = delays_s(processes), time.monotonic() + 60.0
        while delays_s(processes) - before_s < 0.1:  # each runs for half of the time
            assert time.monotonic() < end_s
            time.sleep(0.01)
    finally:
        for rival in rivals:
            rival.kill()
            rival.communicate()
    assert delays_s([]) == 0.0
