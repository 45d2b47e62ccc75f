"""Hydra plugins of the experiments, which Hydra finds by their folder: the sweeper `points`, and the source of what is
typed: `schema`, and the options of each method and workload, which is imported only when it is chosen.

Hydra runs this file before it is a module, so annotations may not be put off here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.config_store import ConfigStore
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins
from hydra.experimental.callback import Callback
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf


@dataclass
class PointsSweeperConfig:
    """max_batch_size: processes of points a launcher is given at once; null = one, for submitit_slurm, which queues
    them, up to 1000. params: values to sweep in every grid."""

    _target_: str = f"{__name__}.PointsSweeper"
    max_batch_size: int | None = None
    params: dict[str, str] = field(default_factory=dict)


ConfigStore.instance().store(group="hydra/sweeper", name="points", node=PointsSweeperConfig, provider="atra")


class PointsSweeper(Sweeper):
    """Has all points of a sweep measured at once (`experiments.sweeper`)."""

    def __init__(self, max_batch_size: int | None, params: dict[str, str]) -> None:
        self._max_batch_size, self._params = max_batch_size, params

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        self.hydra_context, self.config = hydra_context, config
        self.launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments: Sequence[str]) -> Any:
        """The table of the sweep; as `experiments.sweep.run_sweep`."""
        from experiments.sweeper import GridSweep

        whole = GridSweep(self.config, self.hydra_context.config_loader, self.launcher, self._params)
        return whole.run(list(arguments), self._max_batch_size)


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
