"""What `manifest.toml` says of the paper's scenes, as typed values."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from atra.errors import InputError
from atra.whole_numbers import is_whole_number
from scenes.scene import camera_fields

MANIFEST_FILE = Path(__file__).with_name("manifest.toml")


@dataclass(frozen=True)
class FetchableScene:
    """Where one scene of the paper comes from and how to know that it is the right one.

    archive: path of the zip below the manifest's base_url; archive_bytes: its size; sha256: its hash, lower case.
    member: the name of the mesh file inside. triangles: what it must hold.
    camera: as of `scenes.scene.Scene`; camera_source: whose it is.
    notice: a restriction of the author's to be shown whenever the scene is fetched, None = none beyond the licence.
    pictures_may_be_passed_on: false = pictures of the scene stay with whoever made them, as the notice asks.
    Raises InputError for a field that cannot be meant.
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
        for name in ("triangles", "archive_bytes"):
            if not is_whole_number(getattr(self, name)) or getattr(self, name) < 1:
                raise InputError(f"scene {self.name!r} has {name} = {getattr(self, name)!r}, expected at least 1")
        if not re.fullmatch(r"[0-9a-f]{64}", self.sha256):
            raise InputError(f"scene {self.name!r} has the sha256 {self.sha256!r}, expected 64 lower-case hex digits")
        object.__setattr__(self, "camera", camera_fields(f"the camera of scene {self.name!r}", self.camera))
        allowed = self.pictures_may_be_passed_on
        if not isinstance(allowed, bool):  # the words "false" and "no" would both count as true
            raise InputError(f"scene {self.name!r} has pictures_may_be_passed_on = {allowed!r}, expected true or false")
        if not allowed and self.notice is None:
            raise InputError(f"pictures of scene {self.name!r} may not be passed on, but no notice says why")


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
    """Read a manifest. Raises InputError naming the file when a field is missing, unknown or cannot be meant."""
    try:
        told = tomllib.loads(path.read_text(encoding="utf-8"))
        scenes = {name: FetchableScene(name=name, **fields) for name, fields in told["scenes"].items()}
        return Manifest(home=told["home"], base_url=told["base_url"], scenes=scenes)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as a scene manifest: {error}") from None


def picture_restriction(name: str) -> str | None:
    """Why no picture of the scene called `name` may be published, as one sentence; None = nothing known against it.

    A scene that is not in the manifest, such as a file of the user's own, is theirs to judge.
    """
    source = read_manifest().scenes.get(name)
    if source is None or source.pictures_may_be_passed_on:
        return None
    return f"The copyright note of {source.title} ({name}) does not allow pictures of it to be passed on."
