"""Paths of cameras in JSON: Nerfstudio's camera path and Open3D's trajectory, as a `transforms.json` has them."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.cameras.entries import entry, number

_KINDS = {"perspective": {}, "equirectangular": {"camera_model": "EQUIRECTANGULAR"}}
"""What a `transforms.json` says for the camera types of Nerfstudio."""

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenCV's axes in OpenGL's."""


def as_transforms(found: dict[str, Any], path: Path) -> dict[str, Any]:
    """A path of cameras as the content of a `transforms.json`; what is neither is returned as it is.

    A frame that is broken is kept, so that its own error names it. Raises InputError for other camera types.
    """
    with entry(str(path)):
        if isinstance(found.get("camera_path"), list):
            return _camera_path(found)
        if found.get("class_name") == "PinholeCameraTrajectory" and isinstance(found.get("parameters"), list):
            return {"frames": [_frame(k, one, _open3d_frame) for k, one in enumerate(found["parameters"])]}
    return found


def _camera_path(found: dict[str, Any]) -> dict[str, Any]:
    kind = found.get("camera_type", "perspective")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise InputError(f"its camera_type is {kind!r:.50}, expected one of {', '.join(_KINDS)}")
    shared = {ours: found[name] for ours, name in (("w", "render_width"), ("h", "render_height")) if name in found}
    return (
        shared | _KINDS[kind] | {"frames": [_frame(k, one, _nerf_frame) for k, one in enumerate(found["camera_path"])]}
    )


def _frame(k: int, given: Any, read: Any) -> dict[str, Any]:
    try:
        return {"file_path": str(k), **read(given)}
    except (InputError, LookupError, TypeError, ValueError):
        return {"file_path": str(k)}  # without a matrix, which is what its error says


def _nerf_frame(given: Any) -> dict[str, Any]:
    angle = {"camera_angle_y": radians(number("fov", given["fov"]))} if "fov" in given else {}
    return {"transform_matrix": _matrix(given["camera_to_world"], 4).tolist(), **angle}


def _open3d_frame(given: Any) -> dict[str, Any]:
    sensor, extrinsic = given["intrinsic"], _matrix(given["extrinsic"], 4).T
    K = open3d_matrix(sensor)
    return {
        "transform_matrix": (np.linalg.inv(extrinsic) @ _FLIP).tolist(), "w": sensor["width"], "h": sensor["height"],
        "fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2] + 0.5, "cy": K[1, 2] + 0.5,  # from the image's corner
    }  # fmt: skip


def open3d_matrix(sensor: dict[str, Any]) -> NDArray[np.float64]:
    """K (3, 3) of Open3D's `PinholeCameraIntrinsic`, whose numbers stand column by column."""
    return _matrix(sensor["intrinsic_matrix"], 3).T


def _matrix(given: Any, size: int) -> NDArray[np.float64]:
    flat = [value for row in given for value in (row if isinstance(row, list) else [row])]
    return np.array([number("a number of a matrix", value) for value in flat]).reshape(size, size)
