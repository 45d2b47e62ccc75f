"""Scenes from the user's disk: folders of PLY files with their cameras, and any one mesh file."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.files.reading import parse_json, read_regular_file
from atra.geometry.mesh import Mesh
from scenes.built_in import stand_in_for
from scenes.manifest import picture_restriction, read_manifest
from scenes.scene import Scene, camera_fields

SCENES_VARIABLE = "ATRA_SCENES"
CAMERAS_FILE = "cameras.json"

PAPER_SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")
"""The scenes of the paper, in its order."""

# From the front, a little right and above: shows three sides of a box and looks along no coordinate plane.
_DEFAULT_DIRECTION = (0.5, 0.4, 1.0)
_DEFAULT_FOV_Y_DEGREES = 45.0


def expand_home(path: str) -> Path:
    """`path` with `~` expanded. For a user without a home folder, as in some containers, `~` is the system's folder for
    temporary files."""
    expanded = os.path.expanduser(path)
    return Path(tempfile.gettempdir(), expanded[2:]) if expanded.startswith("~/") else Path(expanded)


def default_cache() -> Path:
    """The folder scenes are fetched into: `atra/scenes` in the user's cache folder of this operating system."""
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA") or "~/AppData/Local"
    elif sys.platform == "darwin":
        base = "~/Library/Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return expand_home(base) / "atra" / "scenes"


def load_scene_from_directory(name: str, directory: str | Path | None = None) -> Scene:
    """Read `<directory>/<name>.ply` and the camera called `name` in `<directory>/cameras.json`.

    directory: the folder; None = `find_scene_folder`. `~` is expanded, a relative path starts at the current working
    directory. cameras.json maps each scene name to eye, target and optionally up and fov_y_degrees.
    Raises InputError when the folder, the camera or the mesh is not there or cannot be read, naming what is; if the
    scene is in no folder, how to get it or do without.
    """
    folder = find_scene_folder(name) if directory is None else _checked_folder("the scene folder", directory)
    if folder is None:
        raise InputError(_absence(name))
    fields = _camera_fields(folder / CAMERAS_FILE, name)
    path = folder / f"{name}.ply"
    if not path.is_file():
        raise InputError(f"{path} does not exist; {folder} holds {meshes_of(folder)}")
    mesh = load_mesh(path)
    named = Mesh(mesh.vertices, mesh.faces, name=name)
    return Scene(name, named, fields, picture_restriction=picture_restriction(name))


def load_scene_from_file(path: str | Path) -> Scene:
    """Any mesh file, framed by `default_camera_fields`. Raises InputError as `load_mesh`."""
    mesh = load_mesh(path)
    return Scene(mesh.name, mesh, default_camera_fields(mesh))


def find_scene_folder(name: str) -> Path | None:
    """The folder that holds `<name>.ply`: the one ATRA_SCENES names, else `default_cache()`; None = neither.

    Nothing is read: the mesh may prove unusable, its camera missing.
    Raises InputError if ATRA_SCENES is set and names no folder: a mistyped path must not lead to another file.
    """
    return next((folder for folder in scene_folders() if (folder / f"{name}.ply").is_file()), None)


def default_camera_fields(mesh: Mesh) -> dict[str, Any]:
    """Camera fields that frame the bounding box of a y-up mesh from the front, a little right and above.

    The box's sphere fits the height of the image, and its width if the image is not taller than wide.
    """
    low, high = mesh.bounds
    centre = (low + high) / 2.0
    radius = float(np.linalg.norm(high - low)) / 2.0 or 1.0  # all vertices in one point: any distance will do
    direction = np.array(_DEFAULT_DIRECTION) / np.linalg.norm(_DEFAULT_DIRECTION)
    distance = 1.05 * radius / np.sin(np.radians(_DEFAULT_FOV_Y_DEGREES) / 2.0)
    return {
        "eye": tuple((centre + distance * direction).tolist()),
        "target": tuple(centre.tolist()),
        "up": (0.0, 1.0, 0.0),
        "fov_y_degrees": _DEFAULT_FOV_Y_DEGREES,
    }


def scene_folders() -> list[Path]:
    """Where scenes are looked for, in this order: the folder ATRA_SCENES names, if any, and `default_cache()`.

    Raises InputError if ATRA_SCENES is set and names no folder.
    """
    named = os.environ.get(SCENES_VARIABLE)
    return [*([_checked_folder(SCENES_VARIABLE, named)] if named else []), default_cache()]


def _checked_folder(source: str, directory: str | Path) -> Path:
    folder = Path(directory).expanduser()
    if not folder.is_dir():
        raise InputError(
            f"{source} is {str(directory)!r}, which is not a folder; "
            "expected the folder that holds cameras.json and the .ply files"
        )
    return folder


def _absence(name: str) -> str:
    """In which folders the scene is not, and the ways out there are for it."""
    *named, cache = scene_folders()
    looked = f"the environment variable {SCENES_VARIABLE} is not set"
    if named:
        looked = f"{SCENES_VARIABLE} is {named[0]}, which holds {meshes_of(named[0])}"
    ways = [f"set {SCENES_VARIABLE} to the folder that holds {name}.ply and {CAMERAS_FILE}"]
    if name in read_manifest().scenes:
        ways.append(f"run: python run.py fetch scene={name} (needs the extra: pip install 'atra[fetch]')")
    stand_in = stand_in_for(name)
    if stand_in is not None:
        ways.append(f"use the built-in stand-in scene={stand_in}, which has as many triangles but is not that scene")
    held = f"the cache {cache} holds {meshes_of(cache)}"
    return f"scene {name!r} was not found: {looked}, and {held}. Ways out: {'; or '.join(ways)}"


def read_cameras(path: Path) -> dict[str, Any]:
    """Scene name -> camera fields. Raises InputError, naming the file, for anything else."""
    try:
        cameras = parse_json(read_regular_file(path))
    except FileNotFoundError:
        raise InputError(f"{path} does not exist, expected the cameras of the scenes in that folder") from None
    except (OSError, InputError) as error:
        raise InputError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(cameras, dict):
        raise InputError(f"{path} holds a {type(cameras).__name__}, expected an object: scene name -> camera fields")
    return cameras


def _camera_fields(path: Path, name: str) -> dict[str, Any]:
    cameras = read_cameras(path)
    if name not in cameras:
        raise InputError(f"{path} has no camera for scene {name!r}; it has {', '.join(sorted(cameras)) or 'none'}")
    fields = cameras[name]
    if not isinstance(fields, dict):
        raise InputError(
            f"{path}: the camera of {name!r} is {str(fields)[:100]}, expected an object with eye and target"
        )
    return camera_fields(f"{path}: the camera of {name!r}", fields)


def meshes_of(folder: Path) -> str:
    """The names of the meshes in `folder`, or that there is none, for people."""
    return ", ".join(sorted(path.name for path in folder.glob("*.ply"))) or "no .ply file"
