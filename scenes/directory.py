"""Scenes from the user's disk: a folder of PLY files with their cameras, or any one mesh file."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.mesh import Mesh, load_mesh

SCENES_VARIABLE = "ATRA_SCENES"
CAMERAS_FILE = "cameras.json"

_CAMERA_FIELDS = {"eye", "target", "up", "fov_y_degrees"}

# From the front, a little right and above: shows three sides of a box and looks along no coordinate plane.
_DEFAULT_DIRECTION = (0.5, 0.4, 1.0)
_DEFAULT_FOV_Y_DEGREES = 45.0


def load_scene_from_directory(name: str, directory: str | Path | None = None) -> tuple[Mesh, dict[str, Any]]:
    """Read `<directory>/<name>.ply` and the camera called `name` in `<directory>/cameras.json`.

    directory: the folder; None = the environment variable ATRA_SCENES. `~` is expanded, a relative path starts at the
    current working directory. cameras.json maps each scene name to eye, target and optionally up and fov_y_degrees.
    Returns the mesh, named `name`, and those fields of `atra.camera.Camera`.
    Raises InputError when the folder, the camera or the mesh is not there or cannot be read, naming what is.
    """
    folder = _folder(directory)
    fields = _camera_fields(folder / CAMERAS_FILE, name)
    path = folder / f"{name}.ply"
    if not path.is_file():
        raise InputError(f"{path} does not exist; {folder} holds {_listed(p.name for p in folder.glob('*.ply'))}")
    mesh = load_mesh(path)
    return Mesh(mesh.vertices, mesh.faces, name=name), fields


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


def _folder(directory: str | Path | None) -> Path:
    what = "the folder that holds cameras.json and the .ply files"
    source = "the scene folder"
    if directory is None:
        directory = os.environ.get(SCENES_VARIABLE, "")
        source = SCENES_VARIABLE
        if not directory:
            raise InputError(f"the environment variable {SCENES_VARIABLE} is not set; set it to {what}")
    folder = Path(directory).expanduser()
    if not folder.is_dir():
        raise InputError(f"{source} is {str(directory)!r}, which is not a folder; expected {what}")
    return folder


def _camera_fields(path: Path, name: str) -> dict[str, Any]:
    try:
        cameras = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path} does not exist, expected the cameras of the scenes in that folder") from None
    except (OSError, ValueError) as error:  # ValueError: broken JSON or bytes that are not UTF-8
        raise InputError(f"{path} cannot be read as JSON: {error}") from None
    if not isinstance(cameras, dict):
        raise InputError(f"{path} holds a {type(cameras).__name__}, expected an object: scene name -> camera fields")
    if name not in cameras:
        raise InputError(f"{path} has no camera for scene {name!r}; it has {_listed(cameras)}")
    fields = cameras[name]
    if not isinstance(fields, dict):
        raise InputError(f"{path}: the camera of {name!r} is {fields!r}, expected an object with eye and target")
    if not {"eye", "target"} <= fields.keys() <= _CAMERA_FIELDS:
        raise InputError(
            f"{path}: the camera of {name!r} has the fields {_listed(fields)}; "
            "expected eye and target, and optionally up and fov_y_degrees"
        )
    return {key: tuple(value) if isinstance(value, list) else value for key, value in fields.items()}


def _listed(names: Any) -> str:
    return ", ".join(sorted(names)) or "none"
