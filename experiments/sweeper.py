"""Hydra plugin: hands all points of a MULTIRUN to `experiments` at once.

Hydra's own sweeper starts job after job and knows of no whole: no count, no restart, no table at the end.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.plugins import Plugins
from hydra.core.utils import JobStatus
from omegaconf import DictConfig, OmegaConf

from experiments.commands.program import COMMAND
from experiments.harness.configuration import read_configuration, type_configuration
from experiments.harness.processes.launching import project_environment, stop_children
from experiments.registry import known_kinds
from experiments.submitted import first_line, run_submitted

if TYPE_CHECKING:
    from experiments.launched import Ended

# Hydra's list of plugins, when it is made, runs the modules of its own plugins again. A class that was imported before
# would not be the one that their code then means by its name.
Plugins.instance()

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper  # noqa: E402

_TARGET = "hydra_plugins.points.PointsSweeper"
"""The name by which the configuration chooses the sweeper. Hydra refuses plugins whose name begins in another way."""

_LAUNCHER_HERE = "hydra._internal.core_plugins.basic_launcher.BasicLauncher"
_SUBMITIT = "hydra_plugins.hydra_submitit_launcher.submitit_launcher"
_QUEUED_AT_ONCE = 1000
"""Jobs that Slurm's queue is given at once. It takes no longer arrays, unless it is told to."""


@dataclass
class PointsSweeperConfig:
    """max_batch_size: processes of points a launcher is given at once; null = one, for submitit_slurm, which queues
    them, up to 1000."""

    _target_: str = _TARGET
    max_batch_size: int | None = None
    params: dict[str, str] | None = field(default_factory=dict)


def register_sweeper() -> None:
    """Make the sweeper known to Hydra."""
    plugins = Plugins.instance()
    plugins.register(PointsSweeper)
    # Under its own name alone, Hydra would not use it. The class stays what it is: launchers pickle it by that name.
    plugins.class_name_to_class[_TARGET] = PointsSweeper
    ConfigStore.instance().store(group="hydra/sweeper", name="points", node=PointsSweeperConfig, provider="atra")


def _written(value: Any) -> Any:
    """A grid's value as on the command line."""
    return "null" if value is None else value


class PointsSweeper(BasicSweeper):
    """The grids of a sweep, each crossed with `hydra.sweeper.params`; what the command line gives replaces both."""

    def sweep(self, arguments: list[str]) -> Any:
        """Compose every point of every grid, then have them measured.

        Hydra's default launcher is not asked: points run one by one here, as two at once would spoil each other's
        times. Any other launcher gets one job a process of a point, `max_batch_size` of them at once.
        """
        from experiments.sweep import GridPoint, run_sweep

        assert self.config is not None
        parser = OverridesParser.create(config_loader=self._loader)
        compose = _Composer(self.config, self._loader, parser)
        jobs: list[tuple[str, list[str]]] = []
        grids = dict(self.config.sweep.grids or {"points": {}}) | self._methods_of_files(arguments)
        for grid, values in grids.items():
            # The later of two overrides of one key wins.
            given = [*self._parse_config(), *(f"{key}={_written(value)}" for key, value in values.items()), *arguments]
            (of_grid,) = self.split_arguments(parser.parse_overrides(given), max_batch_size=None)
            jobs += [(grid, job) for job in of_grid]
        asked = {argument.partition("=")[0] for argument in arguments}
        kept = self._where_they_fit([job for _, job in jobs], asked)
        points = [GridPoint(grid, compose(job), tuple(job)) for (grid, _), job in zip(jobs, kept, strict=True)]
        command = " ".join([COMMAND, *self.config.hydra.overrides.task, *self.config.hydra.overrides.hydra])
        launcher = self.config.hydra.launcher._target_
        if launcher == _LAUNCHER_HERE:
            return run_sweep(points, command=command)
        at_once = self.max_batch_size or (_QUEUED_AT_ONCE if launcher == f"{_SUBMITIT}.SlurmLauncher" else 1)
        return run_sweep(points, command=command, launch=self._launch, at_once=at_once)

    def _methods_of_files(self, arguments: Sequence[str]) -> dict[str, dict[str, str]]:
        """A grid for the methods of `method_file`, in a sweep whose methods the command line leaves alone."""
        assert self.config is not None
        if not self.config.method_file or any(one.startswith("method=") for one in arguments):
            return {}
        from experiments.report.writing import GRID_OF_FILES

        return {
            GRID_OF_FILES: {
                "method": ",".join(
                    Path(one).stem.replace("-", "_") for one in self.config.method_file.split(os.pathsep)
                )
            }
        }

    def _where_they_fit(self, jobs: Sequence[list[str]], asked: set[str]) -> list[list[str]]:
        """The jobs without those options of the command line that their method or workload has not. An option that no
        job has stays, and is refused."""
        known = {group: {one.name: one for one in named} for group, named in known_kinds().groups.items()}

        def fits(override: str, chosen: Mapping[str, str]) -> bool:
            group, _, field = override.partition("=")[0].partition(".")
            kind = known.get(group, {}).get(chosen.get(group, ""))
            return kind is None or not field or field in {one.name for one in fields(kind.options)}

        chosen = [
            {group: self.config[group].name for group in known}  # type: ignore[index]
            | {key: value for key, _, value in (override.partition("=") for override in job) if key in known}
            for job in jobs
        ]
        pairs = list(zip(jobs, chosen, strict=True))
        served = {one.partition("=")[0] for job, names in pairs for one in job if fits(one, names)}
        optional = asked & served
        return [
            [one for one in job if one.partition("=")[0] not in optional or fits(one, names)] for job, names in pairs
        ]

    @property
    def _loader(self) -> Any:
        assert self.hydra_context is not None
        return self.hydra_context.config_loader

    def _launch(self, jobs: Sequence[Sequence[str]], ended: Ended) -> None:
        """One Hydra job a process of a point (`experiments.launched.Launch`)."""
        assert self.launcher is not None
        # A job is unpickled by an interpreter that was not started as run.py.
        os.environ.update(project_environment())
        try:
            if type(self.launcher).__module__ == _SUBMITIT:
                run_submitted(self.launcher, jobs, ended)
            else:
                for place, problem in enumerate(self._launched_by_hydra(jobs)):
                    ended(place, problem)
        except BaseException:  # an interrupt, a full disk
            stop_children()
            raise

    def _launched_by_hydra(self, jobs: Sequence[Sequence[str]]) -> list[str | None]:
        """Why each job failed, None = it did not. Some launchers raise at the first that fails, so what is said of the
        others may be wrong: their records tell."""
        assert self.launcher is not None
        try:
            returns = self.launcher.launch([list(job) for job in jobs], initial_job_idx=0)
        except Exception as error:  # a launcher's own: a worker that was killed
            return [first_line(error)] * len(jobs)
        return [str(one._return_value) if one.status is JobStatus.FAILED else None for one in returns]


class _Composer:
    """Overrides of a point -> its configuration; Hydra composes each choice of groups once, as it takes a tenth of a
    second."""

    def __init__(self, config: DictConfig, loader: Any, parser: OverridesParser) -> None:
        self._config, self._loader, self._parser = config, loader, parser
        self._groups = set(loader.list_groups(""))
        self._composed: dict[tuple[str, ...], DictConfig] = {}

    def __call__(self, overrides: Sequence[str]) -> Any:
        chosen = tuple(override for override in overrides if override.partition("=")[0] in self._groups)
        fields = [override for override in overrides if override not in chosen]
        if any(not override[0].isalpha() for override in fields):  # +field, ~field: only Hydra knows what they mean
            composed = type_configuration(self._loader.load_sweep_config(self._config, list(overrides)))
            return read_configuration(composed, known_kinds())
        if chosen not in self._composed:
            composed = type_configuration(self._loader.load_sweep_config(self._config, list(chosen)))
            composed.sweep.grids = {}  # of the sweep, not of a point; copying them takes time
            self._composed[chosen] = composed
        composed = deepcopy(self._composed[chosen])
        for override in self._parser.parse_overrides(fields):
            OmegaConf.update(composed, override.get_key_element(), override.value())
        return read_configuration(composed, known_kinds())
