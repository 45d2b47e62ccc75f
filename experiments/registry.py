"""Everything that can be measured, as the command line, the worker and Hydra hand it to the harness."""

from __future__ import annotations

from experiments.harness.point import Kinds
from experiments.methods import METHODS
from experiments.workloads import WORKLOADS


def known_kinds() -> Kinds:
    """All methods and workloads of this project."""
    return Kinds(METHODS, WORKLOADS)
