"""Entry of the console command: `atra doctor`, `atra render` and others, and, if it is installed, the harness.

Exit codes: 0 done, 1 something failed, 2 the input cannot be used, 130 interrupted.
"""

from __future__ import annotations

import sys
import warnings
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import NoReturn

import atra
from atra.command import escape_what_stdout_lacks
from atra.errors import AtraError, printable

_VERBS = {
    "doctor": ("doctor", "say what this machine has and lacks; a bug report needs it"),
    "compile": ("compiling", "compile kernels now, such as for a container image"),
    "render": ("render", "write what every view of a mesh sees, or a picture of it in full light"),
    "view": ("viewing", "walk through a mesh with its materials and lights in the browser"),
    "bake": ("baking", "make a lightmap of a mesh with its materials and lights"),
    "judge": ("judging", "judge an image of a mesh that any program has made, pixel by pixel"),
}
"""Verbs: the module of this package that is loaded for one, and its help. The module has `run_VERB`, and `add_VERB`
where the verb has arguments."""

_CLONE = Path(__file__).resolve().parents[2]
_OF_THE_HARNESS = (
    "measure", "report", "fetch", "new-method", "pack", "board", "rays", "-m", "--multirun",
)  # fmt: skip
_NEEDS_THE_HARNESS = "needs the harness; in a clone of atra's repository, run: pip install -e '.[harness]'"
_WITH_THE_HARNESS = """\
with the harness, in a clone of atra's repository where `pip install -e '.[harness]'` was run:
  atra measure method=pixel      measure one point and print it
  atra sweep=horizontal          measure a sweep; table and figures are in results/horizontal
  atra report sweep=horizontal   write its figures, claims and page again, without measuring
  atra fetch scene=sponza        download a scene
  atra new-method mine           write mine.py, a method to change; measured with method_file=mine.py
  atra pack, board, rays         share results, and rays for other programs; docs/sweeps.md
  python run.py --help           every field
"""


def main() -> int:
    """Run the command line and return its exit code."""
    escape_what_stdout_lacks()
    verb = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if _is_of_the_harness(verb):
        if not _harness_is_here():
            print(f"atra: {verb} {_NEEDS_THE_HARNESS}", file=sys.stderr)
            return 2
        from experiments.cli import main as run_harness

        return run_harness()
    if verb not in _VERBS:
        _parser().parse_args(sys.argv[1:] or [verb])  # prints the help, the version, or what is wrong, and exits
    words = 3 if sys.argv[1:3] == ["render", "bop"] else 2
    command = sys.argv[words - 1]
    parser = _Parser(" ".join(["atra", *sys.argv[1:words]]))
    module = import_module(f"atra.command.{'bop' if command == 'bop' else _VERBS[verb][0]}")
    getattr(module, f"add_{command}", lambda parser: None)(parser)
    given = parser.parse_args(sys.argv[words:])
    try:
        with _warnings_in_a_line():
            return int(getattr(module, f"run_{command}")(given))
    except AtraError as error:
        print(f"atra: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("atra: interrupted", file=sys.stderr)
        return 130


@contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Warnings for the user are one line each, without the place in the code."""
    usual = warnings.formatwarning

    def in_a_line(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
    ) -> str:
        is_ours = issubclass(category, UserWarning)
        return f"atra: {printable(str(message))}\n" if is_ours else usual(message, category, filename, lineno, line)

    warnings.formatwarning = in_a_line
    try:
        yield
    finally:
        warnings.formatwarning = usual


def _is_of_the_harness(verb: str) -> bool:
    """Whether the harness runs this verb."""
    return "=" in verb or verb in _OF_THE_HARNESS or (verb == "doctor" and _harness_is_here())


def _harness_is_here() -> bool:
    """Whether the harness is there: it lies beside the library in a clone and has packages of its own."""
    return (_CLONE / "experiments" / "cli.py").is_file() and find_spec("hydra") is not None


class _Parser(ArgumentParser):
    """Says what is wrong in one line, without the whole usage."""

    def error(self, message: str) -> NoReturn:
        if message.endswith("required: mesh"):
            message = f"no mesh is given, expected its file first, as in: {self.prog} model.glb"
        elif message.startswith("unrecognized arguments") and "=" in message:
            message += "; options begin with --, as in: --size 640 480"
        self.exit(2, f"atra: {message}\nmore by: {self.prog} --help\n")


def _parser() -> ArgumentParser:
    parser = _Parser(
        "atra",
        description="What every pixel of a view sees: exact primary visibility.",
        epilog=_WITH_THE_HARNESS,
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"atra {atra.__version__}")
    verbs = parser.add_subparsers(metavar="verb", required=True)
    for verb, (_, what) in _VERBS.items():
        verbs.add_parser(verb, help=what)
    return parser
