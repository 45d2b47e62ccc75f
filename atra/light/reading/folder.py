"""Files that a scene's file names, all within its folder, and images among them."""

from __future__ import annotations

import base64
import binascii
import io
from pathlib import Path
from threading import Lock
from typing import Any
from urllib.parse import unquote

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.reading import read_regular_file
from atra.light.textures import CURVES

MOST_SIDE = 4096
"""Larger images are made smaller when they are read."""

MOST_PIXELS = 1 << 28
"""Most pixels of an image file: 16,384 x 16,384."""

_BYTES_PER_PIXEL = 9
"""Peak memory of reading a pixel of a large image."""

_ROWS_AT_ONCE = 64

_LIMIT = Lock()


class OutsideError(InputError):
    """A file names another outside its folder."""


class Folder:
    """Reads what a scene's file names. Raises OutsideError for names that lead out of the file's folder."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent.resolve()

    def path_of(self, name: Any) -> Path:
        """The path of a file by its name, a relative URI or path."""
        if not isinstance(name, str) or not name or "\0" in name:
            raise InputError(f"it names the file {name!r:.100}, expected a relative path")
        plain = unquote(name).replace("\\", "/")
        found = (self._folder / plain).resolve()
        if ":" in plain.split("/")[0] or not found.is_relative_to(self._folder):
            raise OutsideError(f"it names {name!r:.100}, which is outside its folder; copy the file there")
        return found

    def read(self, name: Any) -> bytes:
        """The bytes of a file, or of a data URI."""
        if isinstance(name, str) and name.startswith("data:"):
            head, _, content = name.partition(",")
            try:
                return base64.b64decode(content) if head.endswith(";base64") else unquote(content).encode("latin-1")
            except (binascii.Error, ValueError) as error:
                raise InputError(f"a data URI is damaged: {error}") from None
        path = self.path_of(name)
        if not path.is_file():
            raise InputError(f"it names {name!r:.100}, which is no file")
        return read_regular_file(path)

    def size_of(self, name: Any) -> int:
        """Bytes of a file, 0 for one that is missing or a data URI."""
        if not isinstance(name, str) or name.startswith("data:"):
            return 0
        path = self.path_of(name)
        return path.stat().st_size if path.is_file() else 0


def read_image(content: bytes, is_coded: bool) -> NDArray[np.uint8]:
    """(H, W, 3 or 4) uint8, read-only, of an image file of any format that Pillow reads, at most MOST_SIDE a side.

    is_coded: whether its colours are sRGB; they are averaged in linear light where it is made smaller. Raises
    InputError for damage, and for more than MOST_PIXELS or than fit the free memory.
    """
    from PIL import Image

    try:
        with _LIMIT:  # Pillow's own limit is below 16k x 16k, and global
            usual, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, MOST_PIXELS
            try:
                image: Any = Image.open(io.BytesIO(content))
            finally:
                Image.MAX_IMAGE_PIXELS = usual
        pixels = image.width * image.height
        if pixels > MOST_PIXELS or pixels * _BYTES_PER_PIXEL > psutil.virtual_memory().available:
            raise InputError(f"an image has {image.width} x {image.height} pixels, too many to be read")
        texels = _eight_bits(image)
    except InputError:
        raise
    except Exception as error:  # Pillow raises many types for damage
        raise InputError(f"an image cannot be read: {error}") from None
    texels = _smaller(texels, is_coded)
    texels.setflags(write=False)
    return texels


def _eight_bits(image: Any) -> NDArray[np.uint8]:
    if image.mode.startswith("I") or image.mode == "F":  # 16 bits of grey
        grey = np.asarray(image)
        most = 1.0 if image.mode == "F" else 65535.0
        eight = np.rint(np.clip(grey / most, 0.0, 1.0) * 255.0).astype(np.uint8)
        return np.repeat(eight[..., None], 3, axis=2)
    has_opacity = image.mode in ("RGBA", "LA", "PA", "La", "RGBa") or "transparency" in image.info
    return np.array(image.convert("RGBA" if has_opacity else "RGB"))


def _smaller(texels: NDArray[np.uint8], is_coded: bool) -> NDArray[np.uint8]:
    """Means of whole blocks, so that no side is longer than MOST_SIDE."""
    rows, columns, channels = texels.shape
    block = -(-max(rows, columns) // MOST_SIDE)
    if block == 1:
        return texels
    out = np.empty((max(1, rows // block), max(1, columns // block), channels), np.uint8)
    across, down = min(block, columns), min(block, rows)
    for first in range(0, len(out), _ROWS_AT_ONCE):
        part = out[first : first + _ROWS_AT_ONCE]
        strip = texels[first * down : (first + len(part)) * down, : out.shape[1] * across]
        blocks = strip.reshape(len(part), down, out.shape[1], across, channels)
        for channel in range(channels):
            table = CURVES[int(is_coded and channel < 3)]
            mean = table[blocks[..., channel]].mean(axis=(1, 3))
            part[..., channel] = np.clip(np.searchsorted((table[1:] + table[:-1]) / 2.0, mean), 0, 255)
    return out
