"""Command line of the harness, `python run.py [VERB] key=value ...`; `--help` lists the verbs (conf/config.yaml).

Without a verb it measures. With `atra` in place of `python run.py`, measuring needs a verb, too: `atra measure`.

Exit codes: 0 done, 1 something failed, 2 the input cannot be used, 130 interrupted.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiments.commands.program import PROGRAM

# What takes time to import is imported in functions: Ctrl-C may come before that is done.
if TYPE_CHECKING:
    from omegaconf import DictConfig

_CONFIGURATION = str(Path(__file__).resolve().parents[1] / "conf")
_ACTIONS = {
    "measure": "experiments.commands.single:run_single_point",
    "fetch": "experiments.commands.fetching:run_fetch",
    "report": "experiments.report.writing:run_report",
    "doctor": "experiments.commands.doctor:run_doctor",
}
"""Verb -> the function that does it, imported only when asked for."""

_PLAIN = {
    "new-method": "experiments.commands.new_method:run_new_method",
    "pack": "experiments.board.pack:run_pack",
    "board": "experiments.board.command:run_board",
    "rays": "experiments.classification.ray_files:run_rays",
}
"""Verbs with arguments of their own in place of fields of a configuration -> what takes these. `--help` shows USAGE
and the docstring of its module."""


def main() -> int:
    """Run the command line and return its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    if sys.argv[1:2] == ["measure"]:
        del sys.argv[1]  # what a run does that says no other
    elif len(sys.argv) > 1 and sys.argv[1] in _ACTIONS:
        # hydra.mode: a sweep's file asks for many runs, but there is one thing to do.
        sys.argv[1:2] = [f"action={sys.argv[1]}", "hydra.mode=RUN"]
    from atra.command import escape_what_stdout_lacks

    escape_what_stdout_lacks()
    if sys.argv[1:2] and sys.argv[1] in _PLAIN:
        where = _PLAIN[sys.argv[1]]
        if {"-h", "--help"} & set(sys.argv[2:]):
            module = import_module(where.partition(":")[0])
            print(f"usage: {module.USAGE}\n\n{module.__doc__}".rstrip())
            return 0
        return _exit_code(lambda: _function(where)(sys.argv[2:]))
    # Hydra then raises its errors instead of printing them at length; they are shown below, shortened.
    os.environ["HYDRA_FULL_ERROR"] = "1"

    try:
        import hydra
    except ModuleNotFoundError:
        print(f"{PROGRAM}: the harness's packages are not installed; run: pip install -e '.[harness]'", file=sys.stderr)
        return 2
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from atra.errors import AtraError
    from experiments.harness.configuration import register_schema
    from experiments.registry import known_kinds, take_method_files
    from experiments.sweeper import register_sweeper

    try:
        sys.argv[1:] = take_method_files(sys.argv[1:])
    except AtraError as error:
        return _refuse(error)
    register_schema(known_kinds())
    register_sweeper()
    signal.signal(signal.SIGTERM, signal.default_int_handler)

    def run() -> None:
        if signal.getsignal(signal.SIGINT) is _leave:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        hydra.main(config_path=_CONFIGURATION, config_name="config", version_base="1.3")(_run)()

    return _exit_code(run, HydraException, OmegaConfBaseException)


def _exit_code(run: Callable[[], object], *refused: type[Exception]) -> int:
    """Run something, and say in a line why it was refused or that it was interrupted. refused: what is raised beside
    errors of atra where the input cannot be used."""
    from atra.errors import AtraError

    known: tuple[type[Exception], ...] = (AtraError, *refused)
    try:
        run()
    except known as error:
        return _refuse(error)
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted", file=sys.stderr)
        return 130
    return 0


def _leave(*_: object) -> None:
    """Nothing has begun, and KeyboardInterrupt inside an import may be taken for a missing package."""
    os.write(sys.stderr.fileno(), f"{PROGRAM}: interrupted\n".encode())
    os._exit(130)


def _run(composed: DictConfig) -> None:
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf.errors import OmegaConfBaseException

    from atra.errors import AtraError
    from experiments.harness.configuration import read_configuration
    from experiments.registry import known_kinds

    if HydraConfig.get().mode is RunMode.MULTIRUN:  # a job that a launcher runs for a sweep, which reports its errors
        from experiments.launched import measure_launched

        measure_launched(read_configuration(composed, known_kinds()))
        return
    # SystemExit passes through Hydra silently; any other exception is announced by Hydra first.
    try:
        configuration = read_configuration(composed, known_kinds())
        _function(_ACTIONS[configuration.action.value])(configuration)
    except (AtraError, OmegaConfBaseException) as error:
        raise SystemExit(_refuse(error)) from error


def _function(where: str) -> Any:
    """What a text such as "package.module:function" names, imported now."""
    module, _, function = where.partition(":")
    return getattr(import_module(module), function)


def _refuse(error: Exception) -> int:
    from atra.errors import AtraError, printable
    from experiments.commands.messages import shorten_configuration_error
    from experiments.registry import known_kinds

    if "debug=true" in (argument.lower() for argument in sys.argv):
        traceback.print_exception(error)
    message = str(error) if isinstance(error, AtraError) else shorten_configuration_error(error, known_kinds())
    print(f"{PROGRAM}: {printable(message)}", file=sys.stderr)
    return 2
