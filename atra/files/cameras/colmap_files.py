"""The entries of a COLMAP model's files of cameras and images, text and binary."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from struct import Struct
from typing import Any

from atra.errors import InputError
from atra.files.cameras.entries import read_file

MODELS = (
    ("SIMPLE_PINHOLE", 3), ("PINHOLE", 4), ("SIMPLE_RADIAL", 4), ("RADIAL", 5), ("OPENCV", 8), ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12), ("FOV", 5), ("SIMPLE_RADIAL_FISHEYE", 4), ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12), ("RAD_TAN_THIN_PRISM_FISHEYE", 16), ("SIMPLE_DIVISION", 4), ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3), ("FISHEYE", 4), ("EUCM", 6), ("EQUIRECTANGULAR", 2),
)  # fmt: skip
"""Name and parameter count of each camera model; binary files give its place here."""

_TWO_LINES = "every image has two lines, the second of which may be empty"

_COUNT, _CAMERA, _IMAGE, _POINT_BYTES = Struct("<Q"), Struct("<IiQQ"), Struct("<I7dI"), 24


@dataclass(frozen=True)
class Intrinsics:
    """An entry of `cameras`; what should be a number may be a word."""

    camera_id: int
    model: str
    width: Any
    height: Any
    parameters: tuple[Any, ...]


@dataclass(frozen=True)
class Pose:
    """An entry of `images`, world to camera in OpenCV's axes; quaternion: (w, x, y, z). Numbers as for `Intrinsics`."""

    image_id: Any
    quaternion: tuple[Any, ...]
    translation: tuple[Any, ...]
    camera_id: Any
    name: str


def text_cameras(path: Path) -> Iterator[Intrinsics]:
    """Read cameras.txt. Raises InputError naming the first line that is not CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]."""
    for line, words in _lines(path):
        where = f"{path}, line {line}"
        if len(words) < 4:
            raise InputError(f"{where} has {len(words)} words, expected CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]")
        camera_id, width, height, *parameters = (_value(word) for word in (words[0], *words[2:]))
        if not isinstance(camera_id, int):
            raise InputError(f"{where} starts with {words[0]!r}, expected a whole number")
        yield Intrinsics(camera_id, words[1], width, height, tuple(parameters))


def text_images(path: Path) -> Iterator[Pose]:
    """Read images.txt, two lines an image. Raises InputError naming the first line that does not fit its format."""
    is_points = False
    for line, words in _lines(path, keep_empty=True):
        where = f"{path}, line {line} has {len(words)} words, expected"
        if is_points and len(words) % 3:
            raise InputError(f"{where} X Y POINT3D_ID for every point of the image before; {_TWO_LINES}")
        if not is_points and words:
            if len(words) < 10:
                raise InputError(f"{where} IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME; {_TWO_LINES}")
            image_id, *parts, camera_id = (_value(word) for word in words[:9])
            yield Pose(image_id, tuple(parts[:4]), tuple(parts[4:]), camera_id, " ".join(words[9:]))
        is_points = bool(words) and not is_points


def binary_cameras(path: Path) -> Iterator[Intrinsics]:
    """Read cameras.bin. Raises InputError naming the entry that has an unknown model or in which the file ends."""
    file = _Bytes(path)
    for index in range(file.count("cameras")):
        camera_id, model, width, height = file.take(_CAMERA, f"camera entry {index}")
        if not 0 <= model < len(MODELS):
            raise InputError(
                f"{path}, camera {camera_id}: its model is number {model}, expected 0 to {len(MODELS) - 1}"
            )
        name, count = MODELS[model]
        yield Intrinsics(camera_id, name, width, height, file.take(Struct(f"<{count}d"), f"camera {camera_id}"))


def binary_images(path: Path) -> Iterator[Pose]:
    """Read images.bin. Raises InputError naming the entry in which the file ends."""
    file = _Bytes(path)
    for index in range(file.count("images")):
        image_id, *parts, camera_id = file.take(_IMAGE, f"image entry {index}")
        name = file.take_name(f"image {image_id}")
        (points,) = file.take(_COUNT, f"image {image_id}")
        file.skip(points * _POINT_BYTES, f"image {image_id}")
        yield Pose(image_id, tuple(parts[:4]), tuple(parts[4:]), camera_id, name)


class _Bytes:
    """A file, read piece by piece; the error of a file that is cut short names `what` was being read."""

    def __init__(self, path: Path) -> None:
        self._path, self._bytes, self._at = path, read_file(path), 0

    def count(self, what: str) -> int:
        return int(self.take(_COUNT, f"the number of {what}")[0])

    def take(self, layout: Struct, what: str) -> tuple[Any, ...]:
        start = self._at
        self.skip(layout.size, what)
        return layout.unpack_from(self._bytes, start)

    def take_name(self, what: str) -> str:
        end = self._bytes.find(b"\0", self._at)
        start = self._at
        self.skip((end if end >= 0 else len(self._bytes)) + 1 - start, what)
        try:
            return self._bytes[start:end].decode("utf-8")
        except UnicodeDecodeError as error:
            raise InputError(f"{self._path}, {what}: its name is no UTF-8 text: {error}") from None

    def skip(self, size: int, what: str) -> None:
        if self._at + size > len(self._bytes):
            raise InputError(f"{self._path} ends in {what}, after {len(self._bytes)} bytes; is it cut off?")
        self._at += size


def _lines(path: Path, keep_empty: bool = False) -> Iterator[tuple[int, list[str]]]:
    """Number and words of each line that is not a comment."""
    try:
        text = read_file(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no UTF-8 text: {error}") from None
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if (words or keep_empty) and not line.lstrip().startswith("#"):
            yield number, words


def _value(word: str) -> int | float | str:
    """A word as a number, or unchanged: its use refuses what should be a number."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word
