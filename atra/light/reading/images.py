"""Images that a scene's file names."""

from __future__ import annotations

import io
from threading import Lock
from typing import Any

import numpy as np
import psutil
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.packed import KTX2, ktx2_texels
from atra.light.textures import CURVES

MOST_SIDE = 4096
"""Larger images are made smaller when they are read."""

MOST_PIXELS = 1 << 28
"""Most pixels of an image file: 16,384 x 16,384."""

_BYTES_PER_PIXEL = 9
"""Peak memory of reading a pixel of a large image."""

_ROWS_AT_ONCE = 64

_LIMIT = Lock()


def read_image(content: bytes, is_coded: bool) -> NDArray[np.uint8]:
    """(H, W, 3 or 4) uint8, read-only, of an image file of any format that Pillow reads, at most MOST_SIDE a side.

    is_coded: whether its colours are sRGB; they are averaged in linear light where it is made smaller. Raises
    InputError for damage, and for more than MOST_PIXELS or than fit the free memory.
    """
    from PIL import Image

    if content.startswith(KTX2):
        return _made_smaller(ktx2_texels(content), is_coded)
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
    return _made_smaller(texels, is_coded)


def _eight_bits(image: Any) -> NDArray[np.uint8]:
    if image.mode.startswith("I") or image.mode == "F":  # 16 bits of grey
        grey = np.asarray(image)
        most = 1.0 if image.mode == "F" else 65535.0
        eight = np.rint(np.clip(grey / most, 0.0, 1.0) * 255.0).astype(np.uint8)
        return np.repeat(eight[..., None], 3, axis=2)
    has_opacity = image.mode in ("RGBA", "LA", "PA", "La", "RGBa") or "transparency" in image.info
    return np.array(image.convert("RGBA" if has_opacity else "RGB"))


def _made_smaller(texels: NDArray[np.uint8], is_coded: bool) -> NDArray[np.uint8]:
    """Means of whole blocks, so that no side is longer than MOST_SIDE; read-only."""
    texels.setflags(write=False)
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
    out.setflags(write=False)
    return out
