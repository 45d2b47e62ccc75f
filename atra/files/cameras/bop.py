"""The cameras of a scene of a BOP dataset."""

from __future__ import annotations

from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, number, pixels, read_entries, read_json
from atra.geometry.camera import CalibratedCamera, Camera, LensCamera


def read_bop(
    path: str | PathLike[str],
    size: tuple[int, int] | None = None,
    *,
    broken: Broken | None = None,
    memory_per_byte: float | None = None,
) -> Cameras:
    """Read the cameras of a BOP dataset's `scene_camera.json`, by image number, in the order of the file.

    Poses are `cam_R_w2c` and `cam_t_w2c` in millimetres, as BOP's models; without them the world is the camera's.

    Parameters
    ----------
    path : path
    size : (int, int), optional
        Width and height of the images, pixels; None: of the dataset's `camera.json`, two or three folders up.
    broken, memory_per_byte : optional
        As for `read_colmap`.

    Returns
    -------
    dict of CalibratedCamera

    Raises
    ------
    InputError
        Naming file, image and value, for what is missing or broken.

    Notes
    -----
    Source: BOP toolkit, "Format of the BOP datasets".
    """
    path = Path(path)
    images, width, height = read_json(path), *(size or image_size(path))
    entries = (
        (name, f"image {name!r:.100}", partial(camera_of_image, given, width, height)) for name, given in images.items()
    )
    return read_entries((path,), "image", entries, broken, memory_per_byte)


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of the images of a scene, from the dataset's `camera.json`. Raises InputError for none."""
    for folder in path.resolve().parents[1:4]:
        if (folder / "camera.json").is_file():
            given = read_json(folder / "camera.json")
            return pixels("width of camera.json", given.get("width")), pixels("height", given.get("height"))
    raise InputError(f"{path}: the size of the images is missing, expected a camera.json above it; or give a size")


def camera_of_image(given: Any, width: int, height: int) -> CalibratedCamera | LensCamera:
    """The camera of an entry of `scene_camera.json`."""
    if not isinstance(given, dict) or "cam_K" not in given:
        raise InputError("it has no cam_K, expected nine numbers")
    R = matrix_of(given, "cam_R_w2c", 9).reshape(3, 3) if "cam_R_w2c" in given else np.eye(3)
    t = matrix_of(given, "cam_t_w2c", 3) if "cam_t_w2c" in given else np.zeros(3)
    return Camera.from_opencv(matrix_of(given, "cam_K", 9).reshape(3, 3), R, t, width, height)


def matrix_of(given: dict[str, Any], name: str, count: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The numbers of a list. Raises InputError, naming it, for another count or what is no number."""
    values = given.get(name)
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{name} is {values!r:.100}, expected {count} numbers")
    return np.array([number(f"a number of {name}", value) for value in values])
