"""Pictures as files: PNG for viewing, EXR with layers for further work."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.saving import check_package, encode_exr, encode_png
from atra.hits import Hits
from atra.light.pictures.files_kernels import encode_srgb
from atra.light.pictures.finish.tone import stops_of, toned

SUFFIXES = (".png", ".exr")

_LEAST_ALPHA = np.float32(1e-3)
"""Pixels of less alpha keep their darkness in a PNG, whose colours are not multiplied by alpha."""


def check_picture_path(path: Path) -> str:
    """The suffix of a picture's file. Raises InputError for others than .png and .exr, and for an EXR without the
    package OpenEXR."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"a picture is to be written to {str(path)!r}, expected a name that ends in .png or .exr")
    if suffix == ".exr":
        check_package(suffix)
    return suffix


def srgb_of(image: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear RGB -> 8-bit sRGB (IEC 61966-2-1); values above 1 become white."""
    levels = np.empty(image.shape, np.uint8)
    encode_srgb(np.ascontiguousarray(image).reshape(-1), levels.reshape(-1))
    return levels


def png_of(image: NDArray[np.floating], alpha: NDArray[np.floating] | None = None) -> bytes:
    """(H, W, 3) linear RGB, not multiplied by alpha, and (H, W) alpha -> a PNG in sRGB."""
    levels = srgb_of(image)
    if alpha is None:
        return encode_png(levels)
    return encode_png(np.dstack([levels, np.rint(np.clip(alpha, 0.0, 1.0) * 255.0).astype(np.uint8)]))


def shown_png(
    image: NDArray[np.float32], alpha: NDArray[np.float32] | None, exposure: float | str, tone: str
) -> tuple[bytes, float]:
    """A PNG of a linear picture, multiplied by alpha where it has one, and its exposure in stops. exposure, tone: of
    `tone`, which raises InputError."""
    if alpha is not None:
        image = (image / np.maximum(alpha, _LEAST_ALPHA)[..., None]).astype(np.float32)
    stops = stops_of(image, exposure)
    return png_of(toned(image, stops, tone), alpha), stops


def exr_of(
    image: NDArray[np.float32], hits: Hits, albedo: NDArray[np.float32], samples: int,
    noisy: NDArray[np.float32] | None = None, alpha: NDArray[np.float32] | None = None,
) -> bytes:  # fmt: skip
    """An EXR of 32 bits, linear: R, G, B; albedo.R, G, B, 1 for the sky; Z, the depth, inf = a miss; N.X, N.Y, N.Z, the
    triangle's unit normal in the world, facing the eye, 0 = a miss; prim_id, `MISS` = a miss; samples.

    hits: at the pixels' centres. noisy: the picture before it was denoised, written as noisy.R, G, B. alpha: written as
    A; R, G, B are multiplied by it.
    """
    channels: dict[str, Any] = {}
    layers = {"": (image, "RGB"), "albedo.": (albedo, "RGB"), "N.": (_eye_normals(hits), "XYZ")}
    if noisy is not None:
        layers["noisy."] = noisy, "RGB"
    for layer, (values, names) in layers.items():
        channels |= {f"{layer}{name}": values[..., k] for k, name in enumerate(names)}
    if alpha is not None:
        channels["A"] = alpha
    counts = np.full(hits.depth.shape, samples, np.uint32)
    return encode_exr(channels | {"Z": hits.depth, "prim_id": hits.prim_id, "samples": counts})


def _eye_normals(hits: Hits) -> NDArray[np.float32]:
    """(H, W, 3) float32, unit normals of the hit triangles in the world, facing the eye; 0 = a miss."""
    normals = np.zeros((*hits.depth.shape, 3), np.float32)
    y, x = np.nonzero(hits.hit)
    corners = hits.mesh.triangles(hits.prim_id[y, x])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    across /= np.where(length > 0.0, length, 1.0)
    _, directions = hits.camera.rays(x, y, hits.offset)
    away = np.einsum("ni,ni->n", across, directions @ hits.camera.axes) > 0.0
    normals[y, x] = np.where(away[:, None], -across, across)
    return normals
