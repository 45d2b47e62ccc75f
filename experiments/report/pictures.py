"""Pictures of a scene, made small enough for a page without losing a single differing pixel from sight."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from atra.errors import InputError
from experiments.report.contents import ScenePictures
from experiments.report.embedding import data_uri, png_size

EDGE_PIXELS = 640
"""Longest edge of a picture in the page; larger ones are scaled down to it."""

_LOSSLESS_BYTES = 64_000
"""A lossless picture may take so much; a busier one is stored as lossy WebP, which shows no difference at this size."""


@dataclass(frozen=True)
class EmbeddedPictures:
    """A scene's pictures as data URIs.

    aligned: the picture from the aligned hits. overlay: transparent but for the pixels in which the per-pixel picture
    differs once scaled; laid over `aligned` it *is* the per-pixel picture, at a fraction of the bytes.
    width, height: of the originals; shown_width, shown_height: in the page, in pixels.
    lossy: whether `aligned` is stored with loss.
    """

    aligned: str
    overlay: str
    difference: str
    width: int
    height: int
    shown_width: int
    shown_height: int
    lossy: bool

    @property
    def scaled(self) -> bool:
        return (self.width, self.height) != (self.shown_width, self.shown_height)


def embed_pictures(pictures: ScenePictures) -> EmbeddedPictures | None:
    """None if the pictures are withheld or missing.

    Raises InputError if a picture cannot be read or the three differ in size.
    """
    if pictures.withheld is not None:
        return None
    if pictures.aligned is None or pictures.pixel is None or pictures.difference is None:
        return None
    aligned, pixel, difference = (
        _decode(content, f"{pictures.scene}, {name}")
        for content, name in (
            (pictures.aligned, "aligned"),
            (pictures.pixel, "per pixel"),
            (pictures.difference, "difference"),
        )
    )
    if not aligned.shape == pixel.shape == difference.shape:
        sizes = ", ".join(f"{image.shape[1]} x {image.shape[0]}" for image in (aligned, pixel, difference))
        raise InputError(f"pictures of {pictures.scene} measure {sizes}, expected one size for all three")
    height, width = aligned.shape[:2]
    scale = min(1.0, EDGE_PIXELS / max(width, height))
    shown_width, shown_height = max(1, round(width * scale)), max(1, round(height * scale))
    size = (shown_width, shown_height)
    small_aligned, small_pixel = _scale(aligned, size), _scale(pixel, size)
    content, lossy = _encode_photo(small_aligned)
    return EmbeddedPictures(
        aligned=data_uri(content, "image/webp"),
        overlay=data_uri(_encode(_overlay(small_aligned, small_pixel)), "image/webp"),
        difference=data_uri(_encode(_scale_difference(difference, size)), "image/webp"),
        width=width,
        height=height,
        shown_width=shown_width,
        shown_height=shown_height,
        lossy=lossy,
    )


def _decode(content: bytes, name: str) -> NDArray[np.uint8]:
    png_size(content, name)
    with Image.open(io.BytesIO(content)) as image:
        return np.asarray(image.convert("RGB"))


def _background(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The most frequent colour."""
    codes = (image.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)).ravel()
    found, counts = np.unique(codes, return_counts=True)
    code = int(found[counts.argmax()])
    return np.array([code >> 16, code >> 8 & 255, code & 255], np.uint8)


def _scale(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    # A box filter mixes only pixels under the new one, so that one differing pixel does not ring far around.
    scaled = (
        Image.fromarray(image)
        if image.shape[1::-1] == size
        else Image.fromarray(image).resize(size, Image.Resampling.BOX)
    )
    return np.asarray(scaled)


def _overlay(aligned: NDArray[np.uint8], pixel: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(H, W, 4): the pixels of `pixel` where it differs, transparent elsewhere."""
    overlay = np.zeros((*aligned.shape[:2], 4), np.uint8)
    differs = (aligned != pixel).any(axis=2)
    overlay[differs, :3] = pixel[differs]
    overlay[differs, 3] = 255
    return overlay


def _scale_difference(difference: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Scaled down, with every marked pixel as a full pixel of its own colour instead of a faint mixture.

    Marked is what is not background. The verdict that drew the picture decides alone: tones may differ by a rounding
    of depths where the hits are equal.
    """
    background = _background(difference)
    y, x = np.nonzero((difference != background).any(axis=2))
    scaled = np.empty((size[1], size[0], 3), np.uint8)
    scaled[:] = background
    scaled[y * size[1] // difference.shape[0], x * size[0] // difference.shape[1]] = difference[y, x]
    return scaled


def _encode_photo(image: NDArray[np.uint8]) -> tuple[bytes, bool]:
    """Content of a WebP and whether it is lossy."""
    lossless = _encode(image)
    if len(lossless) <= _LOSSLESS_BYTES:
        return lossless, False
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "WEBP", quality=90, method=4)
    return buffer.getvalue(), True


def _encode(image: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "WEBP", lossless=True, quality=80, method=4)
    return buffer.getvalue()
