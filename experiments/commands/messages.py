"""Messages of Hydra, shortened to one line."""

from __future__ import annotations

import re

_NOISE = ("full_key:", "object_type=", "reference_type=", "To append to your config", "Config search path", "provider=")


def shorten_configuration_error(error: BaseException) -> str:
    """One line: what is wrong and, if Hydra lists them, the choices that exist."""
    lines = [line.strip() for line in str(error).splitlines()]
    cause = error.__cause__
    if cause is not None and str(cause) not in str(error):
        lines += [line.strip() for line in str(cause).splitlines()]
    kept: list[str] = []
    choices: list[str] = []
    listing = False
    for line in lines:
        if line.startswith("Available options in"):
            listing = True
        elif listing and re.fullmatch(r"[\w.-]+", line):
            choices.append(line)
        elif line and not line.startswith(_NOISE):
            listing = False
            kept.append(line.rstrip("."))
    if kept and kept[0].startswith("Ambiguous value"):
        return f"{kept[0]}: several values make a sweep; add sweep=horizontal or -m"
    unknown = re.search(r"Could not (?:find|load) '(\w+)/([^']*)'", " ".join(kept))
    if unknown and choices:
        return f"unknown {unknown[1]} {unknown[2]!r}, expected one of {', '.join(choices)}"
    return "; ".join(dict.fromkeys(kept)) or type(error).__name__
