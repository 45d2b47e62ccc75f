"""`python run.py doctor`: what this machine has and what it lacks, on one screen, as a bug report needs it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from atra.command.doctor import Diagnosis, render
from atra.command.doctor import diagnose as examine_library
from atra.compiled.threads import resolve_threads
from atra.errors import InputError
from experiments.harness.configuration import Configuration
from experiments.harness.environment import BUSY_LOAD, read_environment
from experiments.harness.records import check_writable
from experiments.methods import METHODS
from scenes.built_in import BUILT_IN
from scenes.directory import SCENES_VARIABLE, meshes_of, scene_folders

_LONGEST_LIST = 120
"""A folder may hold any number of meshes, and a package give any reason."""


def run_doctor(configuration: Configuration) -> None:
    """Print the diagnosis; raises SystemExit(1) when nothing can be measured here, the reason being the last line."""
    diagnosis = diagnose(configuration)
    print(render(diagnosis, "run experiments"))
    if diagnosis.obstacles:
        raise SystemExit(1)


def diagnose(configuration: Configuration) -> Diagnosis:
    """Look at all that a run relies on. Nothing is measured or written, and what is missing is no error."""
    library = examine_library()
    results, results_obstacles = _results(configuration)
    scenes, scene_warnings = _scenes()
    environment = read_environment()
    commit = (environment["git_commit"] or "unknown")[:12]
    total_gib, free_gib = (environment[f"memory_{which}_bytes"] / 2**30 for which in ("total", "available"))
    cores = f"{environment['logical_cores']} logical cores, {environment['physical_cores']} physical"
    facts = [
        *library.facts,
        ("commit", f"{commit}{' with changes' if environment['git_dirty'] else ''}"),
        ("CPU", f"{environment['cpu']}; {cores}"),
        ("memory", f"{total_gib:.1f} GiB, {free_gib:.1f} GiB free"),
        *scenes,
        ("peers", "; ".join(_peers())),
        ("results", results),
    ]
    warnings = [*scene_warnings, *_warnings(environment, configuration), *library.warnings]
    return Diagnosis(tuple(facts), tuple(warnings), (*library.obstacles, *results_obstacles))


def _scenes() -> tuple[list[tuple[str, str]], list[str]]:
    """The scenes that are here, and what is wrong with their folders."""
    facts = [("scenes", f"built in: {', '.join(BUILT_IN)}")]
    try:
        *named, cache = scene_folders()
    except InputError as error:
        return facts, [str(error)]
    facts += [(SCENES_VARIABLE, f"{folder} holds {_cut(meshes_of(folder))}") for folder in named]
    return [*facts, ("fetched", f"{cache} holds {_cut(meshes_of(cache))}")], []


def _peers() -> Iterator[str]:
    for peer in METHODS:
        if not peer.is_ours:
            problem = peer.problem()
            reason = _cut(str(problem).partition(";")[0])  # what to do about it comes behind
            yield f"{peer.name} {peer.version()}" if problem is None else f"no {peer.name}: {reason}"


def _results(configuration: Configuration) -> tuple[str, list[str]]:
    """Where results go, and why they cannot. A folder that is not there yet is not made."""
    folder = Path(configuration.results_dir).absolute()
    try:
        check_writable(next(place for place in (folder, *folder.parents) if os.path.exists(place)))
    except InputError as error:
        return f"cannot be written to {folder}", [str(error)]
    return f"go to {folder}", []


def _warnings(environment: Mapping[str, Any], configuration: Configuration) -> Iterator[str]:
    load, budget_gib = environment["load_average"], configuration.measure.memory_budget_gib
    cores, threads = resolve_threads(None), configuration.threads
    if threads is not None and threads > cores:
        yield f"more threads are asked for than there are cores ({threads} on {cores})"
    if load and load[0] > BUSY_LOAD:
        yield f"the machine is busy (load {load[0]:.1f})"
    if budget_gib is not None and environment["memory_available_bytes"] < budget_gib * 2**30:
        yield f"less memory is free than a point may take (measure.memory_budget_gib={budget_gib:g})"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_LIST else f"{text[:_LONGEST_LIST]} ..."
