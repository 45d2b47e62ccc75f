"""The cameras of a `transforms.json`, the format of NeRF programs."""

from __future__ import annotations

from functools import partial
from math import pi, tan
from os import PathLike
from pathlib import Path
from typing import Any

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, Entries, allowance_of, distorted, number, pixels, read_json
from atra.geometry.calibration import image_plane_of_focals, pose_of_matrix
from atra.geometry.camera import CalibratedCamera

DISTORTION = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
"""Names of the distortion's coefficients."""

STRAIGHT = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "FULL_OPENCV")
"""Camera models that are a pinhole camera if all of `DISTORTION` are 0."""


def read_transforms(
    path: str | PathLike[str],
    size: tuple[int, int] | None = None,
    *,
    broken: Broken | None = None,
    memory_per_byte: float | None = None,
) -> Cameras:
    """Read the cameras of a `transforms.json` (Instant-NGP, Nerfstudio, Blender's synthetic scenes), by `file_path`.

    A frame, or else the file, has the size `w` and `h`; the focal lengths `fl_x` and `fl_y`, or the angles
    `camera_angle_x` and `camera_angle_y` in radians (pixels are square if one axis is missing); the principal point
    `cx` and `cy`, from the image's corner (default: its middle). `transform_matrix`: camera to world, OpenGL's axes.
    size: width and height of frames without them, as Blender writes them.
    broken: a dict that receives the InputError of each frame that cannot be used, by name; None: the first is raised.
    memory_per_byte: bound on the memory that reading may take, as for `atra.load_mesh`.

    Raises InputError, naming file, frame and value, for missing or broken values and lens distortion; with `broken`
    only if the file or all frames are unusable.
    """
    path = Path(path)
    shared = read_json(path)
    frames = shared.get("frames")
    if not isinstance(frames, list):
        raise InputError(f"{path} has no list of frames, expected a transforms.json")
    entries: Entries[CalibratedCamera] = Entries(path, "frame", broken, allowance_of(memory_per_byte, path))
    for index, frame in enumerate(frames):
        name = frame.get("file_path") if isinstance(frame, dict) else None
        place = f"frame {index}{f' ({name!r:.100})' if name is not None else ''}"
        entries.add(name, place, partial(_camera, name, shared, frame, size))
    return entries.all()


def _camera(name: Any, shared: dict[str, Any], frame: Any, size: tuple[int, int] | None) -> CalibratedCamera:
    if not isinstance(name, str) or not name:
        raise InputError("it has no file_path, expected the name of an image")
    given = {**shared, **frame}
    model = given.get("camera_model", STRAIGHT[0])
    if model not in STRAIGHT or given.get("is_fisheye"):
        raise distorted(f"the camera model is {'a fisheye' if given.get('is_fisheye') else repr(model)}")
    for name in DISTORTION:
        if number(name, given.get(name, 0.0)) != 0.0:
            raise distorted(f"{name} is {given[name]}")
    if size is None and not ("w" in given and "h" in given):
        raise InputError("the size of the image is missing, expected w and h; or give size=(width, height)")
    default_w, default_h = size or (None, None)
    width, height = pixels("w", given.get("w", default_w)), pixels("h", given.get("h", default_h))
    fx, fy = _focal(given, "x", width), _focal(given, "y", height)
    if fx is None and fy is None:
        raise InputError("the focal length is missing, expected fl_x or camera_angle_x")
    axis_x, axis_y = number("cx", given.get("cx", width / 2)), number("cy", given.get("cy", height / 2))
    plane = image_plane_of_focals(fx or fy or 0.0, fy or fx or 0.0, axis_x, axis_y)
    if "transform_matrix" not in given:
        raise InputError("it has no transform_matrix, expected (4, 4) numbers, camera to world")
    return CalibratedCamera.at(*pose_of_matrix(given["transform_matrix"], "opengl"), plane, width, height)


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
