"""Typed configuration: the one place that states every field, its type and its default."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig, OmegaConf

from atra.errors import InputError
from experiments.harness.column import default_of
from experiments.harness.method import BUILD_QUALITIES, TIES, TIES_HELP, Tracing
from experiments.harness.options import Settings, option, plain, typed, whole
from experiments.harness.point import Kinds
from scenes.loading import SceneSource

CONFIGURATION = Path(__file__).resolve().parents[2] / "conf"
"""The folder of configuration files."""


@dataclass
class SceneConfiguration(Settings):
    """What is looked at."""

    section = "scene"

    name: str | None = option(None, "name of the scene; scene=sponza sets it")
    source: SceneSource = option(MISSING, "where the mesh comes from; scene=sponza sets it, too")
    path: str | None = option(None, "file of scene=file, of any format that trimesh reads")
    triangles: int | None = option(None, "approximate number of triangles of a generated scene")
    view: str = option("own", "the scene's own camera, or another made from it (scenes.views)")
    eye: list[float] | None = option(None, "position of the camera, in place of the view's")
    target: list[float] | None = option(None, "point that the camera looks at, in place of the view's")
    up: list[float] | None = option(None, "direction that is up in the image, in place of the view's")
    fov_y_degrees: float | None = option(None, "vertical field of view, in place of the view's")
    subdivided: int = whole(0, "number of times that each triangle is cut into four", 0)
    copies: int = whole(1, "number of copies of the scene, side by side in one mesh", 1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("eye", "target", "up"):
            vector = getattr(self, name)
            if vector is not None and (len(vector) != 3 or not all(isfinite(value) for value in vector)):
                raise InputError(f"scene.{name} is {[*vector]}, expected three finite numbers such as [0,1,0]")
        if self.source is SceneSource.file and not self.path:
            raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
        if self.source is not SceneSource.file and self.path is not None:
            raise InputError(f"scene.path is {self.path!r}, but scene {self.name} takes none; add scene=file")
        if self.source is not SceneSource.generated and self.triangles is not None:
            raise InputError(
                f"scene.triangles is {self.triangles}, but scene {self.name} has its own; use scene=generated_terrain"
            )


@dataclass
class SweepConfiguration(Settings):
    """What a sweep measures and what it makes of it."""

    section = "sweep"

    name: str = option("point", "folder below results_dir for table, figures and report")
    grids: dict[str, dict[str, Any]] = option(
        dict,
        "by name, the values to sweep, written as on the command line; every grid is crossed out in full, and a point "
        "of several grids is measured once",
    )
    figures: dict[str, list[str]] = option(
        dict, "by name of the figure, the grids it is drawn of; without any, every figure that has something to show"
    )
    stand_ins: bool = option(False, "a scene that is not on this machine is replaced by its procedural stand-in")
    report: bool = option(False, "end with the claims and the HTML page")
    shuffle_seed: int = option(1, "seed of the points' order, so that drift is no trend")
    repeats: int = whole(3, "how often a disturbed process is measured again, at most", 0)
    skip_slower: float | None = option(
        None, "points predicted to take more than so many times as long as the fastest of their view are skipped"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        name = self.name
        if not name or any(sign in name for sign in "/\\") or name in (".", "..", "records", "singles"):
            raise InputError(f"sweep.name is {name!r}, expected the name of a folder")


@dataclass
class MeasureConfiguration(Settings):
    """How a point is measured. Memory layout and machine state stay fixed within a process, so intervals are of
    processes."""

    section = "measure"

    processes: int = whole(
        3, "how many processes, one after another and spread over the sweep, measure each timed point", 1
    )
    process: int = whole(0, "which of the processes a launched job is; a sweep sets it", 0)
    rounds: int = whole(5, "rounds of a process that count", 1)
    warmup: int = whole(1, "rounds before those that count", 0)
    frame_budget_s: float = option(10.0, "no further round starts past this many seconds of work, but three always run")
    time_limit_s: float = option(1200.0, "a worker that runs longer is stopped and fails")
    memory_budget_gib: float | None = option(
        None, "points that need more are skipped until the next run; null = three quarters of what is free"
    )
    instruction_set: str | None = option(
        None, "instruction set of Embree and Numba, as ATRA_ISA sets it; null = that of the run"
    )
    idle_limit_s: float = option(
        60.0, "how long a sweep waits in all while others use more than 5 % of all cores, after the first look"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("frame_budget_s", "time_limit_s", "memory_budget_gib"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0):
                raise InputError(f"measure.{name} is {value}, expected a positive number")


@dataclass
class Configuration(Settings):
    """One point."""

    section = ""

    scene: SceneConfiguration = field(default_factory=SceneConfiguration)
    sweep: SweepConfiguration = field(default_factory=SweepConfiguration)
    measure: MeasureConfiguration = field(default_factory=MeasureConfiguration)
    method: Any = option(MISSING, "what traces; its options are method.*")
    workload: Any = option(MISSING, "what is measured; its options are workload.*")
    threads: int | None = option(1, "number of threads; null = every core, baselines included")
    width: int = whole(1024, "pixels of a row", 1)
    height: int = whole(1024, "rows of pixels", 1)
    build_quality: str = option(
        Tracing.build_quality, "Embree's, for every BVH, baselines included", choices=BUILD_QUALITIES
    )
    ties: str = option(Tracing.ties, TIES_HELP, choices=TIES)
    method_file: str | None = option(
        None, "a Python file with a method of one's own, several apart as in PATH; a sweep measures it beside its own"
    )
    results_dir: str = option("results", "folder for all results; each sweep has a folder of its name in it")
    debug: bool = option(False, "an error shows its traceback")

    def __post_init__(self) -> None:
        super().__post_init__()
        from atra.compiled.threads import resolve_threads

        resolve_threads(self.threads)
        if not self.results_dir:
            raise InputError("results_dir is empty, expected a folder")


@dataclass(frozen=True)
class Chosen:
    """kind: a method or a workload. options: of its type."""

    kind: Any
    options: Any

    @property
    def name(self) -> str:
        """What chooses it on the command line."""
        return str(self.kind.name)


def read_configuration(composed: DictConfig, kinds: Kinds) -> Configuration:
    """What Hydra composed as typed values; `method` and `workload` are `Chosen`.

    Raises InputError for a value no point could use; what depends on the scene or the machine is checked later.
    """
    values: Any = OmegaConf.to_container(composed, resolve=True)
    values.pop("hydra", None)
    for group in kinds:
        options = values[group]
        if "name" not in options:
            raise InputError(f"the file of {group} names none, expected one under defaults in it, as in [pixel]")
        kind = kinds[group].find(options.pop("name"))
        values[group] = Chosen(kind, _typed(kind.options, options, group, kinds))
    for section, kind in _sections().items():
        values[section] = _typed(kind, values[section], section, kinds)
    return _typed(Configuration, values, "", kinds)  # type: ignore[no-any-return]


def _sections() -> dict[str, Any]:
    """The parts of every configuration that have fields of their own, by name."""
    return {spec.name: spec.default_factory for spec in fields(Configuration) if is_dataclass(spec.default_factory)}


def _typed(kind: Any, values: dict[str, Any], section: str, kinds: Kinds) -> Any:
    """`typed`, and InputError for a field that there is not: Hydra was made to add it, by +field=value or in a file."""
    path = f"{section}." if section else ""
    for name in values:
        if name not in kind.__dataclass_fields__:
            raise InputError(say_unknown(kind, f"{path}{name}", kinds))
    return typed(kind, values, path)


def plain_defaults(kind: type) -> dict[str, Any]:
    """The fields of a section, or the options of a method or workload, with their defaults, for Hydra to compose."""
    defaults = {}
    for spec in fields(kind):
        default = default_of(spec)
        defaults[spec.name] = plain_defaults(type(default)) if is_dataclass(default) else plain(default)
    return defaults


def options_at(path: str, node: Any, kinds: Kinds) -> Any:
    """Whose field the path of one is, such as "method.split_x". node: the part of the configuration with that field."""
    section = path.partition(".")[0] if "." in path else ""
    if section in kinds:
        return kinds[section].find(node["name"]).options
    return _sections().get(section, Configuration)


def say_unknown(kind: Any, path: str, kinds: Kinds) -> str:
    """That `kind` has no field `path`, such as "method.split_x", and which it has. Then who else has it: another method
    or workload, or a section with a field of that name, or of a name much like it."""
    section, _, name = path.rpartition(".")
    everyone = {group: [kind.find(named) for named in kind.names()] for group, kind in kinds.items()}
    owner, users = section, []
    if section in everyone:
        chosen = [owner.name for owner in everyone[section] if owner.options is kind]
        owner = f"{section}={chosen[0]}" if len(chosen) == 1 else f"this {section}"
        users = [user.name for user in everyone[section] if name in user.options.__dataclass_fields__]
    names = [spec.name for spec in fields(kind)]
    expected = f"expected {'one of ' * (len(names) > 1)}{', '.join(names)}" if names else "which has none"
    told = f"unknown field {name!r}{' of ' * bool(owner)}{owner}, {expected}"
    if users:
        return f"{told}; it is an option of {section}={', '.join(users)}"
    parts = [*_sections().items(), *((group, chosen.options) for group in everyone for chosen in everyone[group])]
    known = [spec.name for spec in fields(Configuration)]
    known += dict.fromkeys(f"{part}.{spec.name}" for part, kind_of_part in parts for spec in fields(kind_of_part))
    meant = [known_path for known_path in known if known_path.rpartition(".")[2] == name]
    meant = meant or get_close_matches(path, known, 1, 0.8)
    return told + (f"; did you mean {' or '.join(meant)}?" if meant else "")


def results_folder(configuration: Configuration) -> Path:
    """`<results_dir>/<sweep.name>`: table, figures, report."""
    return Path(configuration.results_dir) / configuration.sweep.name


def records_folder(configuration: Configuration) -> Path:
    """`<results_dir>/records`, shared by all sweeps: what one has measured, no other measures again."""
    return Path(configuration.results_dir) / "records"
