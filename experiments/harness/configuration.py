"""Typed configuration: the one place that states every field, its type and its default."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, DictConfig, OmegaConf

from atra.compiled.threads import resolve_threads
from atra.embree.scene import BUILD_QUALITIES
from atra.errors import InputError
from atra.tracing.tracer import TIES
from experiments.harness.method import TIES_HELP, Tracing
from experiments.harness.options import (
    Named,
    check_choice,
    check_whole_numbers,
    find_named,
    option,
    say_options,
    say_unknown_field,
    schema,
    typed_options,
)
from experiments.harness.point import Kinds
from scenes.built_in import package_scenes
from scenes.loading import SceneSource


class Action(Enum):
    """What a run does; `python run.py fetch ...` is short for action=fetch, and so on.

    measure = points and sweeps; fetch = download a scene; report = write figures, claims and page of a sweep anew;
    doctor = say what this machine has and lacks.
    """

    measure = "measure"
    fetch = "fetch"
    report = "report"
    doctor = "doctor"


@dataclass
class SceneConfiguration:
    """What is looked at.

    name: of the scene; `scene=sponza` sets it. source: where its mesh comes from; `scene=sponza` sets it, too.
    path: the file of `scene=file`, of any format that trimesh reads. triangles: how many a generated scene has, about.
    view: the scene's own camera, or another made from it (`scenes.views`). eye, target, up: vectors of the camera, in
    place of the view's. fov_y_degrees: vertical field of view, in place of the view's.
    subdivided: how often each triangle is cut into four. copies: how many of the scene stand side by side as one mesh.
    """

    name: str | None = None
    source: SceneSource = MISSING
    path: str | None = None
    triangles: int | None = None
    view: str = "own"
    eye: list[float] | None = None
    target: list[float] | None = None
    up: list[float] | None = None
    fov_y_degrees: float | None = None
    subdivided: int = 0
    copies: int = 1


@dataclass
class SweepConfiguration:
    """What a sweep measures and what it makes of it. name: folder below results_dir for table, figures and report.
    grids: by name, the values to sweep, written as on the command line; every grid is crossed out in full, and a point
    of several grids is measured once.
    figures: by name of the figure, the grids it is drawn of; without any, every figure that has something to show.
    stand_ins: a scene that is not on this machine is replaced by its procedural stand-in.
    report: end with the claims and the HTML page. shuffle_seed: of the points' order, so that drift is no trend.
    repeats: how often a disturbed process is measured again, at most.
    skip_slower: points predicted to take more than so many times as long as the fastest of their view are skipped.
    """

    name: str = "point"
    grids: dict[str, dict[str, Any]] = field(default_factory=dict)
    figures: dict[str, list[str]] = field(default_factory=dict)
    stand_ins: bool = False
    report: bool = False
    shuffle_seed: int = 1
    repeats: int = 3
    skip_slower: float | None = None


@dataclass
class MeasureConfiguration:
    """How a point is measured. processes: how many processes, one after another and spread over the sweep, measure
    each timed point. One process has its memory laid out in one way and meets one mood of the machine, so intervals
    are of processes. process: which of them a launched job is; a sweep sets it.
    rounds, warmup: rounds of a process that count and rounds before them. frame_budget_s: no further round starts past
    this many seconds of work, but three always run. time_limit_s: a worker that runs longer is stopped and fails.
    memory_budget_gib: points that need more are skipped until the next run; null = three quarters of what is free.
    instruction_set: what Embree and Numba are held to, as by ATRA_ISA; null = as the run.
    quiet_limit_s: how long a sweep waits in all while others use more than 5 % of all cores, after the first look.
    quiet_only: whether it waits for that, too, and ends when the time is up; otherwise its times bear doubts.
    """

    processes: int = 3
    process: int = 0
    rounds: int = 5
    warmup: int = 1
    frame_budget_s: float = 10.0
    time_limit_s: float = 1200.0
    memory_budget_gib: float | None = None
    instruction_set: str | None = None
    quiet_limit_s: float = 60.0
    quiet_only: bool = False


@dataclass
class Configuration:
    """One point.

    action: what the run does; the verb sets it. method: what traces; its options are method.*. workload: what is
    measured; its options are workload.*. threads: number of threads, null = every core, baselines included. width:
    pixels of a row. height: rows of pixels. method_file: a Python file with a method of one's own, several apart as in
    PATH; a sweep measures it beside its own methods. results_dir: folder for all results; each sweep has a folder of
    its name in it. debug: whether an error shows its traceback.
    """

    scene: SceneConfiguration = field(default_factory=SceneConfiguration)
    sweep: SweepConfiguration = field(default_factory=SweepConfiguration)
    measure: MeasureConfiguration = field(default_factory=MeasureConfiguration)
    action: Action = Action.measure
    method: Any = MISSING
    workload: Any = MISSING
    threads: int | None = 1
    width: int = 1024
    height: int = 1024
    build_quality: str = option(
        Tracing.build_quality, "Embree's, for every BVH, baselines included", choices=BUILD_QUALITIES
    )
    ties: str = option(Tracing.ties, TIES_HELP, choices=TIES)
    method_file: str | None = None
    results_dir: str = "results"
    debug: bool = False


@dataclass(frozen=True)
class Chosen:
    """kind: a method or a workload. options: of its type."""

    kind: Any
    options: Any

    @property
    def name(self) -> str:
        """What chooses it on the command line."""
        return str(self.kind.name)


def register_schema(kinds: Kinds) -> None:
    """Make the types known to Hydra: `schema`, on which conf/config.yaml builds, and each method's and workload's
    options, so that unknown keys are errors. `--help` asks for their help by `options_of` (conf/config.yaml)."""

    def options_of(group: str, name: str) -> str:
        return say_options(group, find_named(group, kinds.groups[group], name))

    OmegaConf.register_new_resolver("options_of", options_of, replace=True)
    store = ConfigStore.instance()
    store.store(name="schema", node=Configuration, provider="atra")
    for group, named in kinds.groups.items():
        for kind in named:
            store.store(group=group, name=kind.name, node=schema(group, kind), provider="atra")
    for name in package_scenes():
        store.store(group="scene", name=name, node={"name": name, "source": SceneSource.package.value}, provider="atra")


def read_configuration(composed: DictConfig, kinds: Kinds) -> Configuration:
    """The composed configuration as typed values; `method` and `workload` are `Chosen`.

    Raises InputError for a value no point could use; what depends on the scene or the machine is checked later.
    """
    typed = OmegaConf.get_type(composed) is Configuration
    configuration = OmegaConf.to_object(composed if typed else type_configuration(composed))
    assert isinstance(configuration, Configuration)
    _check_fields(configuration, kinds)
    for group, named in kinds.groups.items():
        given = dict(vars(getattr(configuration, group)))
        name = given.pop("name")
        if type(getattr(configuration, group)).__name__ != f"{group}={name}":
            raise InputError(f"{group}.name cannot be set, choose with {group}={name}")
        kind = find_named(group, named, name)
        setattr(configuration, group, Chosen(kind, typed_options(kind.options, given)))
    check_configuration(configuration)
    return configuration


def type_configuration(composed: DictConfig) -> DictConfig:
    """Our own part of what Hydra composed: setting a field of another type, or an unknown one, is an error."""
    own = {key: composed[key] for key in composed if key != "hydra"}
    typed = OmegaConf.merge(OmegaConf.structured(Configuration), own)
    assert isinstance(typed, DictConfig)
    return typed


def _check_fields(section: Any, kinds: Kinds, path: str = "") -> None:
    """Raise InputError for a field that Hydra was made to add, as by `+field=value`."""
    for name, value in vars(section).items():
        if name not in section.__dataclass_fields__:
            raise InputError(say_unknown(type(section), path + name, kinds))
        if is_dataclass(value):
            _check_fields(value, kinds, f"{path}{name}.")


def say_unknown(kind: type, path: str, kinds: Kinds) -> str:
    """That `kind` has no such field, which it has, and which was perhaps meant: one of that name elsewhere, or of a
    name much like it."""
    known = [one for one in _fields_of(Configuration, kinds.groups) if one != path]
    name = path.rpartition(".")[2]
    meant = [one for one in known if one.rpartition(".")[2] == name] or get_close_matches(path, known, 1, 0.8)
    return say_unknown_field(kind, path) + (f"; did you mean {' or '.join(meant)}?" if meant else "")


def _fields_of(kind: type, groups: Mapping[str, Sequence[Named]], path: str = "") -> list[str]:
    """Every field that can be set, as it is written on the command line, each once."""
    found = []
    for one in fields(kind):
        sections = [one.default_factory] if is_dataclass(one.default_factory) else []
        sections += [chosen.options for chosen in groups.get(one.name, ())]
        below = [name for section in sections for name in _fields_of(section, groups, f"{path}{one.name}.")]
        found += [f"{path}{one.name}", *below]
    return list(dict.fromkeys(found))


def check_configuration(configuration: Configuration) -> None:
    """Raise InputError naming the first field whose value lies outside its range."""
    scene, sweep, measure = configuration.scene, configuration.sweep, configuration.measure
    for section, path, ranges in (
        (configuration, "", {"width": (1, None), "height": (1, None)}),
        (sweep, "sweep.", {"repeats": (0, None)}),
        (scene, "scene.", {"subdivided": (0, None), "copies": (1, None)}),
        (measure, "measure.", {"processes": (1, None), "process": (0, None), "rounds": (1, None), "warmup": (0, None)}),
    ):
        check_whole_numbers(section, path, ranges)
    resolve_threads(configuration.threads)
    for name in ("build_quality", "ties"):
        check_choice(Configuration.__dataclass_fields__[name], str, getattr(configuration, name), name)
    for name in ("frame_budget_s", "time_limit_s", "memory_budget_gib"):
        value = getattr(measure, name)
        if value is not None and not (isfinite(value) and value > 0):
            raise InputError(f"measure.{name} is {value}, expected a positive number")
    for name in ("eye", "target", "up"):
        vector = getattr(scene, name)
        if vector is not None and (len(vector) != 3 or not all(isfinite(value) for value in vector)):
            raise InputError(f"scene.{name} is {vector}, expected three finite numbers such as [0,1,0]")
    if scene.source is SceneSource.file and not scene.path:
        raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
    if scene.source is not SceneSource.file and scene.path is not None:
        raise InputError(f"scene.path is {scene.path!r}, but scene {scene.name} takes none; add scene=file")
    if scene.source is not SceneSource.generated and scene.triangles is not None:
        raise InputError(
            f"scene.triangles is {scene.triangles}, but scene {scene.name} has its own; use scene=generated/terrain"
        )
    if not sweep.name or any(sign in sweep.name for sign in "/\\") or sweep.name in (".", "..", "records", "singles"):
        raise InputError(f"sweep.name is {sweep.name!r}, expected the name of a folder")
    if not configuration.results_dir:
        raise InputError("results_dir is empty, expected a folder")


def results_folder(configuration: Configuration) -> Path:
    """`<results_dir>/<sweep.name>`: table, figures, report."""
    return Path(configuration.results_dir) / configuration.sweep.name


def records_folder(configuration: Configuration) -> Path:
    """`<results_dir>/records`, shared by all sweeps: what one has measured, no other measures again."""
    return Path(configuration.results_dir) / "records"
