"""The command line, run in the process of the test: what `python run.py ...` does, without starting interpreters."""

from __future__ import annotations

import io
import json
import os
import signal
import sys
import tempfile
from contextlib import ExitStack, chdir, contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from functools import partial
from unittest.mock import patch

from hydra.core.global_hydra import GlobalHydra

import experiments.commands.single
import experiments.sweep
from experiments import cli, methods
from experiments.harness.points import measure
from experiments.harness.processes.worker import read_point, read_result, record_of
from experiments.registry import KINDS
from tests.folders import ROOT

NO_SCENES = tempfile.TemporaryDirectory(prefix="atra-tests-")
"""Stands for the folder where the person who runs the tests may keep fetched scenes."""


@dataclass(frozen=True)
class Done:
    """What a command came to: its exit code and what it printed, as `subprocess.CompletedProcess` names them."""

    returncode: int
    stdout: str
    stderr: str


def measure_here(point):
    """Measure a point in this process, through the same JSON as a worker process."""
    return read_result(record_of(read_again(point)).to_json(), point)


def read_again(point):
    """The point as its worker has it: written as a line of JSON, and read."""
    return read_point(json.loads(json.dumps(point.configuration())), KINDS)


def run_here(folder, *arguments, scenes=None, encoding="utf-8"):
    """What `python run.py` with these arguments does in `folder`; points are measured in this process, too.

    scenes: the value of ATRA_SCENES, unset otherwise. encoding: of what it prints."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, write_through=True) for _ in range(2))
    with ExitStack() as stack:
        stack.enter_context(_variables(scenes))
        stack.enter_context(_signals())
        stack.enter_context(_methods())
        stack.enter_context(chdir(folder))
        stack.enter_context(patch.object(sys, "argv", [str(ROOT / "run.py"), *arguments]))
        stack.enter_context(
            patch.object(experiments.sweep, "run_sweep", partial(experiments.sweep.run_sweep, run=measure_here))
        )
        stack.enter_context(patch.object(experiments.commands.single, "measure", partial(measure, run=measure_here)))
        stack.enter_context(redirect_stdout(out))
        stack.enter_context(redirect_stderr(err))
        code = _exit_code()
    return Done(code, *(stream.buffer.getvalue().decode(encoding) for stream in (out, err)))


def _exit_code():
    try:
        return cli.main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    finally:
        GlobalHydra.instance().clear()


@contextmanager
def _variables(scenes):
    changed = {methods.METHOD_FILES: "", "XDG_CACHE_HOME": NO_SCENES.name, "LOCALAPPDATA": NO_SCENES.name}
    with patch.dict(os.environ, changed | ({"ATRA_SCENES": scenes} if scenes is not None else {})):
        if scenes is None:
            os.environ.pop("ATRA_SCENES", None)
        yield


@contextmanager
def _methods():
    """Forgets the methods of files that the command names."""
    before = list(methods.METHODS)
    try:
        yield
    finally:
        methods.METHODS[:] = before


@contextmanager
def _signals():
    """Gives back the handlers that the command line sets."""
    kept = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in kept.items():
            with suppress(TypeError):
                signal.signal(number, handler)
