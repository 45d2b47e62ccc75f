"""The program as it was called: messages begin with its name."""

from __future__ import annotations

import sys
from collections.abc import Collection, Sequence
from pathlib import Path

PROGRAM, COMMAND = ("atra", "atra") if Path(sys.argv[0]).stem == "atra" else ("run.py", "python run.py")


def split_options(arguments: Sequence[str], known: Collection[str]) -> tuple[dict[str, str], list[str]]:
    """The arguments that set one of the known options, such as output=board.html, and all others, in order. Of two
    that set the same option the later holds."""
    pairs = [argument.partition("=") for argument in arguments]
    options = {name: value for name, equals, value in pairs if equals and name in known}
    return options, ["".join(pair) for pair in pairs if not (pair[1] and pair[0] in known)]
