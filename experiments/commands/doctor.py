"""`python run.py doctor`: what this machine has and what it lacks, on one screen, as a bug report needs it."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from atra.embree.instruction_sets import VARIABLE, instruction_sets_here
from atra.embree.library import OVERRIDE_VARIABLE, Library, embree_version, load_library
from atra.errors import AtraError, InputError, printable
from atra.kernels.caching import cache_folder
from experiments.harness.configuration import Configuration, check_writable
from experiments.harness.environment import BUSY_LOAD, Environment, read_environment
from experiments.methods import METHODS
from scenes.built_in import BUILT_IN
from scenes.directory import SCENES_VARIABLE, meshes_of, scene_folders

_COLUMNS, _NAME_COLUMNS = 80, 14
_LONGEST_LIST = 120
"""A folder may hold any number of meshes, and a package give any reason."""


@dataclass(frozen=True)
class Diagnosis:
    """facts: names and what is here, in the order shown. doubts: what may spoil times, or a sweep. obstacles: why
    nothing can be measured here; empty = it can."""

    facts: tuple[tuple[str, str], ...]
    doubts: tuple[str, ...]
    obstacles: tuple[str, ...]


def run_doctor(configuration: Configuration) -> None:
    """Print the diagnosis; raises SystemExit(1) when nothing can be measured here, the reason being the last line."""
    diagnosis = diagnose(configuration)
    print(render(diagnosis))
    if diagnosis.obstacles:
        raise SystemExit(1)


def diagnose(configuration: Configuration) -> Diagnosis:
    """Look at all that a run relies on. Nothing is measured or written, and what is missing is no error."""
    library, embree_obstacles = _load_embree()
    results, results_obstacles = _results(configuration)
    scenes, scene_doubts = _scenes()
    environment = read_environment(None if library is None else embree_version())
    facts = [
        *_machine(environment),
        *_embree(library),
        *scenes,
        ("peers", "; ".join(_peers())),
        ("kernels", f"kept in {cache_folder()}" if cache_folder() else "not kept"),
        ("results", results),
    ]
    doubts = [*scene_doubts, *_doubts(environment, configuration)]
    return Diagnosis(tuple(facts), tuple(doubts), (*embree_obstacles, *results_obstacles))


def render(diagnosis: Diagnosis) -> str:
    """Lines of 80 columns, and as the last one, of any length, whether points can be measured or why not."""
    lines = [
        textwrap.fill(
            printable(text),
            _COLUMNS,
            initial_indent=name.ljust(_NAME_COLUMNS),
            subsequent_indent=" " * _NAME_COLUMNS,
            break_on_hyphens=False,
        )
        for name, text in [*diagnosis.facts, ("doubts", "; ".join(diagnosis.doubts) or "none")]
    ]
    why_not = printable("; and ".join(diagnosis.obstacles))
    return "\n".join([*lines, f"nothing can be measured here: {why_not}" if why_not else "points can be measured here"])


def _machine(environment: Environment) -> Iterator[tuple[str, str]]:
    commit = "unknown" if environment.git_commit is None else environment.git_commit[:12]
    yield "atra", f"{environment.atra_version}, commit {commit}{' with changes' if environment.git_dirty else ''}"
    versions = f"NumPy {environment.numpy_version}, Numba {environment.numba_version}"
    yield "Python", f"{environment.python_version}, {versions}"
    yield "system", f"{environment.system} {environment.system_release}, {environment.machine}"
    yield "CPU", environment.cpu
    here = ", ".join(instruction_sets_here() or environment.cpu_extensions) or "none that is known"
    held = os.environ.get(VARIABLE)
    used = f"Embree and Numba are held to {held} ({VARIABLE})" if held else f"all are used ({VARIABLE} is not set)"
    yield "instructions", f"{here}; {used}"
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


def _load_embree() -> tuple[Library | None, list[str]]:
    try:
        return load_library(), []
    except AtraError as error:
        return None, [str(error)]


def _embree(library: Library | None) -> Iterator[tuple[str, str]]:
    if library is None:
        yield "Embree", "cannot be used, see the last line"
    else:
        widths = ", ".join(map(str, library.native_packet_widths))
        by = f"; named by {OVERRIDE_VARIABLE}" if os.environ.get(OVERRIDE_VARIABLE) else ""
        yield "Embree", f"{embree_version()}, native packets of {widths}{by}"
        yield "libembree4", str(library.path)


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
        check_writable(next(one for one in (folder, *folder.parents) if os.path.exists(one)))
    except InputError as error:
        return f"cannot be written to {folder}", [str(error)]
    return f"go to {folder}", []


def _doubts(environment: Environment, configuration: Configuration) -> Iterator[str]:
    load, budget_gib = environment.load_average, configuration.measure.memory_budget_gib
    if load and load[0] > BUSY_LOAD:
        yield f"the machine is busy (load {load[0]:.1f})"
    if budget_gib is not None and environment.memory_available_bytes < budget_gib * 2**30:
        yield f"less memory is free than a point may take (measure.memory_budget_gib={budget_gib:g})"
    if cache_folder() is None:
        yield "every process compiles its kernels, as Numba may write nowhere; NUMBA_CACHE_DIR can name a folder"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST_LIST else f"{text[:_LONGEST_LIST]} ..."
