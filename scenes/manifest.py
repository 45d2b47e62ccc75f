"""What `manifest.toml` says of the paper's scenes, as typed values."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from atra.errors import InputError
from scenes.scene import camera_fields

MANIFEST_FILE = Path(__file__).with_name("manifest.toml")


@dataclass(frozen=True)
class FetchableScene:
    """Where one scene of the paper comes from and how to know that it is the right one.

    archive: path of the zip below the manifest's base_url; archive_bytes: its size; sha256: its hash, lower case.
    member: the name of the mesh file inside. triangles: what it must hold.
    camera: as of `scenes.scene.Scene`; camera_source: whose it is.
    notice: a restriction of the author's to be shown whenever the scene is fetched, None = none beyond the licence.
    pictures_may_be_passed_on: false = pictures of the scene must not be published, as the notice asks.
    Raises InputError for a camera that cannot be meant.
    """

    name: str
    title: str
    author: str
    licence: str
    archive: str
    archive_bytes: int
    sha256: str
    member: str
    triangles: int
    camera: dict[str, Any]
    camera_source: str
    notice: str | None = None
    pictures_may_be_passed_on: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "camera", camera_fields(f"the camera of scene {self.name!r}", self.camera))


@dataclass(frozen=True)
class Manifest:
    """home: page for people. base_url: start of every archive's address. scenes: by name."""

    home: str
    base_url: str
    scenes: dict[str, FetchableScene]

    def scene(self, name: str) -> FetchableScene:
        """The scene called `name`; InputError with the known names if there is none."""
        if name not in self.scenes:
            raise InputError(f"no scene {name!r} can be fetched, expected one of {', '.join(sorted(self.scenes))}")
        return self.scenes[name]


def read_manifest(path: Path = MANIFEST_FILE) -> Manifest:
    """The manifest of this folder, or another one."""
    told = tomllib.loads(path.read_text(encoding="utf-8"))
    scenes = {name: FetchableScene(name=name, **fields) for name, fields in told["scenes"].items()}
    return Manifest(home=told["home"], base_url=told["base_url"], scenes=scenes)


def picture_restriction(name: str) -> str | None:
    """Why no picture of the scene called `name` may be published, as one sentence; None = nothing known against it.

    A scene that is not in the manifest, such as a file of the user's own, is theirs to judge.
    """
    source = read_manifest().scenes.get(name)
    if source is None or source.pictures_may_be_passed_on:
        return None
    return f"The copyright note of {source.title} ({name}) does not allow pictures of it to be passed on."
