"""The cameras of a `transforms.json`, the format of NeRF programs."""

from __future__ import annotations

from functools import partial
from math import pi, tan
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, Entries, allowance_of, entry, number, pixels, read_json
from atra.files.cameras.lens_models import PANORAMA, model_of, panorama_plane
from atra.files.cameras.paths import as_transforms
from atra.geometry.calibration import image_plane_of_focals, pose_of_matrix
from atra.geometry.camera import CalibratedCamera, LensCamera, camera_of
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, Lens, OpenCVLens

_ALL = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
"""Names of the distortion's coefficients."""


def read_transforms(
    path: str | PathLike[str],
    size: tuple[int, int] | None = None,
    *,
    broken: Broken | None = None,
    memory_per_byte: float | None = None,
) -> Cameras:
    """Read the cameras of a `transforms.json` (Instant-NGP, Nerfstudio, Blender's synthetic scenes), by `file_path`.

    A `camera_path.json` of Nerfstudio and a `PinholeCameraTrajectory` of Open3D are read, too, by number.

    A frame, or else the file, has the size `w` and `h`; the focal lengths `fl_x` and `fl_y`, or the angles
    `camera_angle_x` and `camera_angle_y` in radians (pixels are square if one axis is missing); the principal point
    `cx` and `cy`, from the image's corner (default: its middle); a lens by `camera_model` (COLMAP's names, or
    EQUIRECTANGULAR) or `is_fisheye`, and `k1` to `k6`, `p1`, `p2`. `transform_matrix`: camera to world, OpenGL's axes.
    size: width and height of frames without them, as Blender writes them.
    broken: a dict that receives the InputError of each frame that cannot be used, by name; None: the first is raised.
    memory_per_byte: bound on the memory that reading may take, as for `atra.load_mesh`.

    Raises InputError, naming file, frame and value, for missing or broken values and unknown models; with `broken`
    only if the file or all frames are unusable.
    """
    path = Path(path)
    shared = as_transforms(read_json(path), path)
    frames = shared.get("frames")
    if not isinstance(frames, list):
        raise InputError(f"{path} has no list of frames, expected a transforms.json")
    entries: Entries[CalibratedCamera | LensCamera] = Entries(
        path, "frame", broken, allowance_of(memory_per_byte, path)
    )
    for index, frame in enumerate(frames):
        name = frame.get("file_path") if isinstance(frame, dict) else None
        place = f"frame {index}{f' ({name!r:.100})' if name is not None else ''}"
        entries.add(name, place, partial(_camera, name, shared, frame, size))
    return entries.all()


def _camera(
    name: Any, shared: dict[str, Any], frame: Any, size: tuple[int, int] | None
) -> CalibratedCamera | LensCamera:
    if not isinstance(name, str) or not name:
        raise InputError("it has no file_path, expected the name of an image")
    given = {**shared, **frame}
    if size is None and not ("w" in given and "h" in given):
        raise InputError("the size of the image is missing, expected w and h; or give size=(width, height)")
    default_w, default_h = size or (None, None)
    width, height = pixels("w", given.get("w", default_w)), pixels("h", given.get("h", default_h))
    if given.get("camera_model") == PANORAMA:
        return camera_of(EquirectangularLens(), *_pose(given), panorama_plane(width, height), width, height)
    fx, fy = _focal(given, "x", width), _focal(given, "y", height)
    if fx is None and fy is None:
        raise InputError("the focal length is missing, expected fl_x or camera_angle_x")
    axis_x, axis_y = number("cx", given.get("cx", width / 2)), number("cy", given.get("cy", height / 2))
    plane = image_plane_of_focals(fx or fy or 0.0, fy or fx or 0.0, axis_x, axis_y)
    return camera_of(_lens(given), *_pose(given), plane, width, height)


def _pose(given: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if "transform_matrix" not in given:
        raise InputError("it has no transform_matrix, expected (4, 4) numbers, camera to world")
    return pose_of_matrix(given["transform_matrix"], "opengl")


def _lens(given: dict[str, Any]) -> Lens:
    """The lens of a frame. Raises InputError for an unknown model, and coefficients that the model does not have."""
    told = {name: number(name, given.get(name, 0.0)) for name in _ALL}
    told = {name: value for name, value in told.items() if value != 0.0}
    name = "OPENCV_FISHEYE" if given.get("is_fisheye") else given.get("camera_model", "FULL_OPENCV")
    with entry("camera_model"):
        model = model_of(name)
    if model.lens not in (OpenCVLens, FisheyeLens):
        raise InputError(f"the camera model is {name}, whose parameters have no names in a transforms.json")
    # Programs write "OPENCV" for all that OpenCV's model has, but disagree about k4 and what follows.
    known = set(model.coefficients.split()) | ({"k3"} if name == "OPENCV" else set())
    for one in told:
        if one not in known:
            raise InputError(f"{one} is {told[one]:g}, but the camera model {name} has only {sorted(known)}")
    return model.lens(**told)


def _focal(given: dict[str, Any], axis: str, size: int) -> float | None:
    """The focal length along one axis in pixels, None = not given."""
    if f"fl_{axis}" in given:
        focal = number(f"fl_{axis}", given[f"fl_{axis}"])
        if focal <= 0.0:
            raise InputError(f"fl_{axis} is {focal:g}, expected a number of pixels above 0")
        return focal
    name = f"camera_angle_{axis}"
    if name not in given:
        return None
    angle = number(name, given[name])
    if not 0.0 < angle < pi:
        raise InputError(f"{name} is {angle:g}, expected radians between 0 and pi")
    return size / 2 / tan(angle / 2)
