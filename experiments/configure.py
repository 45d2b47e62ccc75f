"""A configuration composed without Hydra's command line, for verbs, notebooks and tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hydra import compose, initialize_config_dir

from experiments.harness.configuration import CONFIGURATION, Configuration, read_configuration
from experiments.registry import KINDS


def configure(overrides: Sequence[str], name: str = "config", folder: str | None = None) -> Configuration:
    """The configuration of these overrides, written as on the command line. name: of the file that it begins with.
    folder: with files of the user's own, as of --config-dir.

    Raises InputError, and errors of Hydra and OmegaConf, for what no point could use.
    """
    asked = list(overrides)
    if folder is not None:
        own = Path(folder).absolute().as_posix().replace("'", "\\'")
        asked.append(f"hydra.searchpath=['file://{own}']")
    with initialize_config_dir(str(CONFIGURATION), version_base="1.3"):
        return read_configuration(compose(name, asked), KINDS)
