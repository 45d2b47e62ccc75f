"""Saved images: arrays (.npz), layers (.exr), pictures (.png) and point clouds (.ply)."""

from __future__ import annotations

import io
import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically

Layers = dict[str, NDArray[Any]]
"""Arrays of an image by their names in `atra.Hits`."""

_PACKAGES = {".exr": "OpenEXR", ".png": "PIL"}
"""Packages that a suffix needs beside those of atra itself."""

_DARKEST = 40
"""Grey value of the farthest hit; misses are 0."""


def save_layers(path: str | os.PathLike[str], layer: Callable[[str], NDArray[Any]]) -> None:
    """Write a file, whole or not at all, in the format that its suffix names.

    layer: returns a layer by its name. Raises InputError for an unknown suffix or a missing package, StorageError if
    the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in _WRITERS:
        raise InputError(f"{path} has the suffix {path.suffix!r}, expected one of {', '.join(_WRITERS)}")
    check_package(path.suffix.lower())
    names, encode = _WRITERS[path.suffix.lower()]
    write_atomically(path, encode({name: layer(name) for name in names}))


def check_package(suffix: str) -> None:
    """Raise InputError if the package that files with this suffix need is missing."""
    name = _PACKAGES.get(suffix, "numpy")
    try:
        import_module(name)
    except ImportError:
        install = {"PIL": "pillow"}.get(name, name.lower())
        message = f"{suffix} files need the package {name}, which is not installed: pip install {install}"
        raise InputError(message) from None


def _npz(layers: Layers) -> bytes:
    content = io.BytesIO()
    np.savez(content, **layers)  # type: ignore[arg-type]
    return content.getvalue()


def _exr(layers: Layers) -> bytes:
    normals = np.moveaxis(layers["normals"], 2, 0)
    named_normals = dict(zip(("N.X", "N.Y", "N.Z"), normals, strict=True))
    return encode_exr({"Z": layers["depth"], "prim_id": layers["prim_id"], **named_normals})


def encode_exr(channels: Mapping[str, NDArray[Any]]) -> bytes:
    """An EXR file of named (H, W) arrays of 32 bits; needs the package OpenEXR."""
    import OpenEXR

    whole = {name: np.ascontiguousarray(channel) for name, channel in channels.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with TemporaryDirectory() as folder:  # OpenEXR writes only to files
        path = Path(folder, "image.exr")
        with OpenEXR.File(header, whole) as file:
            file.write(str(path))
        return path.read_bytes()


def _png(layers: Layers) -> bytes:
    return encode_png(depth_shading(layers["depth"]))


def encode_png(picture: NDArray[np.uint8]) -> bytes:
    """A PNG file of (H, W) grey values or (H, W, 3) colours; needs Pillow."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, "png")
    return content.getvalue()


def _ply(layers: Layers) -> bytes:
    is_placed = np.isfinite(layers["points"]).all(axis=-1)
    if not is_placed.any():
        raise InputError("nothing is hit, so a .ply file would have no point; save as .npz, .exr or .png")
    points = layers["points"][is_placed]
    kind, number = ("double", "<f8") if points.dtype == np.float64 else ("float", "<f4")
    rows = np.empty(len(points), [("points", number, 3), ("normals", "<f4", 3)])
    rows["points"], rows["normals"] = points, layers["normals"][is_placed]
    properties = [f"property {kind} {axis}\n" for axis in "xyz"] + [f"property float n{axis}\n" for axis in "xyz"]
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{''.join(properties)}end_header\n"
    return header.encode() + rows.tobytes()


def depth_shading(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W) uint8 grey values, linear in depth from white (nearest hit) to _DARKEST (farthest); 0 = miss."""
    shade, hit = np.zeros(depth.shape, np.uint8), np.isfinite(depth)
    if hit.any():
        near, far = (float(end(depth[hit])) for end in (np.min, np.max))
        share = (depth[hit] - near) / ((far - near) or 1.0)
        shade[hit] = np.rint(255 - share * (255 - _DARKEST))
    return shade


_WRITERS: dict[str, tuple[tuple[str, ...], Callable[[Layers], bytes]]] = {
    ".npz": (("depth", "prim_id", "u", "v", "points", "normals"), _npz),
    ".exr": (("depth", "prim_id", "normals"), _exr),
    ".png": (("depth",), _png),
    ".ply": (("points", "normals"), _ply),
}
