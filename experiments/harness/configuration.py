"""Typed configuration: the one place that states every field, its type and its default."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite
from pathlib import Path
from typing import Any

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING, DictConfig, OmegaConf

from atra.errors import InputError
from atra.geometry.camera import check_offset
from atra.parallel import resolve_threads

PACKET_WIDTHS = (1, 4, 8, 16)


class Action(Enum):
    """What a run does; `python run.py fetch ...` is short for action=fetch, and so on.

    measure = points and sweeps; fetch = download a scene; report = write figures, claims and page of a sweep anew;
    doctor = say what this machine has and lacks.
    """

    measure = "measure"
    fetch = "fetch"
    report = "report"
    doctor = "doctor"


class Method(Enum):
    """aligned = the paper's; pixel = one ray per pixel, single or in packets; visible_first = aligned without what is
    hidden, verified per pixel; tiles = the cells' culling without alignment; the rest are other people's ray tracers
    (`experiments.peers`), one ray per pixel."""

    aligned = "aligned"
    pixel = "pixel"
    visible_first = "visible_first"
    tiles = "tiles"
    embreex = "embreex"
    trimesh = "trimesh"
    mitsuba3 = "mitsuba3"
    open3d = "open3d"

    @property
    def has_cells(self) -> bool:
        """Whether the image is split for this method."""
        return self in (Method.aligned, Method.visible_first, Method.tiles)


class Geometry(Enum):
    """copied = a sheared copy of the triangles per cell; instanced = an Embree instance per cell, which cannot cull."""

    copied = "copied"
    instanced = "instanced"


class Ties(Enum):
    """Where triangles of one plane overlap: lowest = the lowest prim_id of them wins; any = whichever float32 puts in
    front. For our own tracers; a peer knows no such rule."""

    lowest = "lowest"
    any = "any"


class Motion(Enum):
    """How the frames of a point differ: eyes = two eyes side by side; walk = the camera moves, turns and zooms a
    little every frame; turn = the camera stands still and the mesh turns
    (`experiments.workloads.multiframe.motion`)."""

    eyes = "eyes"
    walk = "walk"
    turn = "turn"


class Quantity(Enum):
    """What is measured at a point, in a process of its own each.

    time = frames, against both baselines; build = plan and BVH build, again and again; memory = only the one method is
    ever built; picture = shaded pictures of the method's hits and of rtcIntersect1's, and their difference;
    agreement = where the method's hits and rtcIntersect1's differ, and which of them is wrong by the float64 oracle;
    planner = a plan, and all that it chooses from.
    """

    time = "time"
    build = "build"
    memory = "memory"
    picture = "picture"
    agreement = "agreement"
    planner = "planner"


class SceneSource(Enum):
    """procedural = made by code; directory = the one named by ATRA_SCENES, or the cache of fetched
    scenes; file = the user's own."""

    procedural = "procedural"
    directory = "directory"
    file = "file"


class BuildQuality(Enum):
    """Embree's, for its BVH."""

    low = "low"
    medium = "medium"
    high = "high"


@dataclass
class SceneConfiguration:
    """What is looked at. view: the scene's own, or another made from it (`experiments.harness.views`); eye, target, up
    and fov_y_degrees override its camera one by one."""

    name: str | None = None
    source: SceneSource = MISSING
    path: str | None = None
    view: str = "own"
    eye: list[float] | None = None
    target: list[float] | None = None
    up: list[float] | None = None
    fov_y_degrees: float | None = None


@dataclass
class SweepConfiguration:
    """What a sweep measures and what it makes of it.

    name: folder below results_dir for table, figures and report.
    grids: by name, the values to sweep, written as on the command line; every grid is crossed out in full, and a point
    of several grids is measured once. The figures are drawn of the grids whose names they know.
    stand_ins: a scene that is not on this machine is replaced by its procedural stand-in.
    report: end with the claims and the HTML page.
    shuffle_seed: points run in an order shuffled by it, so that drift is no trend.
    """

    name: str = "point"
    grids: dict[str, dict[str, Any]] = field(default_factory=dict)
    stand_ins: bool = False
    report: bool = False
    shuffle_seed: int = 1


@dataclass
class MeasureConfiguration:
    """How a point is measured.

    quantity: what is measured. rounds, warmup: rounds that count and rounds before them.
    frame_budget_s: no further round starts past this many seconds of work, but three always run.
    time_limit_s: a worker still running after this long is stopped and its point fails.
    memory_budget_gib: a point that would need more is skipped.
    offsets: sub-pixel positions (x, y) of the images that are compared; sample_rays: rays of each that all triangles
    are tested with, whether the images differ there or not. Both only for quantity=agreement.
    """

    quantity: Quantity = Quantity.time
    rounds: int = 9
    warmup: int = 2
    frame_budget_s: float = 20.0
    time_limit_s: float = 1200.0
    memory_budget_gib: float = 4.0
    offsets: list[list[float]] = field(default_factory=lambda: [[0.5, 0.5]])
    sample_rays: int = 1000


@dataclass
class Configuration:
    """One point.

    split_x: columns of cells; null = 128, or the largest power of two below that divides the width (aligned).
    packet_width: null = the widest the machine supports natively. packet_rows: rows of pixels in a packet, for methods
    with aligned rays; null = what suits the cell. threads: null = every core. frames: traced together in one pass;
    motion: what makes several frames of one view.
    """

    scene: SceneConfiguration = field(default_factory=SceneConfiguration)
    sweep: SweepConfiguration = field(default_factory=SweepConfiguration)
    measure: MeasureConfiguration = field(default_factory=MeasureConfiguration)
    action: Action = Action.measure
    method: Method = Method.aligned
    geometry: Geometry = Geometry.copied
    split_x: int | None = None
    split_y: int = 1
    culling: bool = True
    frames: int = 1
    motion: Motion | None = None
    packet_width: int | None = None
    packet_rows: int | None = None
    threads: int | None = 1
    width: int = 1024
    height: int = 1024
    build_quality: BuildQuality = BuildQuality.medium
    ties: Ties = Ties.lowest
    results_dir: str = "results"
    debug: bool = False


def register_schema() -> None:
    """Make the types known to Hydra as `schema`; conf/config.yaml builds on it, so unknown keys are errors."""
    ConfigStore.instance().store(name="schema", node=Configuration, provider="atra")


def read_configuration(composed: DictConfig) -> Configuration:
    """The composed configuration as typed values.

    Raises InputError for a value no point could use; what depends on the scene or the machine is checked later.
    """
    typed = OmegaConf.get_type(composed) is Configuration
    configuration = OmegaConf.to_object(composed if typed else type_configuration(composed))
    assert isinstance(configuration, Configuration)
    check_configuration(configuration)
    return configuration


def type_configuration(composed: DictConfig) -> DictConfig:
    """Our own part of what Hydra composed: setting a field of another type, or an unknown one, is an error."""
    own = {key: composed[key] for key in Configuration.__dataclass_fields__}
    typed = OmegaConf.merge(OmegaConf.structured(Configuration), own)
    assert isinstance(typed, DictConfig)
    return typed


def check_configuration(configuration: Configuration) -> None:
    """Raise InputError naming the first field whose value lies outside its range."""
    measure, scene, sweep = configuration.measure, configuration.scene, configuration.sweep
    _at_least("width", configuration.width, 1)
    _at_least("height", configuration.height, 1)
    _at_least("split_x", configuration.split_x, 1)
    _at_least("split_y", configuration.split_y, 1)
    resolve_threads(configuration.threads)
    _at_least("frames", configuration.frames, 1)
    if (configuration.frames > 1) != (configuration.motion is not None):
        motion = configuration.motion.value if configuration.motion else "null"
        kinds = ", ".join(one.value for one in Motion)
        raise InputError(
            f"frames is {configuration.frames} with motion={motion}; several frames need a motion ({kinds}), and a "
            "motion needs several frames, for example frames=2 motion=eyes"
        )
    _at_least("measure.rounds", measure.rounds, 1)
    _at_least("measure.warmup", measure.warmup, 0)
    _at_least("measure.sample_rays", measure.sample_rays, 0)
    if not measure.offsets:
        raise InputError("measure.offsets is empty, expected at least one sub-pixel position such as [0.5,0.5]")
    for offset in measure.offsets:
        check_offset(offset)  # type: ignore[arg-type]
    if configuration.packet_width is not None and configuration.packet_width not in PACKET_WIDTHS:
        widths = ", ".join(str(width) for width in PACKET_WIDTHS)
        raise InputError(f"packet_width is {configuration.packet_width}, expected one of {widths} or null")
    for name in ("frame_budget_s", "time_limit_s", "memory_budget_gib"):
        value = getattr(measure, name)
        if not (isfinite(value) and value > 0):
            raise InputError(f"measure.{name} is {value}, expected a positive number")
    for name in ("eye", "target", "up"):
        vector = getattr(scene, name)
        if vector is not None and (len(vector) != 3 or not all(isfinite(value) for value in vector)):
            raise InputError(f"scene.{name} is {vector}, expected three finite numbers such as [0,1,0]")
    if scene.source is SceneSource.file and not scene.path:
        raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
    if scene.source is not SceneSource.file and scene.path is not None:
        raise InputError(f"scene.path is {scene.path!r}, but scene {scene.name} takes none; add scene=file")
    if not sweep.name or any(sign in sweep.name for sign in "/\\") or sweep.name in (".", "..", "records"):
        raise InputError(f"sweep.name is {sweep.name!r}, expected the name of a folder")
    if not configuration.results_dir:
        raise InputError("results_dir is empty, expected a folder")


def results_folder(configuration: Configuration) -> Path:
    """`<results_dir>/<sweep.name>`: table, figures, report."""
    return Path(configuration.results_dir) / configuration.sweep.name


def records_folder(configuration: Configuration) -> Path:
    """`<results_dir>/records`, shared by all sweeps: what one has measured, no other measures again."""
    return Path(configuration.results_dir) / "records"


def check_writable(folder: Path) -> None:
    """Make `folder` if it is missing; raises InputError if nothing can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(
            f"results cannot be written to {folder}: {error.strerror}; choose another results_dir"
        ) from None


def _at_least(name: str, value: Any, least: int) -> None:
    if value is not None and value < least:
        raise InputError(f"{name} is {value}, expected a whole number of at least {least}")
