"""`python run.py doctor`: what this machine has and what it lacks, on one screen, as a bug report needs it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from atra.command.doctor import (
    Diagnosis,
    embree_facts,
    kernel_warnings,
    load_embree,
    render,
    say_instructions,
    say_kernels,
)
from atra.compiled.threads import resolve_threads
from atra.embree.library import embree_version
from atra.errors import InputError
from experiments.harness.configuration import Configuration
from experiments.harness.environment import BUSY_LOAD, Environment, read_environment
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
    library, embree_obstacles = load_embree()
    results, results_obstacles = _results(configuration)
    scenes, scene_warnings = _scenes()
    environment = read_environment(None if library is None else embree_version())
    facts = [
        *_machine(environment),
        *embree_facts(library),
        *scenes,
        ("peers", "; ".join(_peers())),
        ("kernels", say_kernels()),
        ("results", results),
    ]
    warnings = [*scene_warnings, *_warnings(environment, configuration), *kernel_warnings()]
    return Diagnosis(tuple(facts), tuple(warnings), (*embree_obstacles, *results_obstacles))


def _machine(environment: Environment) -> Iterator[tuple[str, str]]:
    commit = "unknown" if environment.git_commit is None else environment.git_commit[:12]
    yield "atra", f"{environment.atra_version}, commit {commit}{' with changes' if environment.git_dirty else ''}"
    versions = f"NumPy {environment.numpy_version}, Numba {environment.numba_version}"
    yield "Python", f"{environment.python_version}, {versions}"
    yield "system", f"{environment.system} {environment.system_release}, {environment.machine}"
    yield "CPU", environment.cpu
    yield "instructions", say_instructions(environment.cpu_extensions)
    yield "cores", _cores(environment)
    total_gib, free_gib = environment.memory_total_bytes / 2**30, environment.memory_available_bytes / 2**30
    yield "memory", f"{total_gib:.1f} GiB, {free_gib:.1f} GiB free"


def _cores(environment: Environment) -> str:
    logical, physical, affinity = environment.logical_cores, environment.physical_cores, environment.affinity
    told = f"{logical or 'unknown'} logical, {physical or 'unknown'} physical by the system's account"
    if logical and physical and logical > physical:
        told += "; the second may be a hardware thread of the first"
    if affinity is not None and len(affinity) != logical:
        told += f"; this process may use only {_cut(', '.join(map(str, affinity)))}"
    return told


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


def _warnings(environment: Environment, configuration: Configuration) -> Iterator[str]:
    load, budget_gib = environment.load_average, configuration.measure.memory_budget_gib
    cores, threads = resolve_threads(None), configuration.threads
    if threads is not None and threads > cores:
        yield f"more threads are asked for than there are cores ({threads} on {cores})"
    if load and load[0] > BUSY_LOAD:
        yield f"the machine is busy (load {load[0]:.1f})"
    if budget_gib is not None and environment.memory_available_bytes < budget_gib * 2**30:
        yield f"less memory is free than a point may take (measure.memory_budget_gib={budget_gib:g})"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_LIST else f"{text[:_LONGEST_LIST]} ..."
