"""The two arrays of an image: new ones, or those of an earlier result."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.errors import InputError


def outputs(
    shape: tuple[int, ...], row_stride: int, out: tuple[NDArray[np.float32], NDArray[np.uint32]] | None
) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """depth and prim_id to write to: `out`, or new ones. shape: (H, W), or (K, H, W) of several images.

    Raises InputError for an `out` that does not fit.
    """
    if out is None:
        return new_images(shape, row_stride)
    strides = (4 * row_stride * shape[-2], 4 * row_stride, 4)[-len(shape) :]
    # Rows of the right length in memory, not only in shape: packets may reach past the right border.
    for image, kind in zip(out, (np.float32, np.uint32), strict=True):
        if (image.dtype, image.shape, image.strides) != (kind, shape, strides) or not image.flags.writeable:
            given = f"{image.dtype} of {image.shape}, strides {image.strides}"
            raise InputError(
                f"out has an image of {given}{'' if image.flags.writeable else ', read-only'}, expected "
                f"{np.dtype(kind)} of {shape}, strides {strides}: pass a result of this tracer"
            )
    if np.may_share_memory(*out):
        raise InputError("out has one memory for depth and prim_id: pass a result of this tracer")
    return out


def images_of(out: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]] | None:
    """depth and prim_id of an earlier result; None of None. Raises InputError for what has no such arrays."""
    if out is None:
        return None
    images = getattr(out, "depth", None), getattr(out, "prim_id", None)
    if not all(isinstance(image, np.ndarray) for image in images):
        raise InputError(f"out is {out!r:.100}, expected a result of this tracer, or None")
    return images  # type: ignore[return-value]


def new_images(shape: tuple[int, ...], row_stride: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Uninitialised depth and prim_id of a shape, their rows `row_stride` pixels apart in memory."""
    *before, width = shape
    depth, prim_id = (aligned_empty((*before, row_stride), kind) for kind in (np.float32, np.uint32))
    return depth[..., :width], prim_id[..., :width]
