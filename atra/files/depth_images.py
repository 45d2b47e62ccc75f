"""Images of depths, with or without ids of triangles, as other programs write them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.saving import check_package

DEPTH_NAMES = ("depth", "Z", "t", "t_hit", "distance", "Y", "R")
"""Names of arrays and channels that are taken for depths, the first that there is."""

ID_NAMES = ("prim_id", "primitive_ids", "face_id", "triangle_id", "id")
"""Names of arrays and channels that are taken for ids of triangles."""

MILLIMETRE = 0.001
"""Default of scene units to a step of a 16-bit PNG."""


class DepthImage(NamedTuple):
    """depth: (H, W) in scene units, as stored; prim_id: (H, W) as stored, or None; rounding: by how much the
    file may have rounded a depth, 0 for floats."""

    depth: NDArray[Any]
    prim_id: NDArray[Any] | None
    rounding: float


def read_depth_image(path: Path, png_scale: float = MILLIMETRE) -> DepthImage:
    """Read an .exr, .npz, .npy or 16-bit .png file; names as in DEPTH_NAMES and ID_NAMES.

    png_scale: scene units to a step of a PNG, in which 0 is a miss.
    Raises InputError naming the path: missing, another suffix, unreadable, without depths, a PNG of other than 16 bits.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path} has the suffix {path.suffix!r}, expected one of {', '.join(_READERS)}")
    if not path.is_file():
        raise InputError(f"{path} is no file")
    check_package(path.suffix.lower())
    try:
        return reader(path, png_scale)
    except InputError:
        raise
    except Exception as error:  # a damaged file may raise anything
        raise InputError(f"{path} cannot be read: {error}") from None


def _npz(path: Path, _: float) -> DepthImage:
    with np.load(path, allow_pickle=False) as arrays:
        return _named(path, {name: arrays[name] for name in arrays.files if name in (*DEPTH_NAMES, *ID_NAMES)})


def _npy(path: Path, _: float) -> DepthImage:
    return DepthImage(np.load(path, allow_pickle=False), None, 0.0)


def _exr(path: Path, _: float) -> DepthImage:
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    return _named(path, {name.rsplit(".", 1)[-1]: pixels for name, pixels in channels.items()})


def _png(path: Path, scale: float) -> DepthImage:
    from PIL import Image

    with Image.open(path) as picture:
        stored = np.asarray(picture)
        if picture.mode not in ("I;16", "I;16B", "I"):
            raise InputError(f"{path} has pixels of mode {picture.mode!r}, expected 16-bit grey: I;16")
    return DepthImage(stored.astype(np.float64) * scale, None, scale / 2)


def _named(path: Path, arrays: dict[str, NDArray[Any]]) -> DepthImage:
    depth = next((arrays[name] for name in DEPTH_NAMES if name in arrays), None)
    if depth is None:
        raise InputError(f"{path} has no depths, expected an array or channel called {', '.join(DEPTH_NAMES)}")
    return DepthImage(depth, next((arrays[name] for name in ID_NAMES if name in arrays), None), 0.0)


_READERS: dict[str, Callable[[Path, float], DepthImage]] = {".exr": _exr, ".npz": _npz, ".npy": _npy, ".png": _png}
