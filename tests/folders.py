"""The folder of the project, the paper's scenes where a machine has them, and an empty cache of fetched scenes."""

import os
from pathlib import Path

import pytest

from scenes.directory import SCENES_VARIABLE, default_cache

ROOT = Path(__file__).resolve().parents[1]

NEEDS_SCENES = pytest.mark.skipif(not os.environ.get(SCENES_VARIABLE), reason=f"{SCENES_VARIABLE} is not set")

HOME_VARIABLES = ("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA")
"""What decides where the cache is, on one system or another."""


def empty_cache(home, monkeypatch):
    """Move the cache below the folder `home` and unset ATRA_SCENES. Returns the cache's path; it does not exist."""
    for variable in HOME_VARIABLES:
        monkeypatch.setenv(variable, str(home))
    monkeypatch.delenv(SCENES_VARIABLE, raising=False)
    assert default_cache().is_relative_to(home)
    return default_cache()
