"""Constants of this machine: those that a calibration kept, or those measured where the model was made."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

from atra.compiled.instruction_sets import chosen_instruction_set, cpu_design, instruction_sets_here
from atra.files.paths import write_atomically
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.formulas import Constants
from scenes.directory import expand_home

FORMAT = 2
"""Version of the file."""


@dataclass(frozen=True)
class Machine:
    """Constants, and whether they were measured on this machine with this instruction set."""

    constants: Constants
    is_calibrated: bool


def instruction_set() -> str:
    """The set that kernels are compiled for; the widest that the model knows where the machine has another."""
    here = chosen_instruction_set() or (instruction_sets_here() or ("",))[-1]
    return here if here in DEFAULTS else "avx2"


def constants_path() -> Path:
    """Where the constants of this machine and instruction set are kept."""
    return (
        expand_home(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
        / "atra"
        / "model"
        / f"{cpu_design() or 'unknown'}-{instruction_set()}.json"
    )


def machine() -> Machine:
    """The constants of this machine; the defaults where none were kept, or what was kept cannot be read."""
    defaults = DEFAULTS[instruction_set()]
    try:
        kept = json.loads(constants_path().read_text(encoding="utf-8"))
        if kept["format"] == FORMAT and {name: len(one) for name, one in kept["constants"].items()} == {
            name: len(one) for name, one in defaults.items()
        }:
            constants = {name: [float(value) for value in one] for name, one in kept["constants"].items()}
            return Machine(constants, True)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
        pass
    return Machine(defaults, False)


def keep(constants: Constants) -> Path:
    """Keep constants for this machine; returns the file. Raises StorageError."""
    path = constants_path()
    write_atomically(path, (json.dumps({"format": FORMAT, "constants": constants}, indent=1) + "\n").encode())
    return path
