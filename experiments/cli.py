"""Command line of the harness: `python run.py key=value ...` is a Hydra program that measures a point or a sweep,
`python run.py VERB ...` does something else; `--help` lists the verbs (conf/config.yaml).

Exit codes: 0 done, 1 something failed, 2 the input cannot be used, 130 interrupted.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import traceback
from argparse import ArgumentParser
from collections.abc import Sequence
from importlib import import_module
from pkgutil import resolve_name
from types import FrameType
from typing import TYPE_CHECKING, Any

from experiments.commands.program import COMMAND, PROGRAM

# What takes time to import is imported in functions: Ctrl-C may come before that is done.
if TYPE_CHECKING:
    from omegaconf import DictConfig

CONFIGURED = {
    "measure": "experiments.commands.single:run_single_point",
    "fetch": "experiments.commands.fetching:run_fetch",
    "report": "experiments.report.writing:run_report",
    "doctor": "experiments.commands.doctor:run_doctor",
}
"""Verbs that take a configuration -> what takes it, imported only when asked for."""

PLAIN = {
    "new-method": "experiments.commands.new_method:run_new_method",
    "pack": "experiments.board.pack:run_pack",
    "board": "experiments.board.command:run_board",
    "tables": "experiments.documents.writing:run_tables",
}
"""Verbs with words of their own in place of fields of a configuration -> what takes these. Wings and packages offer
further ones by entry points."""

_FLAGS_WITH_VALUES = (
    "--config-path -cp",
    "--config-name -cn",
    "--config-dir -cd",
    "--package -p",
    "--cfg -c",
    "--experimental-rerun",
)
"""Flags of Hydra that take a value; that value is no verb."""

_NOISE = ("full_key:", "object_type=", "reference_type=", "To append to your config", "Config search path", "provider=")
"""Beginnings of lines of Hydra's errors that say nothing to people."""


def main() -> int:
    """Run the command line and return its exit code."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    from atra.command import escape_what_stdout_lacks
    from atra.errors import AtraError

    escape_what_stdout_lacks()
    flags, words = _split(sys.argv[1:])
    try:
        if words and "=" not in words[0] and words[0] in verbs():
            _run_verb(words[0], words[1:], flags)
        else:
            _run_hydra(words)
    except AtraError as error:
        return refuse(error)
    except KeyboardInterrupt:
        print(f"{PROGRAM}: interrupted", file=sys.stderr)
        return 130
    except Exception as error:
        raised_in = [str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__)]
        if raised_in[-1].partition(".")[0] in ("hydra", "omegaconf", "yaml"):  # complaints about what was given
            return refuse(error)
        raise
    return 0


def verbs() -> dict[str, str]:
    """All verbs -> the functions that do them, as entry points say it."""
    from experiments.harness.entry_points import VERBS_GROUP, offered

    return CONFIGURED | PLAIN | {name: entry.value for name, entry in offered(VERBS_GROUP).items()}


def _split(arguments: Sequence[str]) -> tuple[dict[str, Any], list[str]]:
    """Hydra's flags with their values, those that it does not know under "unknown", and the words between them."""
    parser = ArgumentParser(add_help=False, allow_abbrev=False)
    for names in _FLAGS_WITH_VALUES:
        parser.add_argument(*names.split(), default=None)
    parser.add_argument("--info", "-i", nargs="?", const="all")
    parser.add_argument("--help", "-h", action="store_true")
    parser.add_argument("words", nargs="*")
    try:
        known, unknown = parser.parse_known_intermixed_args(list(arguments))
    except SystemExit:  # Hydra says what is wrong with its flags
        return {}, []
    return vars(known) | {"unknown": unknown}, [*known.words]


def _run_verb(verb: str, words: Sequence[str], flags: dict[str, Any]) -> None:
    from atra.errors import InputError

    where = verbs()[verb]
    if flags["help"]:
        module = import_module(where.partition(":")[0])
        usage = getattr(module, "USAGE", f"{COMMAND} {verb} key=value ...    # fields: {COMMAND} --help")
        print(f"usage: {usage}\n\n{module.__doc__}".rstrip())
        return
    function = resolve_name(where)
    _let_interrupts_pass()
    if verb not in CONFIGURED:
        function([*words, *flags["unknown"]])
        return
    from experiments.configure import configure

    if flags["unknown"] or flags["cfg"] or flags["info"]:
        given = " ".join(flags["unknown"]) or "--cfg or --info"
        raise InputError(f"{verb} takes no {given}; expected fields, as in {COMMAND} {verb} scene=cornell_box")
    _check_words(words)
    _use_method_files(words)
    configuration = configure(words, flags["config_name"] or "config", flags["config_dir"])
    if verb == "measure" and configuration.sweep.grids:
        raise InputError(f"measure takes one point, expected for a sweep: {COMMAND} {' '.join(words)}")
    function(configuration)


def _check_words(words: Sequence[str]) -> None:
    """Raise InputError for what Hydra would take for a broken override, and for several sweeps at once."""
    from atra.errors import InputError
    from experiments.harness.options import say_unknown_choice

    for word in words:
        name, equals, value = word.partition("=")
        if not equals and word in verbs():
            raise InputError(f"{word} stands behind {words[0]}, expected the verb first: {COMMAND} {word} ...")
        if not equals and not word.startswith("~"):
            told = say_unknown_choice("verb", word, sorted(verbs()))
            raise InputError(f"{told} ({COMMAND} --help tells of verbs and of fields, which are set by key=value)")
        if name == "sweep" and set(value) & set(",()"):
            raise InputError(f"{word} names several sweeps, expected one; run one after another: {COMMAND} sweep=NAME")


def _run_hydra(words: Sequence[str]) -> None:
    # Hydra then raises its errors instead of printing them at length; they are shown below, shortened.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        import hydra
    except ModuleNotFoundError:
        from atra.errors import InputError

        raise InputError("the harness's packages are not installed; run: pip install -e '.[harness]'") from None
    from experiments.harness.configuration import CONFIGURATION

    _check_words(words)
    _use_method_files(sys.argv[1:])
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    _let_interrupts_pass()
    hydra.main(config_path=str(CONFIGURATION), config_name="config", version_base="1.3")(run_configured)()


def run_configured(composed: DictConfig) -> None:
    """What Hydra runs: measures one point, alone or as a job that a launcher runs for a sweep."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf.errors import OmegaConfBaseException

    from atra.errors import AtraError
    from experiments.commands.single import run_single_point
    from experiments.harness.configuration import read_configuration
    from experiments.launched import measure_launched
    from experiments.registry import KINDS

    is_job = HydraConfig.get().mode is RunMode.MULTIRUN
    try:
        configuration = read_configuration(composed, KINDS)
        if is_job:
            measure_launched(configuration)
        else:
            run_single_point(configuration)
    except (AtraError, OmegaConfBaseException) as error:
        if is_job:  # the sweep reports it
            raise
        raise SystemExit(refuse(error)) from error  # which passes through Hydra, that announces other exceptions


def _use_method_files(arguments: Sequence[str]) -> None:
    """Make the methods of `method_file=...` known, here and to the processes that this one starts.

    Without a sweep, and without a method of its own, the run takes the first of them (conf/config.yaml); a sweep
    measures them beside its own methods. Raises InputError for a file that holds no usable method.
    """
    os.environ.pop("ATRA_METHOD", None)
    given = [argument.partition("=")[2].strip("'\"") for argument in arguments if argument.startswith("method_file=")]
    if not given:
        return
    from atra.errors import InputError
    from experiments.methods import use_method_file
    from experiments.results.table import columns

    methods = [use_method_file(path) for path in given[-1].split(os.pathsep)]
    try:
        columns()
    except ValueError as error:
        raise InputError(f"method_file {given[-1]}: {error}; call its option something else") from None
    if not any(argument.startswith("sweep=") for argument in arguments):
        os.environ["ATRA_METHOD"] = methods[0].name


def _leave(number: int, frame: FrameType | None) -> None:
    """Nothing has begun, and KeyboardInterrupt inside an import may be taken for a missing package."""
    os.write(sys.stderr.fileno(), f"{PROGRAM}: interrupted\n".encode())
    os._exit(130)


def _let_interrupts_pass() -> None:
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _shortened(error: Exception) -> str:
    """An error of Hydra in one line: what is wrong and the choices that exist."""
    from hydra.errors import MissingConfigException
    from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

    from experiments.harness.configuration import options_at, say_unknown
    from experiments.harness.options import say_unknown_choice
    from experiments.registry import KINDS

    cause = error.__cause__
    told = error if isinstance(error, OmegaConfBaseException) else cause
    if isinstance(told, ConfigAttributeError | ConfigKeyError) and told.full_key and told.parent_node is not None:
        path = str(told.full_key)
        return say_unknown(options_at(path, told.parent_node, KINDS), path, KINDS)
    if isinstance(error, MissingConfigException) and error.options and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        return say_unknown_choice(group, name, error.options)
    lines = str(error).splitlines() + ([] if cause is None or str(cause) in str(error) else str(cause).splitlines())
    kept = [line.strip().rstrip(".") for line in lines if line.strip() and not line.strip().startswith(_NOISE)]
    if kept and kept[0].startswith("Ambiguous value"):
        vector = re.search(r"'(scene\.(?:eye|target|up))=", kept[0])  # the one place where Hydra's words are read
        if vector:
            brackets = "is a list, which brackets hold together, and quotes the brackets"
            return f"{vector[1]} {brackets}: '{vector[1]}=[0,1,3]'"
        return f"{kept[0]}: several values make a sweep; add sweep=horizontal or -m"
    return "; ".join(dict.fromkeys(kept)) or type(error).__name__


def refuse(error: Exception) -> int:
    """Say on stderr, in one line, why something is refused. Returns the exit code."""
    from atra.errors import AtraError, printable

    if "debug=true" in (argument.lower() for argument in sys.argv):
        traceback.print_exception(error)
    message = str(error) if isinstance(error, AtraError) else _shortened(error)
    print(f"{PROGRAM}: {printable(message)}", file=sys.stderr)
    return 2
