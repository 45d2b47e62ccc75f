"""Errors of Hydra, shortened to one line."""

from __future__ import annotations

import re

from hydra.errors import MissingConfigException
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from experiments.harness.configuration import options_at, say_unknown
from experiments.harness.options import say_unknown_choice
from experiments.harness.point import Kinds

_NOISE = ("full_key:", "object_type=", "reference_type=", "To append to your config", "Config search path", "provider=")


def shorten_configuration_error(error: BaseException, kinds: Kinds) -> str:
    """One line: what is wrong and the choices that exist. kinds: what a configuration chooses from."""
    cause = error.__cause__
    told = error if isinstance(error, OmegaConfBaseException) else cause
    if isinstance(told, ConfigAttributeError | ConfigKeyError) and told.full_key and told.parent_node is not None:
        path = str(told.full_key)
        return say_unknown(options_at(path, told.parent_node, kinds), path, kinds)
    if isinstance(error, MissingConfigException) and error.options and error.missing_cfg_file:
        group, _, name = error.missing_cfg_file.rpartition("/")
        return say_unknown_choice(group, name, error.options)
    lines = str(error).splitlines() + ([] if cause is None or str(cause) in str(error) else str(cause).splitlines())
    kept = [line.strip().rstrip(".") for line in lines if line.strip() and not line.strip().startswith(_NOISE)]
    if kept and kept[0].startswith("Ambiguous value"):
        vector = re.search(r"'(scene\.(?:eye|target|up))=", kept[0])  # the one place where Hydra's words are read
        if vector:
            return _say_brackets(vector[1])
        return f"{kept[0]}: several values make a sweep; add sweep=horizontal or -m"
    return "; ".join(dict.fromkeys(kept)) or type(error).__name__


def _say_brackets(field: str) -> str:
    """Without them its numbers are values of a sweep."""
    return f"{field} is a list, which brackets hold together, and quotes the brackets: '{field}=[0,1,3]'"
