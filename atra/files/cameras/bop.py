"""The cameras of a scene of a BOP dataset."""

from __future__ import annotations

from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, numbers, pixels, read_entries, read_json
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

    Examples
    --------
    >>> import atra
    >>> cameras = atra.read_bop("test/000001/scene_camera.json", size=(640, 480))  # doctest: +SKIP
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
    posed = {"cam_R_w2c": [1, 0, 0, 0, 1, 0, 0, 0, 1], "cam_t_w2c": [0, 0, 0], **given}
    K, R, t = (numbers(name, posed[name], count) for name, count in (("cam_K", 9), ("cam_R_w2c", 9), ("cam_t_w2c", 3)))
    return Camera.from_opencv(K.reshape(3, 3), R.reshape(3, 3), t, width, height)
