"""Hydra plugins of the experiments, which Hydra finds by their folder: the sweeper `points`, and the source of what is
typed: `schema`, and the options of each method and workload, which is imported only when it is chosen.

Hydra runs this file before it is a module, so annotations may not be put off here; and with every command, help
included, so what takes time to import is imported in functions.
"""

import os
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.experimental.callback import Callback
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf

if TYPE_CHECKING:
    from experiments.harness.configuration import Configuration

_QUEUED_AT_ONCE = 1000
"""Jobs that Slurm's queue is given at once. It takes no longer arrays, unless it is told to."""


@dataclass
class PointsSweeperConfig:
    """max_batch_size: processes of points a launcher is given at once; null = one, for submitit_slurm, which queues
    them, up to 1000. params: values to sweep in every grid."""

    _target_: str = f"{__name__}.PointsSweeper"
    max_batch_size: int | None = None
    params: dict[str, str] = field(default_factory=dict)


ConfigStore.instance().store(group="hydra/sweeper", name="points", node=PointsSweeperConfig, provider="atra")

Job = tuple[str, ...]
"""What composes a point, as on the command line."""


class PointsSweeper(Sweeper):
    """Has all points of a sweep's grids measured at once, each grid crossed with `hydra.sweeper.params`; what the
    command line gives replaces both.

    Hydra's own sweeper starts job after job and knows of no whole: no count, no restart, no table at the end.
    """

    def __init__(self, max_batch_size: int | None, params: dict[str, str]) -> None:
        self._max_batch_size, self._params = max_batch_size, params
        self._composed: dict[Job, DictConfig] = {}

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        self.hydra_context, self.config = hydra_context, config
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )
        self._loader = hydra_context.config_loader
        self._parser = OverridesParser.create(config_loader=self._loader)
        self._groups = set(self._loader.list_groups(""))

    def sweep(self, arguments: Sequence[str]) -> Any:
        """Compose every point of every grid, then have them measured. Returns the table of the sweep.

        Hydra's default launcher is not asked: points run one by one here, as two at once would spoil each other's
        times. Any other launcher gets one job a process of a point, `max_batch_size` of them at once. Raises InputError
        for values that leave no point, and for an option that no point has or can be measured with.
        """
        from atra.errors import InputError
        from experiments.commands.program import COMMAND
        from experiments.harness.points import GridPoint
        from experiments.launched import launch_with
        from experiments.sweep import run_sweep

        grids = dict(self.config.sweep.grids or {"points": {}}) | self._methods_of_files(arguments)
        jobs = [(grid, job) for grid, values in grids.items() for job in self._jobs(values, arguments)]
        if not jobs:
            raise InputError(f"no point is left by {' '.join(arguments)}: a glob or a list of values is empty")
        asked = {argument.partition("=")[0] for argument in arguments}
        kept = self._where_they_fit([job for _, job in jobs], asked)
        points = [
            GridPoint(
                grid, self._compose(job), job, frozenset(asked & {override.partition("=")[0] for override in job})
            )
            for (grid, _), job in zip(jobs, kept, strict=True)
        ]
        command = f"{COMMAND} {shlex.join(sys.argv[1:])}"
        name = self.config.hydra.runtime.choices["hydra/launcher"]
        if name == "basic":
            return run_sweep(points, command=command)
        at_once = self._max_batch_size or (_QUEUED_AT_ONCE if name == "submitit_slurm" else 1)
        launch = launch_with(self.launcher, name == "submitit_slurm")
        return run_sweep(points, command=command, launch=launch, at_once=at_once)

    def _jobs(self, values: Mapping[str, Any], arguments: Sequence[str]) -> Iterator[Job]:
        """Every combination of the values of a grid; the later of two overrides of one key wins."""
        of_sweep = {**self._params, **{str(key): "null" if value is None else value for key, value in values.items()}}
        given = [*(f"{key}={value}" for key, value in of_sweep.items()), *arguments]
        by_key = {
            override.get_key_element(): list(_written(override)) for override in self._parser.parse_overrides(given)
        }
        return product(*by_key.values())

    def _methods_of_files(self, arguments: Sequence[str]) -> dict[str, dict[str, str]]:
        """A grid for the methods of `method_file`, in a sweep whose methods the command line leaves alone."""
        files = self.config.method_file
        if not files or not self.config.sweep.grids or any(argument.startswith("method=") for argument in arguments):
            return {}
        from experiments.harness.entry_points import name_of_file
        from experiments.report.writing import GRID_OF_FILES

        return {GRID_OF_FILES: {"method": ",".join(map(name_of_file, files.split(os.pathsep)))}}

    def _where_they_fit(self, jobs: Sequence[Job], asked: set[str]) -> list[Job]:
        """The jobs without those options of the command line that their method or workload has not. An option that no
        job has stays, and is refused."""
        from experiments.registry import KINDS

        def fits(setting: str, job: Job) -> bool:
            group, _, name = setting.partition("=")[0].partition(".")
            return not name or group not in KINDS or name in self._composed_of(self._choices(job))[group]

        served = {setting.partition("=")[0] for job in jobs for setting in job if fits(setting, job)}
        optional = asked & served
        return [
            tuple(setting for setting in job if setting.partition("=")[0] not in optional or fits(setting, job))
            for job in jobs
        ]

    def _choices(self, job: Job) -> Job:
        """What of a job chooses from groups."""
        return tuple(override for override in job if override.partition("=")[0] in self._groups)

    def _compose(self, job: Job) -> "Configuration":
        """The configuration of a point."""
        from experiments.harness.configuration import read_configuration
        from experiments.registry import KINDS

        choices = self._choices(job)
        fields = [override for override in job if override not in choices]
        if not all(override[0].isalpha() for override in fields):  # +field, ~field: only Hydra knows what they mean
            return read_configuration(self._composed_of(job), KINDS)
        own = deepcopy(self._composed_of(choices))
        for override in self._parser.parse_overrides(fields):
            OmegaConf.update(own, override.get_key_element(), override.value())
        return read_configuration(own, KINDS)

    def _composed_of(self, job: Job) -> DictConfig:
        """What Hydra composes, each job once, as it takes a tenth of a second."""
        if job not in self._composed:
            composed = self._loader.load_sweep_config(self.config, list(job))
            composed.sweep.grids = {}  # of the sweep, not of a point; copying them takes time
            self._composed[job] = OmegaConf.masked_copy(composed, [name for name in composed if name != "hydra"])
        return self._composed[job]


def _written(override: Override) -> Iterator[str]:
    """The values of an override, each as on the command line. Raises InputError for a range without steps."""
    from atra.errors import InputError

    key = override.get_key_element()
    if not override.is_sweep_override():
        yield f"{key}={override.get_value_element_as_str()}"
    elif override.is_discrete_sweep():
        yield from (f"{key}={value}" for value in override.sweep_string_iterator())
    else:
        raise InputError(f"{key}={override.get_value_string()} is an interval, expected values, as in {key}=1,2,4")


class PointsAlone(Callback):
    """Refuses other sweepers before these write anything: they make no table."""

    def on_multirun_start(self, config: DictConfig, **told: Any) -> None:
        sweeper = config.hydra.runtime.choices["hydra/sweeper"]
        if sweeper == "points":
            return
        from atra.errors import InputError
        from experiments.cli import refuse

        # An exit, as Hydra only warns of what goes wrong in a callback.
        raise SystemExit(refuse(InputError(f"hydra/sweeper={sweeper} makes no table; expected hydra/sweeper=points")))


class TypedSearchPath(SearchPathPlugin):
    """Adds `atra://` where the folder of our configuration is searched, and to no other program of Hydra's."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        ours = Path(__file__).resolve().parents[1] / "conf"
        main = (one.path.removeprefix("file://") for one in search_path.get_path() if one.provider == "main")
        if any(Path(path) == ours for path in main):
            search_path.append("atra", "atra://")


class TypedSource(ConfigSource):
    """What `atra://` holds."""

    @staticmethod
    def scheme() -> str:
        return "atra"

    def available(self) -> bool:
        return True

    def is_group(self, config_path: str) -> bool:
        return config_path.strip("/") in ("", *_groups())

    def is_config(self, config_path: str) -> bool:
        group, _, name = _plain(config_path).rpartition("/")
        return name in (_groups().get(group, ()) if group else ("schema",))

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        path, groups = config_path.strip("/"), _groups()
        configs, below = (groups[path], ()) if path else (("schema",), groups)
        return sorted(
            [*(configs if results_filter != ObjectType.GROUP else ())]
            + [*(below if results_filter != ObjectType.CONFIG else ())]
        )

    def load_config(self, config_path: str) -> ConfigResult:
        node = OmegaConf.create(_defaults(*_plain(config_path).rpartition("/")[::2]))
        return ConfigResult(provider="atra", path=self.full_path(), config=node, header={"package": None})


def _plain(config_path: str) -> str:
    return config_path.strip("/").removesuffix(".yaml")


def _groups() -> dict[str, Sequence[str]]:
    """What there is of each group, by name."""
    from experiments.registry import KINDS
    from scenes.built_in import package_scenes

    return {group: kind.names() for group, kind in KINDS.items()} | {"scene": list(package_scenes())}


def _defaults(group: str, name: str) -> dict[str, Any]:
    """The configuration of that name: a method or workload with its options, all fields, or a package's scene."""
    from experiments.harness.configuration import Configuration, plain_defaults
    from experiments.registry import KINDS

    if group == "scene":
        return {"name": name, "source": "package"}
    return {"name": name} | plain_defaults(KINDS[group].find(name).options) if group else plain_defaults(Configuration)


def _say_options(group: str, name: str) -> str:
    """For the help: the options of a method or a workload with their help, a line each."""
    from experiments.harness.options import say_options
    from experiments.registry import KINDS

    return say_options(group, KINDS[group].find(name)) if name in KINDS[group].names() else f"as {group}={name} says"


OmegaConf.register_new_resolver("options_of", _say_options, replace=True)
