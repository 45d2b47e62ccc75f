"""Everything that can be measured, as the command line, the worker and Hydra hand it to the harness."""

from __future__ import annotations

import os
from collections.abc import Sequence

from atra.errors import InputError
from experiments.harness.point import Find, Kinds
from experiments.methods import find_method, use_method_file
from experiments.workloads import find_workload

FIND = Find(find_method, find_workload)
"""How a worker finds the method and the workload of its point, without importing the others."""


def known_kinds() -> Kinds:
    """All methods and workloads of this project."""
    from experiments.methods import METHODS
    from experiments.workloads import WORKLOADS

    return Kinds(METHODS, WORKLOADS)


def take_method_files(arguments: Sequence[str]) -> list[str]:
    """Make the methods of every `method_file=...` known, and return the arguments with whole paths.

    Without a sweep, and without a method of its own, the run takes the first of these methods; a sweep measures them
    beside its own (`experiments.sweeper`). Raises InputError for a file that holds no usable method.
    """
    given = [one.partition("=")[2] for one in arguments if one.startswith("method_file=")]
    if not given:
        return list(arguments)
    from experiments.results.table import columns

    methods = [use_method_file(path) for path in given[-1].split(os.pathsep)]
    try:
        columns()
    except ValueError as error:
        raise InputError(f"method_file {given[-1]}: {error}; call its option something else") from None
    kept = [one for one in arguments if not one.startswith("method_file=")]
    place = next(place for place, one in enumerate(arguments) if one.startswith("method_file="))
    whole = os.pathsep.join(os.path.abspath(os.path.expanduser(path)) for path in given[-1].split(os.pathsep))
    chosen = any(one.startswith(("method=", "sweep=")) for one in kept)
    told = [f"method_file='{whole}'", *([] if chosen else [f"method={methods[0].name}"])]
    # Where it stood: after a flag such as --help, Hydra takes no more fields.
    return [*kept[:place], *told, *kept[place:]]
