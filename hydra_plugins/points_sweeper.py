"""Hydra plugin (found by its place in `hydra_plugins`): hands all points of a MULTIRUN to `experiments` at once.

Hydra's own sweeper starts job after job and knows of no whole: no count, no restart, no table at the end.
"""

# No postponed annotations: Hydra runs this module before listing it in sys.modules, where dataclass would look them up.
from dataclasses import dataclass, field
from typing import Any

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser


@dataclass
class PointsSweeperConfig:
    _target_: str = "hydra_plugins.points_sweeper.PointsSweeper"
    max_batch_size: int | None = None
    params: dict[str, str] | None = field(default_factory=dict)


ConfigStore.instance().store(group="hydra/sweeper", name="points", node=PointsSweeperConfig, provider="atra")


class PointsSweeper(BasicSweeper):
    """The grid of the sweep's parameters; those of the command line replace those of the sweep's file."""

    def sweep(self, arguments: list[str]) -> Any:
        """Compose every point of the grid, then measure them one after another.

        No launcher is asked: two points at once would spoil each other's times.
        """
        from experiments.configuration import read_configuration
        from experiments.sweep import run_sweep

        assert self.config is not None
        assert self.hydra_context is not None
        loader = self.hydra_context.config_loader
        # The later of two overrides of one key wins, hence the sweep's file first.
        overrides = OverridesParser.create(config_loader=loader).parse_overrides([*self._parse_config(), *arguments])
        (grid,) = self.split_arguments(overrides, max_batch_size=None)
        configurations = [read_configuration(loader.load_sweep_config(self.config, list(point))) for point in grid]
        return run_sweep(configurations)
