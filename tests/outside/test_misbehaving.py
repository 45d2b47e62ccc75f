"""A method from outside may do anything: its point becomes a row with a reason, and the sweep goes on."""

import itertools
import os
import re
from dataclasses import replace

import pytest

from atra.errors import InputError
from experiments import methods
from experiments.harness.points import GridPoint
from experiments.harness.processes.launching import run_worker
from experiments.methods.outside import guarded, guards
from experiments.results.table import read_tables
from experiments.sweep import run_sweep
from tests.command import measure_here
from tests.points import configured, planned

pytestmark = [pytest.mark.uncovered, pytest.mark.usefixtures("figures_unsaved")]

PREPARED = """
import os, time, threading
import numpy as np
import atra

class Prepared(atra.Prepared):
    def __init__(self, mesh, camera):
        self.mesh, self.camera = mesh, camera
        self.inner = atra.PixelTracer(mesh, camera, threads=1)
        self.inner.build()

    def draw(self, offset, depth, prim_id):
        hits = self.inner.trace(offset)
        depth[:], prim_id[:] = hits.depth, hits.prim_id

    def close(self):
        self.inner.close()

"""
METHOD = """
class Mine(atra.Method):
    def prepare(self, mesh, camera, pool):
        return KIND(mesh, camera)
"""
GOOD = PREPARED + METHOD.replace("KIND", "Prepared")


def bad(body):
    """A method whose frames are drawn by a class with this body."""
    return f"{PREPARED}class Bad(Prepared):\n{body}\n{METHOD.replace('KIND', 'Bad')}"


DRAW, DRAWN = "    def draw(self, *images):\n        ", "super().draw(*images)"

BAD = {
    "crashes": (f"{DRAW}os.abort()", "killed by SIGABRT|exit code"),
    "hangs": (f"{DRAW}time.sleep(600)", "time limit of 3 s"),
    "unfinished": (f"{DRAW}{DRAWN}\n        images[1][7, 2] = np.nan", r"left a depth of NaN at pixel \(2, 7\)"),
    "idle": (f"{DRAW}pass", r"left a depth of NaN at pixel \(0, 0\)"),
    "too_fast": (
        f"    time_s = 1e-9\n{DRAW}time.sleep(0.02)\n        {DRAWN}",
        r"says that a frame took 1e-09 s; the harness never waited less than 0\.\d+ s",
    ),
    "vandal": (
        "    def __init__(self, mesh, camera):\n        super().__init__(mesh, camera)\n        import ctypes\n"
        "        ctypes.c_float.from_address(mesh.vertices.ctypes.data).value += 1.0",
        "the method changed the mesh",
    ),
    "talkative": (
        f"{DRAW}for _ in range(80):\n            print('x' * (1 << 20))\n        {DRAWN}",
        "it printed [0-9]+ MiB, more than the 64 MiB that are kept",
    ),
    "greedy": (
        f"{DRAW}def work():\n            a = np.ones(1 << 17)\n"
        "            end = time.thread_time() + 0.05\n            while time.thread_time() < end:\n"
        "                np.sin(a, out=a)\n"
        "            self.wait.wait()\n"
        "        self.wait = threading.Barrier(4)\n"
        "        if not hasattr(self, 'pool'):\n"
        "            from concurrent.futures import ThreadPoolExecutor\n"
        "            self.pool = ThreadPoolExecutor(4)\n"
        "        for one in [self.pool.submit(work) for _ in range(4)]:\n            one.result()\n"
        f"        {DRAWN}",
        "the method ran [45] threads, the point has threads=1",
    ),
}
"""Name -> what the class that draws adds, and the reason that the row gives."""

IN_PROCESS = ("good", "unfinished", "idle", "too_fast", "vandal")
"""Methods whose points may be measured in the process of the test, which takes less time than one of their own."""


def run(point):
    return (measure_here if point.method.name in IN_PROCESS else run_worker)(point)


@pytest.fixture
def files(tmp_path, methods_as_before):
    """Writes and uses method files."""

    def write(name, text):
        path = tmp_path / f"{name}.py"
        path.write_text(text, encoding="utf-8")
        return methods.use_method_file(str(path))

    return write


def test_each_misbehaving_method_is_a_row_with_its_reason_and_the_others_are_measured(files, tmp_path):
    for name, (body, _) in BAD.items():
        files(name, bad(body))
    files("good", GOOD)
    given = []
    for name in ("good", *BAD):
        measure = {"processes": 1, "time_limit_s": 3.0 if name == "hangs" else 60.0, "rounds": 3, "warmup": 1}
        point = configured(name, "frame", measure=measure)
        given.append(GridPoint("all", replace(point, results_dir=str(tmp_path / "results"))))
    with pytest.raises(SystemExit):
        run_sweep(given, run=run)
    table = read_tables(tmp_path / "results" / "point").points.set_index("method")
    assert table["status"]["good"] == "ok"
    assert table["pixels_wrong"]["good"] == 0
    for name, (_, reason) in BAD.items():
        assert table["status"][name] == "failed", name
        assert re.search(reason, table["error"][name]), table["error"][name]


def test_waiting_for_a_core_while_threads_are_counted_excuses_no_clock(files, monkeypatch):
    delay_s = [0.0]
    for name in ("begin", "end"):
        counting = getattr(guards.ThreadGuard, name)

        def waiting(self, counting=counting):
            delay_s[0] += 1.0
            return counting(self)

        monkeypatch.setattr(guards.ThreadGuard, name, waiting)
    monkeypatch.setattr(guarded, "delays_s", lambda _: delay_s[0])
    body, reason = BAD["too_fast"]
    files("too_fast", bad(body))
    outcome = measure_here(planned("too_fast", "frame").point)
    assert outcome.status == "failed"
    assert re.search(reason, outcome.error), outcome.error


def test_a_file_that_changes_has_another_version_and_is_not_measured_while_a_sweep_runs(files, tmp_path):
    version = files("mine", GOOD).version()
    assert files("mine", GOOD).version() == version
    (tmp_path / "mine.py").write_text(GOOD + "# changed\n", encoding="utf-8")
    outcome = run_worker(planned("mine", "frame").point)
    assert outcome.status == "failed"
    assert "changed since this run began" in outcome.error
    assert version in outcome.error
    assert files("mine", GOOD + "# changed\n").version() != version
    assert os.environ[methods.METHOD_FILES].count("mine.py") == 1


@pytest.mark.parametrize(("text", "reason"), [
    ("import no_such_package_of_anybody", "cannot be imported, ModuleNotFoundError"),
    ("x = 1", "function prepare: none"),
    (bad("    pass") + "class Other(Mine): pass", "function prepare: Mine, Other"),
    ("from dataclasses import dataclass\n@dataclass\nclass A:\n    rows: int\n    def prepare(self): ...", "a default"),
])  # fmt: skip
def test_a_file_without_a_method_is_refused_with_the_reason(files, text, reason):
    with pytest.raises(ValueError, match=reason):
        files("mine", text)
    with pytest.raises(ValueError, match="a name of letters that atra does not use"):
        files("pixel", GOOD)


def test_threads_are_counted_by_their_own_seconds_however_long_a_busy_machine_takes_over_a_frame(monkeypatch):
    now, frames = itertools.count(step=10.0), itertools.count()
    monkeypatch.setattr(guards.time, "perf_counter", lambda: next(now))
    monkeypatch.setattr(guards.ThreadGuard, "_found_spinning", lambda guard: set())
    # Four threads of one process compute for 50 ms in each frame.
    monkeypatch.setattr(
        guards.ThreadGuard, "_cpu_times", lambda guard: dict.fromkeys([(1, k) for k in range(4)], 0.05 * next(frames))
    )
    guard = guards.ThreadGuard(1, lambda: [None])
    guard.begin()
    guard.end()
    guard.begin()
    with pytest.raises(InputError, match="the method ran 4 threads, the point has threads=1"):
        guard.end()
