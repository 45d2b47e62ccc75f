"""`python run.py fetch scene=<name>`: brings a scene of the paper to this machine."""

from __future__ import annotations

from pathlib import Path

from atra.errors import InputError
from experiments.harness.configuration import Configuration
from scenes.built_in import BUILT_IN
from scenes.directory import SCENES_VARIABLE, default_cache, find_scene_folder
from scenes.fetch import fetch_scene
from scenes.loading import SceneSource, scene_is_available


def run_fetch(configuration: Configuration) -> Path | None:
    """Fetch `configuration.scene` into the cache, where every run finds it; print credits, path and what to run next.

    Always the cache, never the folder ATRA_SCENES names: that one is the user's, and may be shared or read-only. A
    scene that folder already holds would win over a fetched one, so nothing is fetched then.
    Returns the path of the mesh; None for a built-in scene, which needs no fetching.
    Raises InputError for scene=file, a scene nobody offers, and whatever `fetch_scene` finds wrong.
    """
    source, name = configuration.scene.source, configuration.scene.name
    if source is SceneSource.file:
        raise InputError("scene=file is read from scene.path, nothing can be fetched; name a scene: fetch scene=sponza")
    if name is None:
        raise InputError(f"a {source.value} scene needs scene.name")
    if source is SceneSource.procedural:
        if not scene_is_available(source, name):
            raise InputError(f"unknown procedural scene {name!r}, and none of that kind needs fetching")
        print(f"scene {name} is built in: nothing needs fetching")
        original = BUILT_IN[name].stands_for
        if original is not None:
            print(f"it stands in for {original}; to fetch that one: python run.py fetch scene={original}")
        _say_next(name)
        return None
    folder = find_scene_folder(name)
    if folder is not None and folder != default_cache():
        path = folder / f"{name}.ply"
        print(f"{path} is already there, in the folder {SCENES_VARIABLE} names: nothing was fetched")
        _say_next(name)
        return path
    path = fetch_scene(name)
    print(f"scene {name} is at {path}")
    _say_next(name)
    return path


def _say_next(name: str) -> None:
    print(f"next: python run.py scene={name}, or python run.py sweep=horizontal scene={name}")
