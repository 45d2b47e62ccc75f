"""Pictures as files: PNG for viewing, EXR for further work."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.files.saving import encode_exr
from atra.hits import Hits
from atra.light.pictures.files_kernels import encode_srgb

SUFFIXES = (".png", ".exr")


def save_picture(path: Path, image: NDArray[np.float32], hits: Callable[[], Hits]) -> None:
    """Write an (H, W, 3) picture, linear RGB, in the format of the suffix. hits: called for what an EXR holds as well.

    Raises InputError as `check_picture_path` does; StorageError.
    """
    check_picture_path(path)
    write_atomically(path, png_of(image) if path.suffix.lower() == ".png" else exr_of(image, hits()))


def check_picture_path(path: Path) -> None:
    """Raise InputError for a suffix other than .png and .exr, and for an EXR without the package OpenEXR."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"a picture is to be written to {str(path)!r}, expected a name that ends in .png or .exr")
    if suffix == ".exr":
        _check_openexr()


def _check_openexr() -> None:
    try:
        import_module("OpenEXR")
    except ImportError:
        raise InputError(
            "an EXR needs the package OpenEXR, which is not installed; `pip install OpenEXR`, or write a .png"
        ) from None


def srgb_of(image: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Linear RGB -> 8-bit sRGB (IEC 61966-2-1); values above 1 become white."""
    levels = np.empty(image.shape, np.uint8)
    encode_srgb(np.ascontiguousarray(image).reshape(-1), levels.reshape(-1))
    return levels


def png_of(image: NDArray[np.floating]) -> bytes:
    """(H, W, 3) linear RGB -> a PNG in sRGB."""
    from PIL import Image  # imported here because it is slow to load

    buffer = io.BytesIO()
    Image.fromarray(srgb_of(image), "RGB").save(buffer, format="PNG")
    return buffer.getvalue()


def exr_of(image: NDArray[np.float32], hits: Hits) -> bytes:
    """An EXR of 32 bits: R, G, B; Z, the depth, inf = a miss; N.X, N.Y, N.Z, the triangle's unit normal in the world,
    facing the eye, 0 = a miss; prim_id, `MISS` = a miss."""
    normals = eye_normals(hits)
    channels: dict[str, Any] = {name: image[..., k] for k, name in enumerate("RGB")}
    channels |= {f"N.{name}": normals[..., k] for k, name in enumerate("XYZ")}
    return exr_of_channels(channels | {"Z": hits.depth, "prim_id": hits.prim_id})


def exr_of_channels(channels: Mapping[str, NDArray[Any]]) -> bytes:
    """An EXR of named (H, W) arrays, 32 bits each. Raises InputError without the package OpenEXR."""
    _check_openexr()
    return encode_exr(channels)


def eye_normals(hits: Hits) -> NDArray[np.float32]:
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
