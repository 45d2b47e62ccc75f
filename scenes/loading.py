"""Scenes as a configuration names them: built in, in a folder, or a file."""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum
from typing import Protocol

from atra.errors import InputError
from scenes.built_in import BUILT_IN, make_scene, stand_in_for
from scenes.directory import find_scene_folder, load_scene_from_directory, load_scene_from_file
from scenes.scene import Scene


class SceneSource(Enum):
    """procedural = made by code; directory = the one named by ATRA_SCENES, or the cache of fetched
    scenes; file = the user's own."""

    procedural = "procedural"
    directory = "directory"
    file = "file"


class NamedScene(Protocol):
    """A scene as a configuration names it."""

    name: str | None
    source: SceneSource


def load_scene(source: SceneSource, name: str | None, path: str | None) -> Scene:
    """Raises InputError for an unknown name, a scene that is in no folder, a wrong ATRA_SCENES, a file that cannot be
    used."""
    if source is SceneSource.file:
        if path is None:
            raise InputError("scene=file needs scene.path, for example scene.path=model.ply")
        return load_scene_from_file(path)
    if name is None:
        raise InputError(f"a {source.value} scene needs scene.name")
    return make_scene(name) if source is SceneSource.procedural else load_scene_from_directory(name)


def scene_is_available(source: SceneSource, name: str | None) -> bool:
    """Whether `load_scene` would find this scene; nothing is loaded, so its file may still prove unusable.

    True for every scene=file: its path is the user's word, and loading says what is wrong with it.
    Raises InputError when ATRA_SCENES names no folder: that is a mistake to mend, not a scene to do without.
    """
    if source is SceneSource.file:
        return True
    if name is None:
        return False
    return name in BUILT_IN if source is SceneSource.procedural else find_scene_folder(name) is not None


def replace_missing_scenes(scenes: Iterable[NamedScene]) -> list[str]:
    """Put its stand-in in place of each of the paper's scenes that is not on this machine; other scenes stay.

    Changes the configurations given, where a scene may come many times. Returns one note for people per scene replaced.
    """
    notes: dict[str, str] = {}
    for scene in scenes:
        stand_in = stand_in_for(scene.name)
        if stand_in is not None and not scene_is_available(scene.source, scene.name):
            notes[str(scene.name)] = f"{scene.name} is not on this machine; {stand_in}, its stand-in, is not that scene"
            scene.name, scene.source = stand_in, SceneSource.procedural
    return list(notes.values())
