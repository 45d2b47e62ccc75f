"""Cameras for `atra render`."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.cameras.bop import read_bop
from atra.files.cameras.calibration_files import read_calibration
from atra.files.cameras.colmap import read_colmap
from atra.files.cameras.entries import Broken, pixels, read_entries, read_json
from atra.files.cameras.nerf import read_transforms
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector, as_vector
from atra.geometry.view import View

_SIZE = ("width", "height")
_KINDS = (("eye", "target"), ("K", "R", "t"))
"""Required fields of a camera beside its size: of `atra.Camera`, or of an OpenCV calibration."""
_OPTIONAL = (("up", "fov_y_degrees"), ("distortion", "model"))
"""Optional fields of either."""


DIRECTIONS: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "front": ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "back": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "left": ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "right": ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    "top": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0)),
    "bottom": ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
}
"""Sides that a model is looked at from, with +y up and its front towards +z as in glTF: the way, and up."""

_LEAST_SHOWN = 0.1
"""Least share of what the best side shows that the usual view of a mesh must show."""

_MOST_LOOKED_AT = 100_000
"""Triangles that the choice of a side looks at; of larger meshes, every so many."""

_SIDE = 1024
"""Pixels along a side of a picture whose size nothing says."""


def chosen_cameras(given: Any, mesh: Mesh, own: Mapping[str, View], broken: Broken) -> dict[str, View]:
    """The cameras that `--camera` asks for, by name; without it the first of the mesh's file, or one that frames it.

    own: cameras of the mesh's file. Raises InputError for a camera that is not known, and as `read_cameras`.
    """
    size = None if given.size is None else tuple(given.size)
    width, height = size or (_SIDE, _SIDE)
    if given.camera is None and own:
        camera: Any = next(iter(own.values()))
        return {given.mesh.stem: camera if size is None else replace(camera, width=width, height=height)}
    if given.camera is None:
        return {given.mesh.stem: Camera.framing(mesh, shown_side(mesh), width=width, height=height)}
    if is_file_name(given.camera) and given.camera not in own:
        return read_cameras(Path(given.camera), size, broken, given.memory_per_byte)
    if given.camera in own:
        camera = own[given.camera]
        return {given.camera: camera if size is None else replace(camera, width=width, height=height)}
    if given.camera in DIRECTIONS:
        way, up = DIRECTIONS[given.camera]
        return {given.camera: Camera.framing(mesh, way, up=up, width=width, height=height)}
    names = ", ".join(map(repr, own)) or "none"
    raise InputError(
        f"the camera is {given.camera!r}, expected a file, one of {', '.join(DIRECTIONS)}, or a camera of "
        f"{given.mesh.name} ({names})"
    )


def shown_side(mesh: Mesh) -> Vector:
    """The direction of the view that frames a mesh: obliquely from the front and above, or, where hardly a front of a
    triangle is seen from there, as of a plane that faces away, from the side that shows most."""
    faces = mesh.faces[:: 1 + mesh.triangle_count // _MOST_LOOKED_AT]
    a, b, c = (mesh.vertices[faces[:, k]].astype(np.float64) for k in range(3))
    ways = np.array([(x, y, z) for z in (-1.0, 1.0) for y in (-0.4, 0.4) for x in (-0.5, 0.5)])
    ways = np.concatenate([ways, ways[:, [2, 1, 0]], ways[:, [0, 2, 1]]])
    shown = np.maximum(0.0, -np.cross(b - a, c - a) @ ways.T).sum(axis=0)
    return as_vector(ways[0] if shown[0] >= _LEAST_SHOWN * shown.max() else ways[shown.argmax()])


def one_camera(given: Any, mesh: Mesh, own: Mapping[str, View]) -> Camera:
    """The one pinhole camera that `--camera` asks for.

    Raises InputError for several cameras, for one of another kind, and as `chosen_cameras` does.
    """
    broken: Broken = {}
    found = chosen_cameras(Namespace(**{**vars(given), "size": None}), mesh, own, broken)
    if len(found) + len(broken) != 1:
        names = ", ".join(map(repr, [*found, *broken]))
        raise InputError(f"{given.camera} holds {len(found) + len(broken)} cameras ({names}), expected one")
    ((name, camera),) = found.items()
    if not isinstance(camera, Camera):
        raise InputError(f"camera {name!r} is a {type(camera).__name__}, expected one with a pinhole")
    return camera


def is_file_name(camera: str) -> bool:
    """Whether `--camera` names a file or folder, which need not exist."""
    return Path(camera).exists() or Path(camera).suffix.lower() in (".json", ".yaml", ".yml")


def read_cameras(
    path: Path, size: tuple[int, int] | None, broken: Broken, memory_per_byte: float | None = None
) -> dict[str, View]:
    """The cameras at `path` by name, in the order of the file.

    A folder is read as a COLMAP model, a JSON file with frames as a transforms.json, one with cam_K as a BOP scene's, a
    YAML file and one with camera_matrix as a calibration. Any other JSON file maps names to arguments of `atra.Camera`
    (eye, target, …) or of `atra.Camera.from_opencv` (K, R, t, …).
    size: width and height of cameras without them. broken: receives the errors of cameras that cannot be used, by name.
    memory_per_byte: as for `atra.load_mesh`. Raises InputError, naming the file, if no camera can be used.
    """
    if path.suffix.lower() in (".yaml", ".yml"):
        return dict(read_calibration(path, size))
    if path.is_dir():
        return dict(read_colmap(path, broken=broken, memory_per_byte=memory_per_byte))
    given = read_json(path)
    if "frames" in given:
        return dict(read_transforms(path, size, broken=broken, memory_per_byte=memory_per_byte))
    if any(isinstance(entry, dict) and "cam_K" in entry for entry in given.values()):
        return dict(read_bop(path, size, broken=broken, memory_per_byte=memory_per_byte))
    if "camera_matrix" in given or "distortion_model" in given:
        return dict(read_calibration(path, size))
    entries = ((name, f"camera {name!r:.100}", partial(_camera, fields, size)) for name, fields in given.items())
    return read_entries((path,), "camera", entries, broken, memory_per_byte)


def _camera(fields: Any, size: tuple[int, int] | None) -> View:
    told: dict[str, Any] = dict(zip(_SIZE, size or (), strict=False)) | (fields if isinstance(fields, dict) else {})
    kind = next((names for names in _KINDS if set(names) <= set(told)), None)
    if kind is None:
        raise InputError("it has neither eye and target nor K, R and t")
    for name in told:
        if name not in (*kind, *_SIZE, *_OPTIONAL[_KINDS.index(kind)]):
            raise InputError(f"its field {name!r} is unknown, expected {', '.join((*kind, *_SIZE))}")
    if not set(_SIZE) <= set(told):
        raise InputError("the size of the image is missing, expected width and height; or give --size 1920 1080")
    width, height = (pixels(name, told.pop(name)) for name in _SIZE)
    if kind is _KINDS[0]:
        return Camera(**told, width=width, height=height)
    return Camera.from_opencv(**told, width=width, height=height)
