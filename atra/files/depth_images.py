"""Images of depths, with or without ids of triangles, as other programs write them."""

from __future__ import annotations

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

_SUFFIXES = (".exr", ".npz", ".npy", ".png")

_ROUNDING_STEPS = 0.5 + 65535 * 2**-24
"""Steps by which a 16-bit PNG may round a depth: half a step, and what float32 rounds of a depth of 65,535 steps."""


class DepthImage(NamedTuple):
    """depth: (H, W) in scene units, as stored; prim_id: (H, W) as stored, or None; rounding: by how much the
    file may have rounded a depth, 0 for floats."""

    depth: NDArray[Any]
    prim_id: NDArray[Any] | None
    rounding: float


def read_depth_image(path: Path, depth_scale: float = 1000.0) -> DepthImage:
    """Read an .exr, .npz, .npy or 16-bit .png file; names as in DEPTH_NAMES and ID_NAMES.

    depth_scale: numbers of a PNG per scene unit, as `Hits.save_planes` writes them; 0 is a miss.
    Raises InputError naming the path: missing, another suffix, unreadable, without depths, a PNG of other than 16 bits.
    """
    suffix = path.suffix.lower()
    if suffix not in _SUFFIXES:
        raise InputError(f"{path} has the suffix {path.suffix!r}, expected one of {', '.join(_SUFFIXES)}")
    if not path.is_file():
        raise InputError(f"{path} is no file")
    check_package(suffix)
    try:
        found = _arrays(path, suffix)
    except InputError:
        raise
    except Exception as error:  # a damaged file may raise anything
        raise InputError(f"{path} cannot be read: {error}") from None
    depth, prim_id = (next((found[name] for name in names if name in found), None) for names in (DEPTH_NAMES, ID_NAMES))
    if depth is None:
        raise InputError(f"{path} has no depths, expected an array or channel called {', '.join(DEPTH_NAMES)}")
    if suffix == ".png":
        return DepthImage(depth / depth_scale, None, _ROUNDING_STEPS / depth_scale)
    return DepthImage(depth, prim_id, 0.0)


def _arrays(path: Path, suffix: str) -> dict[str, NDArray[Any]]:
    """Arrays or channels by name; that of a file that names none is the depth."""
    if suffix == ".npz":
        with np.load(path, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files if name in (*DEPTH_NAMES, *ID_NAMES)}
    if suffix == ".npy":
        return {"depth": np.load(path, allow_pickle=False)}
    if suffix == ".exr":
        import OpenEXR

        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {name.rsplit(".", 1)[-1]: channel.pixels for name, channel in file.channels().items()}
    from PIL import Image

    with Image.open(path) as picture:
        if picture.mode not in ("I;16", "I;16B", "I"):
            raise InputError(f"{path} has pixels of mode {picture.mode!r}, expected 16-bit grey: I;16")
        return {"depth": np.asarray(picture).astype(np.float64)}
