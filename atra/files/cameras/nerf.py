"""The cameras of a `transforms.json`, the format of NeRF programs, and of paths of cameras in JSON."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from math import pi, radians, tan
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, entry, number, numbers, pixels, read_entries, read_json
from atra.files.cameras.lens_models import PANORAMA, model_of
from atra.geometry.calibration import PIXEL_CENTRE, image_plane_of_focals, pose_of_matrix
from atra.geometry.camera import CalibratedCamera, LensCamera, camera_of
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import EquirectangularLens, FisheyeLens, Lens, OpenCVLens

_ALL = ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2")
"""Names of the distortion's coefficients."""

_KINDS = {"perspective": {}, "equirectangular": {"camera_model": PANORAMA}}
"""What a `transforms.json` says for the camera types of Nerfstudio's `camera_path.json`."""

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenCV's axes in OpenGL's."""


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

    Parameters
    ----------
    path : path
    size : (int, int), optional
        Width and height, pixels, of frames without them, as Blender writes them.
    broken, memory_per_byte : optional
        As for `read_colmap`.

    Returns
    -------
    dict of CalibratedCamera and LensCamera

    Raises
    ------
    InputError
        Naming file, frame and value, for missing or broken values and unknown models; with `broken` only if the file
        or all frames are unusable.

    Examples
    --------
    >>> import atra
    >>> cameras = atra.read_transforms("transforms.json")  # doctest: +SKIP
    """
    path = Path(path)
    with entry(str(path)):
        shared = _as_transforms(read_json(path))
    frames = shared.get("frames")
    if not isinstance(frames, list):
        raise InputError(f"{path} has no list of frames, expected a transforms.json")

    def entries() -> Any:
        for index, frame in enumerate(frames):
            name = frame.get("file_path") if isinstance(frame, dict) else None
            place = f"frame {index}{f' ({name!r:.100})' if name is not None else ''}"
            yield name, place, partial(_camera, name, shared, frame, size)

    return read_entries((path,), "frame", entries(), broken, memory_per_byte)


def _as_transforms(found: dict[str, Any]) -> dict[str, Any]:
    """A path of cameras as the content of a `transforms.json`; what is neither is returned as it is.

    Raises InputError for other camera types.
    """
    if isinstance(found.get("camera_path"), list):
        kind = found.get("camera_type", "perspective")
        if not isinstance(kind, str) or kind not in _KINDS:
            raise InputError(f"its camera_type is {kind!r:.50}, expected one of {', '.join(_KINDS)}")
        shared = {ours: found[name] for ours, name in (("w", "render_width"), ("h", "render_height")) if name in found}
        return shared | _KINDS[kind] | {"frames": _frames(found["camera_path"], _nerfstudio_frame)}
    if found.get("class_name") == "PinholeCameraTrajectory" and isinstance(found.get("parameters"), list):
        return {"frames": _frames(found["parameters"], _open3d_frame)}
    return found


def _frames(given: list[Any], read: Callable[[Any], dict[str, Any]]) -> list[dict[str, Any]]:
    """Frames called by their numbers; one that is broken has no matrix, which is what its error says."""
    frames: list[dict[str, Any]] = [{"file_path": str(number)} for number in range(len(given))]
    for frame, one in zip(frames, given, strict=True):
        with suppress(InputError, LookupError, TypeError, ValueError):
            frame |= read(one)
    return frames


def _nerfstudio_frame(given: Any) -> dict[str, Any]:
    angle = {"camera_angle_y": radians(number("fov", given["fov"]))} if "fov" in given else {}
    return {"transform_matrix": numbers("camera_to_world", given["camera_to_world"], 16).reshape(4, 4), **angle}


def _open3d_frame(given: Any) -> dict[str, Any]:
    """Matrices stand column by column, and the principal point counts from the first pixel's centre."""
    sensor = given["intrinsic"]
    to_camera = numbers("extrinsic", given["extrinsic"], 16).reshape(4, 4).T
    fx, _, _, _, fy, _, cx, cy, _ = numbers("intrinsic_matrix", sensor["intrinsic_matrix"], 9).tolist()
    return {
        "transform_matrix": np.linalg.inv(to_camera) @ _FLIP, "w": sensor["width"], "h": sensor["height"],
        "fl_x": fx, "fl_y": fy, "cx": cx + PIXEL_CENTRE, "cy": cy + PIXEL_CENTRE,
    }  # fmt: skip


def _camera(
    name: Any, shared: dict[str, Any], frame: Any, size: tuple[int, int] | None
) -> CalibratedCamera | LensCamera:
    if not isinstance(name, str) or not name:
        raise InputError("it has no file_path, expected the name of an image")
    given = dict(zip("wh", size or (), strict=False)) | shared | frame
    if not ("w" in given and "h" in given):
        raise InputError("the size of the image is missing, expected w and h; or give size=(width, height)")
    width, height = pixels("w", given["w"]), pixels("h", given["h"])
    lens, plane = _sensor(given, width, height)
    if "transform_matrix" not in given:
        raise InputError("it has no transform_matrix, expected (4, 4) numbers, camera to world")
    return camera_of(lens, *pose_of_matrix(given["transform_matrix"], "opengl"), plane, width, height)


def _sensor(given: dict[str, Any], width: int, height: int) -> tuple[Lens, ImagePlane]:
    if given.get("camera_model") == PANORAMA:
        return EquirectangularLens(), ImagePlane.panoramic(width, height)
    both = _focal(given, "x", width), _focal(given, "y", height)
    focals = [one for one in both if one is not None]
    if not focals:
        raise InputError("the focal length is missing, expected fl_x or camera_angle_x")
    axis_x, axis_y = number("cx", given.get("cx", width / 2)), number("cy", given.get("cy", height / 2))
    return _lens(given), image_plane_of_focals(focals[0], focals[-1], axis_x, axis_y)


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
    known = {*model.coefficients, *(["k3"] if name == "OPENCV" else [])}
    for one in told:
        if one not in known:
            raise InputError(f"{one} is {told[one]:g}, but the camera model {name} has only {sorted(known)}")
    return model.lens(**told)


def _focal(given: dict[str, Any], axis: str, size: int) -> float | None:
    """The focal length along one axis in pixels, None = not given."""
    length, angle = f"fl_{axis}", f"camera_angle_{axis}"
    if length in given:
        return number(length, given[length])
    if angle not in given:
        return None
    found = number(angle, given[angle])
    if not 0.0 < found < pi:
        raise InputError(f"{angle} is {found:g}, expected radians between 0 and pi")
    return size / 2 / tan(found / 2)
