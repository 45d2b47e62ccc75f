"""Typed configuration: the one place that states every field, its type and its default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig, OmegaConf

from atra.errors import InputError
from experiments.harness.method import BUILD_QUALITIES, TIES, TIES_HELP, Tracing
from experiments.harness.options import check_choice, check_whole_numbers, option, typed_options
from experiments.harness.point import Kinds
from scenes.loading import SceneSource

CONFIGURATION = Path(__file__).resolve().parents[2] / "conf"
"""The folder of configuration files."""


@dataclass
class SceneConfiguration:
    """What is looked at.

    name: name of the scene; `scene=sponza` sets it. source: where its mesh comes from; `scene=sponza` sets it, too.
    path: the file of `scene=file`, of any format that trimesh reads. triangles: approximate number of triangles of a
    generated scene.
    view: the scene's own camera, or another made from it (`scenes.views`). eye, target, up: vectors of the camera, in
    place of the view's. fov_y_degrees: vertical field of view, in place of the view's.
    subdivided: number of times that each triangle is cut into four. copies: number of copies of the scene, side by
    side in one mesh.
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
    report: end with the claims and the HTML page. shuffle_seed: seed of the points' order, so that drift is no trend.
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
    each timed point. Memory layout and machine state stay fixed within a process, so intervals are of processes.
    process: which of them a launched job is; a sweep sets it.
    rounds, warmup: rounds of a process that count and rounds before them. frame_budget_s: no further round starts past
    this many seconds of work, but three always run. time_limit_s: a worker that runs longer is stopped and fails.
    memory_budget_gib: points that need more are skipped until the next run; null = three quarters of what is free.
    instruction_set: instruction set of Embree and Numba, as ATRA_ISA sets it; null = that of the run.
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

    method: what traces; its options are method.*. workload: what is
    measured; its options are workload.*. threads: number of threads, null = every core, baselines included. width:
    pixels of a row. height: rows of pixels. method_file: a Python file with a method of one's own, several apart as in
    PATH; a sweep measures it beside its own methods. results_dir: folder for all results; each sweep has a folder of
    its name in it. debug: whether an error shows its traceback.
    """

    scene: SceneConfiguration = field(default_factory=SceneConfiguration)
    sweep: SweepConfiguration = field(default_factory=SweepConfiguration)
    measure: MeasureConfiguration = field(default_factory=MeasureConfiguration)
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


def read_configuration(composed: DictConfig, choices: Mapping[str, str], kinds: Kinds) -> Configuration:
    """The composed configuration as typed values; `method` and `workload` are `Chosen`. choices: what Hydra chose of
    each group, `hydra.runtime.choices`.

    Raises InputError for a value no point could use; what depends on the scene or the machine is checked later.
    """
    is_typed = OmegaConf.get_type(composed) is Configuration and "hydra" not in composed
    typed = composed if is_typed else type_configuration(composed)
    _check_fields(typed, kinds)
    configuration = OmegaConf.to_object(typed)
    assert isinstance(configuration, Configuration)
    for group in kinds:
        section = typed[group]
        kind = _chosen(group, choices[group], OmegaConf.get_type(section), kinds)
        given: Any = OmegaConf.to_container(section, resolve=True)
        setattr(configuration, group, Chosen(kind, typed_options(kind.options, given)))
    check_configuration(configuration)
    return configuration


def _chosen(group: str, choice: str, options: type | None, kinds: Kinds) -> Any:
    """The method or workload that was chosen: the one of that name, or, where a file of the user's own presets options,
    the one that has such options."""
    names = kinds[group].names()
    if choice in names:
        return kinds[group].find(choice)
    fitting = [kind for kind in map(kinds[group].find, names) if kind.options is options]
    if len(fitting) != 1:
        raise InputError(f"{group}={choice} has the options of no {group}; name one under defaults in its file")
    return fitting[0]


def type_configuration(composed: DictConfig) -> DictConfig:
    """Our own part of what Hydra composed: setting a field of another type, or an unknown one, is an error."""
    own = {key: composed[key] for key in composed if key != "hydra"}
    typed = OmegaConf.merge(OmegaConf.structured(Configuration), own)
    assert isinstance(typed, DictConfig)
    return typed


def _check_fields(section: DictConfig, kinds: Kinds, path: str = "") -> None:
    """Raise InputError for a field that Hydra was made to add, as by `+field=value`."""
    kind = OmegaConf.get_type(section)
    known = getattr(kind, "__dataclass_fields__", None)
    for name in map(str, section):
        if known is not None and name not in known:
            raise InputError(say_unknown(kind, path + name, kinds))
        if not OmegaConf.is_missing(section, name) and OmegaConf.is_dict(section[name]):
            _check_fields(section[name], kinds, f"{path}{name}.")


def say_unknown(kind: Any, path: str, kinds: Kinds) -> str:
    """That `kind` has no field `path`, such as "method.split_x", and which it has. Then who else has it: another method
    or workload, or a section with a field of that name, or of a name much like it."""
    section, _, name = path.rpartition(".")
    everyone = {group: [one.find(named) for named in one.names()] for group, one in kinds.items()}
    owner, users = section, []
    if section in everyone:
        chosen = [one.name for one in everyone[section] if one.options is kind]
        owner = f"{section}={chosen[0]}" if len(chosen) == 1 else f"this {section}"
        users = [one.name for one in everyone[section] if name in one.options.__dataclass_fields__]
    names = [one.name for one in fields(kind)]
    expected = f"expected {'one of ' * (len(names) > 1)}{', '.join(names)}" if names else "which has none"
    told = f"unknown field {name!r}{' of ' * bool(owner)}{owner}, {expected}"
    if users:
        return f"{told}; it is an option of {section}={', '.join(users)}"
    known = _fields_of(Configuration, everyone)
    meant = [one for one in known if one.rpartition(".")[2] == name] or get_close_matches(path, known, 1, 0.8)
    return told + (f"; did you mean {' or '.join(meant)}?" if meant else "")


def _fields_of(kind: Any, everyone: dict[str, list[Any]], path: str = "") -> list[str]:
    """Every field that can be set, as it is written on the command line, each once. everyone: what there is to choose
    from, by group."""
    paths = []
    for spec in fields(kind):
        sections: list[Any] = [spec.default_factory] if is_dataclass(spec.default_factory) else []
        sections += [chosen.options for chosen in everyone.get(spec.name, ())]
        below = [name for section in sections for name in _fields_of(section, everyone, f"{path}{spec.name}.")]
        paths += [f"{path}{spec.name}", *below]
    return list(dict.fromkeys(paths))


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
    from atra.compiled.threads import resolve_threads

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
            f"scene.triangles is {scene.triangles}, but scene {scene.name} has its own; use scene=generated_terrain"
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
