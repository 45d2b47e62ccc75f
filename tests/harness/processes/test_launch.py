"""A worker may end in any way: its point becomes a row with a reason, and a whole result comes through unchanged."""

import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import replace

import psutil
import pytest

from atra.compiled.instruction_sets import VARIABLE
from experiments.harness.processes.launching import run_worker
from experiments.harness.processes.worker import CANNOT_WRITE, read_result
from experiments.harness.records import Record
from experiments.workloads.build import BUILD
from experiments.workloads.memory import MEMORY as MEMORY_WORKLOAD
from experiments.workloads.multiframe import MULTIFRAME, MultiframeOptions
from experiments.workloads.picture import PICTURE
from tests.folders import ROOT
from tests.points import POINT

MEMORY = {
    "triangles_traced": 1, "packet_width": 1, "threads": 1, "rss_start_bytes": 60, "rss_mesh_bytes": 80,
    "rss_bytes": 100, "peak_rss_bytes": 120,
}  # fmt: skip
COUNTS = {
    "pixels_equal": 60, "pixels_tied": 2, "pixels_edge": 1, "pixels_wrong": 1, "pixels_hole": 0,
    "baseline_pixels_hole": 0, "depth_error_max": 1e-7, "depth_error_p999": 1e-7, "baseline_depth_error_max": 1e-7,
    "baseline_depth_error_p999": 1e-7,
}  # fmt: skip
TIMES = {"plan_time_s": 0.0, "build_time_s": 0.1, "baseline_build_time_s": 0.1, "rounds": 3}
ROUNDS = {"rounds": 4}
METHODS = ("own", "rtcIntersect1", "packets_8")
GOOD = Record(
    "",
    "ok",
    warmup_samples={name: [1.0] for name in METHODS},
    samples={name: [0.5, 0.25, 0.5] for name in METHODS},
    results=MEMORY | COUNTS | TIMES,
)


POSIX_ONLY = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no signals, groups or limits of this kind")


def worker(code):
    """A worker that runs `code`; `job` is what it was given."""
    start = "import json, os, signal, subprocess, sys, time; job = json.loads(sys.stdin.readline())"
    return [sys.executable, "-c", f"{start}\n{code}"]


def leaving(content):
    """A worker whose result is `content`."""
    return worker(f"open(job['result_path'], 'wb').write({content!r})")


def wait_until(true):
    for _ in range(1200):
        if true():
            return
        time.sleep(0.05)
    pytest.fail("waited a minute in vain")


def ended(pid):
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


def test_the_point_reaches_the_worker_the_outcome_comes_back_and_no_temporary_file_stays(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    told = f"told = json.loads({GOOD.to_json()!r}); told['results']['scene'] = job['point']['scene']\n"
    command = worker(told + "json.dump(told, open(job['result_path'], 'w')); print('noise')")
    outcome = run_worker(replace(POINT, scene="two\nlines"), command)
    assert outcome == replace(GOOD, results=GOOD.results | {"scene": "two\nlines"})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("of_point", "reached"), [(None, "of the run"), ("avx", "avx")])
def test_a_worker_is_held_to_the_instruction_set_of_its_point_or_else_to_that_of_the_run(
    of_point, reached, monkeypatch
):
    monkeypatch.setenv(VARIABLE, "of the run")
    told = f"told = json.loads({GOOD.to_json()!r}); told['results']['set'] = os.environ[{VARIABLE!r}]\n"
    command = worker(told + "json.dump(told, open(job['result_path'], 'w'))")
    assert run_worker(replace(POINT, instruction_set=of_point), command).results["set"] == reached


@pytest.mark.parametrize(("command", "reason"), [
    (worker("print('the last words'); sys.exit(3)"), "exit code 3; it said: the last words"),
    (worker("pass"), "without a result"),
    (worker(f"sys.exit({CANNOT_WRITE})"), "could not write its result to .*TMPDIR"),
    ([sys.executable, "-c", "raise SystemExit(4)"], "exit code 4"),  # it does not listen
    (["no such program"], "no worker could be started"),
])  # fmt: skip
def test_a_worker_without_a_result_fails_with_the_reason(command, reason):
    outcome = run_worker(POINT, command)
    assert outcome.status == "failed"
    assert re.search(reason, str(outcome.error))


@pytest.mark.parametrize("content", [b"", b"null", b"[1, 2]", b'{"status": "ok", "other": 1}', GOOD.to_json()[:300]])
def test_an_incomplete_result_of_a_worker_is_a_failed_point_without_samples(content):
    outcome = run_worker(POINT, leaving(content))
    assert (outcome.status, outcome.samples) == ("failed", {})
    assert "the worker's result is not complete" in str(outcome.error)


@POSIX_ONLY
def test_a_killed_worker_fails_with_the_signal_even_if_its_result_is_there():
    code = f"open(job['result_path'], 'wb').write({GOOD.to_json()!r}); os.kill(os.getpid(), 9)"
    outcome = run_worker(POINT, worker(code))
    assert (outcome.status, outcome.error) == ("failed", "the worker was killed by SIGKILL (out of memory?)")


@pytest.mark.slow
@pytest.mark.parametrize("code", ["time.sleep(60)", "signal.signal(signal.SIGTERM, signal.SIG_IGN)\nwhile True: pass"])
def test_a_worker_past_its_time_limit_is_stopped_whatever_it_ignores(code):
    outcome = run_worker(replace(POINT, time_limit_s=1.0), worker(code))
    assert outcome.status == "failed"
    assert "time limit of 1 s" in str(outcome.error)


@pytest.mark.slow
@POSIX_ONLY
@pytest.mark.parametrize("end", ["", "time.sleep(60)"], ids=["ends", "hangs"])
def test_processes_a_worker_leaves_behind_are_killed_and_not_waited_for(end):
    # The child holds the worker's output open, and lives on when the worker ends.
    code = f"child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)']); print(child.pid)\n{end}"
    outcome = run_worker(replace(POINT, time_limit_s=5.0), [*worker(code)[:1], "-u", *worker(code)[1:]])
    child = int(outcome.results["worker_output"])
    wait_until(lambda: ended(child))
    assert outcome.status == "failed"


@pytest.mark.slow
def test_without_process_groups_a_worker_is_stopped_with_what_it_has_started(monkeypatch, tmp_path):
    monkeypatch.delattr(os, "killpg", raising=False)  # as on Windows
    code = "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
    code += f"open({str(tmp_path / 'child')!r}, 'w').write(str(child.pid)); time.sleep(600)"
    outcome = run_worker(replace(POINT, time_limit_s=5.0), worker(code))
    assert "time limit" in str(outcome.error)
    child = int((tmp_path / "child").read_text(encoding="utf-8"))
    wait_until(lambda: ended(child))


@pytest.mark.parametrize(
    ("platform", "apart"),
    [("linux", {"process_group": 0}), ("darwin", {"process_group": 0}), ("win32", {"creationflags": 512})],
)
def test_the_interrupt_key_does_not_reach_a_worker_on(platform, apart, monkeypatch):
    options = {}

    def start(*_, **given):
        options.update(given)
        raise OSError("enough seen")

    with monkeypatch.context() as faked:
        faked.setattr(sys, "platform", platform)
        faked.setattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 512, raising=False)  # Windows alone has it
        faked.setattr(subprocess, "Popen", start)
        run_worker(POINT)
    assert {name: options[name] for name in ("process_group", "creationflags") if name in options} == apart


@pytest.mark.slow
def test_nobody_waits_for_a_worker_so_long_that_an_interrupt_would_have_to(monkeypatch):
    waits = []

    def wait(process, timeout=None):
        waits.append(timeout)
        return true_wait(process, timeout)

    true_wait = subprocess.Popen.wait
    monkeypatch.setattr(subprocess.Popen, "wait", wait)
    outcome = run_worker(replace(POINT, time_limit_s=2.5), worker("time.sleep(60)"))
    assert "time limit of 2.5 s" in str(outcome.error)
    *while_it_ran, after_it_was_killed = waits
    assert len(while_it_ran) >= 3
    assert all(one is not None and one <= 1 for one in while_it_ran)
    assert after_it_was_killed is None


def test_what_a_worker_prints_is_read_whatever_the_system_s_encoding(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "cp1252")
    outcome = run_worker(POINT, worker("print('\\u30b7\\u30fc\\u30f3'); sys.exit(3)"))
    assert str(outcome.error).endswith("it said: \u30b7\u30fc\u30f3")


@pytest.mark.slow
@POSIX_ONLY
@pytest.mark.parametrize("platform", [sys.platform, "win32"])
def test_the_worker_of_a_killed_run_does_not_outlive_it(platform):
    sleeping = (
        "import experiments.harness.processes.worker as w, sys, time; from experiments.registry import KINDS; "
        f"sys.platform = {platform!r}; w.measure_point = lambda _: time.sleep(600); w.run_job(KINDS)"
    )
    run = (
        "import sys; from experiments.harness.processes.launching import run_worker; "
        "from tests.points import POINT; "
        f"run_worker(POINT, [sys.executable, '-c', {sleeping!r}])"
    )
    with subprocess.Popen([sys.executable, "-c", run], cwd=ROOT) as killed:
        wait_until(lambda: bool(psutil.Process(killed.pid).children()))
        (left,) = psutil.Process(killed.pid).children()
        wait_until(lambda: left.num_threads() > 1 or ended(left.pid))
        assert not ended(left.pid)
        killed.kill()
        killed.wait()
    wait_until(lambda: ended(left.pid))


@pytest.mark.slow
@POSIX_ONLY
def test_a_worker_that_may_write_nothing_more_says_so(tmp_path):
    # Past this limit the system refuses to write, as a full disk does, for the result and for words alike.
    limited = (
        "import resource, experiments.harness.processes.worker as w; from experiments.registry import KINDS; "
        "from experiments.harness.point import Measured; "
        "w.measure_point = lambda _: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)) or Measured({'a': 1}); "
        "w.run_job(KINDS)"
    )
    outcome = run_worker(POINT, [sys.executable, "-c", limited])
    assert outcome.status == "failed"
    assert "could not write its result" in str(outcome.error)


def timed(*names):
    return {"warmup_samples": {name: [1.0] for name in names}, "samples": {name: [1.0] * 4 for name in names}}


@pytest.mark.parametrize(("point", "changes"), [
    (POINT, {}),
    (replace(POINT, workload=MEMORY_WORKLOAD), timed() | {"results": MEMORY}),
    (replace(POINT, workload=BUILD), timed("plan", "build", "baseline_build") | {"results": MEMORY | ROUNDS}),
    (replace(POINT, workload=PICTURE), timed() | {"results": MEMORY | COUNTS | {"pictures": {}}}),
    (
        replace(POINT, workload=MULTIFRAME, workload_options=MultiframeOptions()),
        timed(*METHODS, "separate", "visible_first", "rasteriser")
        | {"results": MEMORY | COUNTS | TIMES | ROUNDS | {"pixels_equal": 124, "separate_embree_bytes": 9}},
    ),
])  # fmt: skip
def test_a_good_result_comes_through_unchanged_and_each_workload_has_results_of_its_own(point, changes):
    outcome = replace(GOOD, **changes)
    assert read_result(outcome.to_json(), point) == outcome


@pytest.mark.parametrize("name", sorted({*GOOD.results, *METHODS} - {"rounds"}))
def test_a_measured_point_with_something_missing_is_refused(name):
    results = {key: value for key, value in GOOD.results.items() if key != name}
    samples = {key: value for key, value in GOOD.samples.items() if key != name}
    with pytest.raises(ValueError, match=f"status ok without .*{name}"):
        read_result(replace(GOOD, results=results, samples=samples).to_json(), POINT)


def test_what_was_not_measured_needs_nothing_but_a_reason_and_a_number_that_is_none_is_not_written():
    for outcome in (Record("", "failed", "the reason"), Record("", "skipped", "the reason")):
        assert read_result(outcome.to_json(), POINT) == outcome
    with pytest.raises(ValueError, match="not JSON compliant"):
        replace(GOOD, results={"build_time_s": float("nan")}).to_json()
