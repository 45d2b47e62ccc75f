"""`python run.py doctor`: one screen, whatever the machine has or lacks, and an exit code that tells."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import psutil
import pytest

from atra.command import doctor as library_doctor
from atra.command.doctor import render
from atra.compiled.instruction_sets import VARIABLE, instruction_sets_here
from atra.compiled.threads import resolve_threads
from atra.embree.library import OVERRIDE_VARIABLE, embree_version, load_library
from experiments.commands import doctor
from experiments.commands.doctor import diagnose
from experiments.harness import environment
from experiments.harness.configuration import Configuration
from experiments.methods import METHODS
from experiments.methods.peers.embreex_run import EMBREEX
from tests.folders import ROOT, empty_cache


def run(folder, *arguments, **variables):
    command = [sys.executable, str(ROOT / "run.py"), "doctor", *arguments]
    return subprocess.run(command, cwd=folder, env={**os.environ, **variables}, capture_output=True, text=True)


def facts(**fields):
    return dict(diagnose(Configuration(**fields)).facts)


def test_this_machine_is_described_on_one_screen_and_nothing_is_written(tmp_path):
    done = run(tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    *lines, last = done.stdout.splitlines()
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 80
    assert last == "ready to run experiments"
    assert list(tmp_path.iterdir()) == []


def test_the_facts_are_those_of_this_machine(tmp_path, monkeypatch):
    cache = empty_cache(tmp_path, monkeypatch)
    load_library()  # with the variable, as all other tests of this process need it
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(library_doctor, "SHIPPED", tmp_path / "nothing")
    cache.mkdir(parents=True)
    (cache / "sponza.ply").touch()
    told = facts(results_dir=str(tmp_path / "results"))
    library = load_library()
    widths = ", ".join(map(str, library.native_packet_widths))
    assert told["Embree"].startswith(f"{embree_version()}, native packets of {widths}")
    assert told["libembree4"] == str(library.path)
    assert told["instructions"].startswith(", ".join(instruction_sets_here()))
    assert told["instructions"].endswith("all are used (ATRA_ISA is not set)")
    names = "cornell_box, cornell_box_walls, cornell_box_boxes, needles, three_holes, weekend, material_ball"
    assert told["scenes"] == f"built in: {names}, living_room, atrium"
    assert told["fetched"] == f"{cache} holds sponza.ply"
    assert "ATRA_SCENES" not in told
    assert f"embreex {EMBREEX.version()}" in told["peers"]
    assert told["results"] == f"go to {tmp_path / 'results'}"
    assert re.fullmatch(r"\d+\.\d MB kept in .*, compiled for .+", told["kernels"])
    assert sys.version.split()[0] in told["Python"]


def test_without_a_usable_embree_it_says_why_and_fails(tmp_path):
    (tmp_path / "broken").write_text("no library")
    done = run(tmp_path, **{OVERRIDE_VARIABLE: "broken"})
    assert done.returncode == 1, done.stderr
    *lines, last = done.stdout.splitlines()
    assert last.startswith(f"cannot run experiments: {tmp_path / 'broken'} is not a usable libembree4")
    assert "pip install" in last
    assert "Embree        cannot be used, see the last line" in lines
    assert any(line.startswith("CPU") for line in lines)
    assert "Traceback" not in done.stdout + done.stderr


def test_a_missing_instruction_set_and_results_that_cannot_be_written_are_obstacles(tmp_path, monkeypatch):
    (tmp_path / "taken").touch()
    monkeypatch.setattr(library_doctor, "load_library", load_library.__wrapped__)
    monkeypatch.setenv(VARIABLE, "avx1024")
    diagnosis = diagnose(Configuration(results_dir=str(tmp_path / "taken")))
    told, (lacking, taken) = dict(diagnosis.facts), diagnosis.obstacles
    assert "ATRA_ISA is 'avx1024', expected one of what this machine has" in lacking
    assert "held to avx1024 (ATRA_ISA)" in told["instructions"]
    assert told["results"] == f"cannot be written to {tmp_path / 'taken'}"
    assert taken.startswith(f"results cannot be written to {tmp_path / 'taken'}: ")
    last = render(diagnosis, "run experiments").splitlines()[-1]
    assert last.startswith(f"cannot run experiments: {lacking}")
    assert taken in last


def test_without_git_the_commit_is_unknown_and_kernels_that_came_with_the_library_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr(environment, "_PROJECT", tmp_path)
    monkeypatch.setattr(library_doctor, "SHIPPED", tmp_path)
    (tmp_path / "drawing.1.nbc").write_bytes(bytes(2_000_000))
    assert facts()["commit"] == "unknown"  # outside of a repository
    (tmp_path / ".git").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path))
    assert facts()["commit"] == "unknown"
    assert facts()["kernels"].startswith(f"2.0 MB shipped in {tmp_path}")


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_a_system_without_affinity_load_and_proc_is_described(platform, monkeypatch):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.delattr(os, "getloadavg", raising=False)
    monkeypatch.setattr(environment, "_read", lambda _: None)
    monkeypatch.setattr(environment, "_cpu_model", lambda: "CPU\x1b[31m")
    diagnosis = diagnose(Configuration())
    assert not any("busy" in warning for warning in diagnosis.warnings)
    assert "\nCPU " in render(diagnosis, "run experiments")
    assert "\x1b" not in render(diagnosis, "run experiments")  # what a machine says of itself cannot steer the terminal


def test_cores_that_the_system_has_are_told_from_those_of_this_process(monkeypatch):
    monkeypatch.setattr(psutil, "cpu_count", lambda logical=True: 200 if logical else 100)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 5}, raising=False)
    told = facts()
    assert told["CPU"].endswith("; 200 logical cores, 100 physical")
    assert told["cores"] == "2 for this process"


def test_what_may_spoil_times_is_flagged(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "getloadavg", lambda: (3.25, 1.0, 1.0), raising=False)
    monkeypatch.setattr(library_doctor, "cache_folder", lambda: None)
    monkeypatch.setattr(library_doctor, "SHIPPED", tmp_path / "nothing")
    monkeypatch.setenv("ATRA_SCENES", str(tmp_path / "nowhere"))
    configuration = Configuration(results_dir=str(tmp_path))
    configuration.measure.memory_budget_gib = 1e9
    configuration.threads = 1025
    diagnosis = diagnose(configuration)
    scenes, threads, load, memory, kernels = diagnosis.warnings
    assert "ATRA_SCENES is" in scenes
    assert threads == f"more threads are asked for than there are cores (1025 on {resolve_threads(None)})"
    assert load == "the machine is busy (load 3.2)"
    assert "memory_budget_gib=1e+09" in memory
    assert "NUMBA_CACHE_DIR" in kernels
    assert dict(diagnosis.facts)["kernels"].startswith("not kept, compiled for ")
    assert diagnosis.obstacles == ()


def test_a_folder_of_many_scenes_and_reasons_of_any_length_still_fit_the_screen(tmp_path, monkeypatch):
    for number in range(500):
        (tmp_path / f"scene{number}.ply").touch()
    monkeypatch.setenv("ATRA_SCENES", str(tmp_path))
    wordy = [replace(one, problem=lambda: f"it says {'much ' * 500}; do this") for one in METHODS]
    monkeypatch.setattr(doctor, "METHODS", wordy)
    lines = render(diagnose(Configuration()), "run experiments").splitlines()
    assert len(lines) <= 36
    assert max(map(len, lines)) <= 80
    assert not any("do this" in line for line in lines)
