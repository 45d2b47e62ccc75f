"""The cameras of a COLMAP model, text or binary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache, partial
from math import hypot
from os import PathLike
from pathlib import Path
from struct import Struct
from typing import Any

from atra.errors import InputError
from atra.files.cameras.entries import Broken, Cameras, entry, number, pixels, read_entries, read_file
from atra.files.cameras.lens_models import CAMERA_MODELS, sensor_of
from atra.geometry.calibration import pose_of, rotation_of_quaternion
from atra.geometry.camera import CalibratedCamera, LensCamera, camera_of
from atra.geometry.image_plane import ImagePlane
from atra.geometry.lenses.models import Lens

UNIT_TOLERANCE = 1e-3
"""Largest distance of a quaternion's length from 1."""

_TWO_LINES = "every image has two lines, the second of which may be empty"

_COUNT, _CAMERA, _IMAGE, _POINT_BYTES = Struct("<Q"), Struct("<IiQQ"), Struct("<I7dI"), 24

_Sensor = tuple[int, str, Any, Any, Sequence[Any]]
"""Number, model, width, height and parameters of a camera; what should be a number may be a word."""

_Image = tuple[Any, Sequence[Any], Any, str]
"""Number, pose, camera and name of an image. The pose: a quaternion (w, x, y, z) and a translation, world to camera in
OpenCV's axes. Numbers as for `_Sensor`."""


def read_colmap(
    folder: str | PathLike[str], *, broken: Broken | None = None, memory_per_byte: float | None = None
) -> Cameras:
    """Read the cameras of a COLMAP model, by image name, in the order of `images.bin` or `images.txt`.

    Parameters
    ----------
    folder : path
        Holds `cameras` and `images`, such as `sparse/0`; binary files go before text, as in COLMAP. Cameras with
        distortion have a lens; of COLMAP's models all are known but RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION,
        DIVISION and EUCM.
    broken : dict, optional
        Receives the InputError of each image that cannot be used, by name; None: the first is raised.
    memory_per_byte : float, optional
        Bound on the memory that reading may take, as for `atra.load_mesh`.

    Returns
    -------
    dict of CalibratedCamera and LensCamera

    Raises
    ------
    InputError
        Naming file, entry and value: files that are missing or cut short, broken entries, images without a camera,
        unknown camera models; with `broken` only if a file or all images are unusable.

    Notes
    -----
    Source: COLMAP's documentation, "Output Format".

    Examples
    --------
    >>> import atra
    >>> cameras = atra.read_colmap("sparse/0")  # doctest: +SKIP
    >>> sorted(cameras)[0]  # doctest: +SKIP
    'frame_0001.jpg'
    """
    pairs = ((Path(folder) / f"cameras{suffix}", Path(folder) / f"images{suffix}") for suffix in (".bin", ".txt"))
    files = next((pair for pair in pairs if all(path.is_file() for path in pair)), None)
    if files is None:
        raise InputError(f"{folder} is no COLMAP model, expected cameras.bin and images.bin, or both as .txt, in it")
    is_text = files[0].suffix == ".txt"
    sensors = dict[Any, _Sensor]()
    for one in (_text_sensors if is_text else _binary_sensors)(files[0]):
        if one[0] in sensors:
            raise InputError(f"{files[0]}: camera {one[0]} is there twice")
        sensors[one[0]] = one

    @cache
    def sensor(camera_id: Any) -> tuple[Lens, ImagePlane, int, int]:
        if camera_id not in sensors:
            raise InputError(f"its camera is {camera_id!r}, which is not in {files[0].name}")
        _, model, width, height, parameters = sensors[camera_id]
        with entry(f"{files[0]}, camera {camera_id}"):
            size = pixels("its width", width), pixels("its height", height)
            return *sensor_of(model, parameters), *size

    def placed(pose: Sequence[Any], camera_id: Any) -> CalibratedCamera | LensCamera:
        lens, plane, width, height = sensor(camera_id)
        translation = [number("a translation", value) for value in pose[4:]]
        quaternion = [number("a part of its rotation", part) for part in pose[:4]]
        length = hypot(*quaternion)
        if not abs(length - 1.0) <= UNIT_TOLERANCE:
            raise InputError(f"its rotation {tuple(pose[:4])} has length {length:g}, expected a unit quaternion")
        eye, axes = pose_of(rotation_of_quaternion(*(part / length for part in quaternion)), translation)
        return camera_of(lens, eye, axes, plane, width, height)

    images = (
        (name, f"image {image_id} ({name!r})", partial(placed, pose, camera_id))
        for image_id, pose, camera_id, name in (_text_images if is_text else _binary_images)(files[1])
    )
    return read_entries(files, "image", images, broken, memory_per_byte)


def _text_sensors(path: Path) -> Iterator[_Sensor]:
    """Read cameras.txt. Raises InputError naming the first line that is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]."""
    for line, words in _lines(path):
        where = f"{path}, line {line}"
        if words and len(words) < 4:
            raise InputError(f"{where} has {len(words)} words, expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]")
        if words:
            camera_id, width, height, *parameters = (_value(word) for word in (words[0], *words[2:]))
            if not isinstance(camera_id, int):
                raise InputError(f"{where} starts with {words[0]!r}, expected a whole number")
            yield camera_id, words[1], width, height, parameters


def _text_images(path: Path) -> Iterator[_Image]:
    """Read images.txt, two lines an image. Raises InputError naming the first line that does not fit its format."""
    is_points = False
    for line, words in _lines(path):
        where = f"{path}, line {line} has {len(words)} words, expected"
        if is_points and len(words) % 3:
            raise InputError(f"{where} X Y POINT3D_ID for every point of the image before; {_TWO_LINES}")
        if not is_points and words:
            if len(words) < 10:
                raise InputError(f"{where} IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; {_TWO_LINES}")
            image_id, *pose, camera_id = (_value(word) for word in words[:9])
            yield image_id, pose, camera_id, " ".join(words[9:])
        is_points = bool(words) and not is_points


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that is not a comment."""
    try:
        text = read_file(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no UTF-8 text: {error}") from None
    for count, line in enumerate(text.splitlines(), 1):
        if not line.lstrip().startswith("#"):
            yield count, line.split()


def _value(word: str) -> int | float | str:
    """A word as a number, or unchanged: its use refuses what should be a number."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word


def _binary_sensors(path: Path) -> Iterator[_Sensor]:
    """Read cameras.bin. Raises InputError naming the entry that has an unknown model or in which the file ends."""
    file, names = _Bytes(path), list(CAMERA_MODELS)
    for index in range(*file.take(_COUNT, "the number of cameras")):
        camera_id, model, width, height = file.take(_CAMERA, f"camera entry {index}")
        if not 0 <= model < len(names):
            raise InputError(f"{path}, camera {camera_id}: its model is number {model}, expected 0 to {len(names) - 1}")
        count = len(CAMERA_MODELS[names[model]].parameters.split())
        parameters = file.take(Struct(f"<{count}d"), f"camera {camera_id}")
        yield camera_id, names[model], width, height, parameters


def _binary_images(path: Path) -> Iterator[_Image]:
    """Read images.bin. Raises InputError naming the entry in which the file ends."""
    file = _Bytes(path)
    for index in range(*file.take(_COUNT, "the number of images")):
        image_id, *pose, camera_id = file.take(_IMAGE, f"image entry {index}")
        what = f"image {image_id}"
        length = (file.content.find(b"\0", file.at) + 1 or len(file.content) + 1) - file.at
        (name,) = file.take(Struct(f"{length}s"), what)
        (points,) = file.take(_COUNT, what)
        file.skip(points * _POINT_BYTES, what)
        try:
            yield image_id, pose, camera_id, name[:-1].decode("utf-8")
        except UnicodeDecodeError as error:
            raise InputError(f"{path}, {what}: its name is no UTF-8 text: {error}") from None


class _Bytes:
    """A file, read piece by piece; the error of a file that is cut short names `what` was being read."""

    def __init__(self, path: Path) -> None:
        self.path, self.content, self.at = path, read_file(path), 0

    def take(self, layout: Struct, what: str) -> tuple[Any, ...]:
        start = self.at
        self.skip(layout.size, what)
        return layout.unpack_from(self.content, start)

    def skip(self, size: int, what: str) -> None:
        if self.at + size > len(self.content):
            raise InputError(f"{self.path} ends in {what}, after {len(self.content)} bytes; is it cut off?")
        self.at += size
