"""What of Hydra a command line may ask for: nothing that names Python to import or files to read configuration from."""

from __future__ import annotations

import re
from collections.abc import Iterable

from atra.errors import InputError

_FLAGS = frozenset(
    ("--help", "-h", "--hydra-help", "--version", "--cfg", "-c", "--resolve", "--package", "-p", "--info", "-i",
     "--multirun", "-m", "--shell-completion", "-sc")
)  # fmt: skip
_HYDRA_FIELDS = re.compile(
    r"hydra/launcher|hydra\.launcher(\.\w+)+|hydra\.sweeper\.max_batch_size|hydra\.sweeper\.params\.[\w.]+"
    r"|hydra\.(run|sweep)\.dir|hydra\.sweep\.subdir|hydra\.mode|hydra\.verbose"
)
_NAMES_A_TARGET = re.compile(r"_(target|partial|args|convert|recursive)_")


def check_command_line(arguments: Iterable[str]) -> None:
    """Raise InputError naming the first argument by which configuration could come from elsewhere or run code.

    Hydra imports and calls whatever `_target_` names, in its own settings, in files of a folder given to it and in jobs
    it is told to run again. Only `conf/` and the launchers that are installed may do that (docs/trust.md).
    """
    for argument in arguments:
        key, _, value = argument.partition("=")
        if argument.startswith("-"):
            if key not in _FLAGS:
                raise InputError(f"{key} is not offered, expected one of {', '.join(sorted(_FLAGS))}, or field=value")
            continue
        field = key.lstrip("+~").partition("@")[0].strip()
        if field.partition(".")[0].partition("/")[0] == "hydra" and not _HYDRA_FIELDS.fullmatch(field):
            raise InputError(
                f"{field} cannot be set from the command line; of Hydra's own settings these can: hydra/launcher, "
                "hydra.launcher.*, hydra.sweeper.max_batch_size, hydra.run.dir, hydra.sweep.dir, hydra.mode, "
                "hydra.verbose"
            )
        if _NAMES_A_TARGET.search(argument) or (field.startswith("sweep") and "hydra" in value):
            raise InputError(f"{argument[:200]!r} names what Hydra is to import, which only conf/ may do")
