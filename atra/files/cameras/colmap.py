"""The cameras of a COLMAP model, text or binary."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from math import hypot
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.cameras.colmap_files import (
    Intrinsics,
    Pose,
    binary_cameras,
    binary_images,
    text_cameras,
    text_images,
)
from atra.files.cameras.entries import Broken, Cameras, Entries, allowance_of, entry, number, pixels
from atra.files.cameras.lens_models import sensor_of
from atra.geometry.calibration import pose_of
from atra.geometry.camera import CalibratedCamera, LensCamera, camera_of
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import Lens

UNIT_TOLERANCE = 1e-3
"""Largest distance of a quaternion's length from 1."""


def read_colmap(
    folder: str | PathLike[str], *, broken: Broken | None = None, memory_per_byte: float | None = None
) -> Cameras:
    """Read the cameras of a COLMAP model, by image name, in the order of `images.bin` or `images.txt`.

    folder: holds `cameras` and `images`, such as `sparse/0`; binary files go before text, as in COLMAP. Cameras
    with distortion have a lens; of COLMAP's models all are known but RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION,
    DIVISION and EUCM.
    broken: a dict that receives the InputError of each image that cannot be used, by name; None: the first is raised.
    memory_per_byte: bound on the memory that reading may take, as for `atra.load_mesh`.

    Raises InputError, naming file, entry and value, for files that are missing or cut short, broken entries, images
    without a camera, and unknown camera models; with `broken` only if a file or all images are unusable.
    Source: COLMAP's documentation, "Output Format".
    """
    folder = Path(folder)
    for suffix, read_cameras, read_images in (
        (".bin", binary_cameras, binary_images),
        (".txt", text_cameras, text_images),
    ):
        files = folder / f"cameras{suffix}", folder / f"images{suffix}"
        if all(path.is_file() for path in files):
            entries: Entries[CalibratedCamera | LensCamera] = Entries(
                files[1], "image", broken, allowance_of(memory_per_byte, *files)
            )
            return _read(files[0], read_cameras(files[0]), read_images(files[1]), entries)
    raise InputError(f"{folder} is no COLMAP model, expected cameras.bin and images.bin, or both as .txt, in it")


def _read(
    cameras_path: Path,
    given: Iterator[Intrinsics],
    images: Iterator[Pose],
    entries: Entries[CalibratedCamera | LensCamera],
) -> Cameras:
    intrinsics = {}
    for camera in given:
        if camera.camera_id in intrinsics:
            raise InputError(f"{cameras_path}: camera {camera.camera_id} is there twice")
        intrinsics[camera.camera_id] = camera

    @cache
    def sensor(camera_id: int) -> tuple[Lens, ImagePlane, int, int]:
        if camera_id not in intrinsics:
            raise InputError(f"its camera is {camera_id!r}, which is not in {cameras_path.name}")
        with entry(f"{cameras_path}, camera {camera_id}"):
            return _sensor(intrinsics[camera_id])

    def placed(image: Pose) -> CalibratedCamera | LensCamera:
        lens, plane, width, height = sensor(image.camera_id)
        translation = [number("a translation", value) for value in image.translation]
        eye, axes = pose_of(_rotation(image.quaternion), translation)
        return camera_of(lens, eye, axes, plane, width, height)

    for image in images:
        entries.add(image.name, f"image {image.image_id} ({image.name!r})", partial(placed, image))
    return entries.all()


def _sensor(camera: Intrinsics) -> tuple[Lens, ImagePlane, int, int]:
    """Lens, sensor, width and height."""
    plane, lens = sensor_of(camera.model, camera.parameters)
    return lens, plane, pixels("its width", camera.width), pixels("its height", camera.height)


def _rotation(quaternion: tuple[Any, ...]) -> NDArray[np.float64]:
    """The rotation (3, 3) float64 of a quaternion (w, x, y, z). Raises InputError if its length is not 1."""
    length = hypot(*(number("a part of its rotation", part) for part in quaternion))
    if not abs(length - 1.0) <= UNIT_TOLERANCE:
        raise InputError(f"its rotation {quaternion} has length {length:g}, expected a unit quaternion")
    w, x, y, z = (part / length for part in quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
