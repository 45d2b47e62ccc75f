"""Errors of Hydra, shortened to one line."""

from __future__ import annotations

import re
from dataclasses import is_dataclass

from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException, ValidationError

from experiments.harness.configuration import say_unknown
from experiments.harness.point import Kinds

_NOISE = ("full_key:", "object_type=", "reference_type=", "To append to your config", "Config search path", "provider=")


def shorten_configuration_error(error: BaseException, kinds: Kinds) -> str:
    """One line: what is wrong and the choices that exist. kinds: what a configuration chooses from."""
    lines, cause = [line.strip() for line in str(error).splitlines()], error.__cause__
    told = error if isinstance(error, OmegaConfBaseException) else cause
    if isinstance(told, ConfigAttributeError | ConfigKeyError) and is_dataclass(told.object_type):
        return say_unknown(told.object_type, str(told.full_key), kinds)
    if isinstance(told, ValidationError) and told.full_key:
        if "is not a ListConfig" in str(told):
            return _say_brackets(str(told.full_key))
        return f"{told.full_key}: {str(told).splitlines()[0].rstrip('.')}"
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
        vector = re.search(r"'(scene\.(?:eye|target|up))=", kept[0])
        if vector:
            return _say_brackets(vector[1])
        return f"{kept[0]}: several values make a sweep; add sweep=horizontal or -m"
    unknown = re.search(r"Could not (?:find|load) '(\w+)/([^']*)'", " ".join(kept))
    if unknown and choices:
        return f"unknown {unknown[1]} {unknown[2]!r}, expected one of {', '.join(choices)}"
    return "; ".join(dict.fromkeys(kept)) or type(error).__name__


def _say_brackets(field: str) -> str:
    """Without them its numbers are values of a sweep."""
    return f"{field} is a list, which brackets hold together, and quotes the brackets: '{field}=[0,1,3]'"
