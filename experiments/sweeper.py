"""The points of a sweep's grids, composed by Hydra, and the launcher that has them measured.

Hydra's own sweeper starts job after job and knows of no whole: no count, no restart, no table at the end.
"""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from itertools import product
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from atra.errors import InputError
from experiments.commands.program import COMMAND
from experiments.harness.configuration import Configuration, read_configuration
from experiments.harness.entry_points import name_of_file
from experiments.harness.points import GridPoint
from experiments.launched import launch_with
from experiments.registry import KINDS

_QUEUED_AT_ONCE = 1000
"""Jobs that Slurm's queue is given at once. It takes no longer arrays, unless it is told to."""

Job = tuple[str, ...]
"""What composes a point, as on the command line."""


class GridSweep:
    """The grids of a sweep, each crossed with `hydra.sweeper.params`; what the command line gives replaces both.

    loader, launcher: Hydra's.
    """

    def __init__(self, config: DictConfig, loader: Any, launcher: Any, params: Mapping[str, str]) -> None:
        self._config, self._loader, self._launcher, self._params = config, loader, launcher, params
        self._parser = OverridesParser.create(config_loader=loader)
        self._groups = set(loader.list_groups(""))
        self._composed: dict[Job, DictConfig] = {}

    def run(self, arguments: Sequence[str], max_batch_size: int | None) -> Any:
        """Compose every point of every grid, then have them measured.

        Hydra's default launcher is not asked: points run one by one here, as two at once would spoil each other's
        times. Any other launcher gets one job a process of a point, `max_batch_size` of them at once. Raises InputError
        for values that leave no point, and for an option that no point has or can be measured with.
        """
        from experiments.sweep import run_sweep

        grids = dict(self._config.sweep.grids or {"points": {}}) | self._methods_of_files(arguments)
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
        name = self._config.hydra.runtime.choices["hydra/launcher"]
        if name == "basic":
            return run_sweep(points, command=command)
        at_once = max_batch_size or (_QUEUED_AT_ONCE if name == "submitit_slurm" else 1)
        launch = launch_with(self._launcher, name == "submitit_slurm")
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
        files = self._config.method_file
        if not files or not self._config.sweep.grids or any(argument.startswith("method=") for argument in arguments):
            return {}
        from experiments.report.writing import GRID_OF_FILES

        return {GRID_OF_FILES: {"method": ",".join(map(name_of_file, files.split(os.pathsep)))}}

    def _where_they_fit(self, jobs: Sequence[Job], asked: set[str]) -> list[Job]:
        """The jobs without those options of the command line that their method or workload has not. An option that no
        job has stays, and is refused."""

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

    def _compose(self, job: Job) -> Configuration:
        """The configuration of a point."""
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
            composed = self._loader.load_sweep_config(self._config, list(job))
            composed.sweep.grids = {}  # of the sweep, not of a point; copying them takes time
            self._composed[job] = OmegaConf.masked_copy(composed, [name for name in composed if name != "hydra"])
        return self._composed[job]


def _written(override: Override) -> Iterator[str]:
    """The values of an override, each as on the command line. Raises InputError for a range without steps."""
    key = override.get_key_element()
    if not override.is_sweep_override():
        yield f"{key}={override.get_value_element_as_str()}"
    elif override.is_discrete_sweep():
        yield from (f"{key}={value}" for value in override.sweep_string_iterator())
    else:
        raise InputError(f"{key}={override.get_value_string()} is an interval, expected values, as in {key}=1,2,4")
