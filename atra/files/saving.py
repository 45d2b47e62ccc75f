"""Images as files: their encoders, and arrays (.npz), layers (.exr), pictures (.png) and point clouds (.ply)."""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from struct import pack
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically

Layers = Mapping[str, NDArray[Any]]
"""Arrays of an image by their names in `atra.Hits`."""

_PACKAGES = {".exr": ("OpenEXR", "openexr"), ".png": ("PIL", "pillow")}
"""Package that reading files with a suffix needs, or writing .exr, and its name for pip."""

_DARKEST = 40
"""Grey value of the farthest hit; misses are 0."""

_VECTORS = {"normals": "N", "points": "P"}
"""First letters of the channels of vectors in an EXR file."""


def save_layers(path: str | os.PathLike[str], layer: Callable[[str], NDArray[Any]]) -> None:
    """Write a file, whole or not at all, in the format that its suffix names.

    layer: returns a layer by its name. Raises InputError for an unknown suffix or a missing package, StorageError if
    the file cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() not in _WRITERS:
        raise InputError(f"{path} has the suffix {path.suffix!r}, expected one of {', '.join(_WRITERS)}")
    names, encode = _WRITERS[path.suffix.lower()]
    write_atomically(path, encode({name: layer(name) for name in names}))


def check_package(suffix: str) -> None:
    """Raise InputError if the package that files with this suffix need is missing."""
    name, install = _PACKAGES.get(suffix, ("numpy", "numpy"))
    try:
        import_module(name)
    except ImportError:
        message = f"{suffix} files need the package {name}, which is not installed: pip install {install}"
        raise InputError(message) from None


def encode_numpy(save: Callable[..., None], *arrays: NDArray[Any], **named: NDArray[Any]) -> bytes:
    """The file that `np.save` or `np.savez` writes of arrays."""
    content = io.BytesIO()
    save(content, *arrays, **named)
    return content.getvalue()


def encode_exr(channels: Layers) -> bytes:
    """An EXR file of named (H, W) arrays of 32 bits. Raises InputError without the package OpenEXR."""
    check_package(".exr")
    import OpenEXR

    whole = {name: np.ascontiguousarray(channel) for name, channel in channels.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with TemporaryDirectory() as folder:  # OpenEXR writes only to files
        path = Path(folder, "image.exr")
        with OpenEXR.File(header, whole) as file:
            file.write(str(path))
        return path.read_bytes()


def exr_channels(layers: Layers) -> dict[str, NDArray[Any]]:
    """Layers as the channels of an EXR file. Raises InputError for one of 64 bits, which an EXR file would round."""
    channels: dict[str, NDArray[Any]] = {}
    for name, array in layers.items():
        if array.dtype.itemsize > 4:
            raise InputError(f"{name} of this mesh as EXR would lose digits, expected npz, npy or tiff for it")
        if array.dtype.itemsize < 4:  # masks and colours
            array = array.astype(np.float32)
        if array.ndim == 2:
            channels["Z" if name == "depth" else name] = array
        else:
            letters = "XYZ" if name in _VECTORS else "RGB"
            channels |= {f"{_VECTORS.get(name, name)}.{letter}": array[..., k] for k, letter in enumerate(letters)}
    return channels


def encode_png(image: NDArray[Any]) -> bytes:
    """A PNG file of (H, W) or (H, W, 3) uint8 or uint16."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image, image.dtype.newbyteorder(">")).reshape(height, -1).view(np.uint8)
    lines = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1)  # each without a filter
    colour = 2 if image.ndim == 3 else 0
    header = pack(">IIBBBBB", width, height, 8 * image.dtype.itemsize, colour, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        pack(">I", len(data)) + kind + data + pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def encode_tiff(image: NDArray[Any]) -> bytes:
    """An uncompressed TIFF file of (H, W) or (H, W, 3), floats of 32 or 64 bits, whole numbers of 8 or 32."""
    if image.dtype == np.bool_:
        image = np.where(image, 255, 0).astype(np.uint8)
    image = np.ascontiguousarray(image, image.dtype.newbyteorder("<"))
    height, width = image.shape[:2]
    samples, bits, kind = image[0, 0].size, 8 * image.dtype.itemsize, 3 if image.dtype.kind == "f" else 1
    directory = 8 + 2 + 12 * 11 + 4  # bytes of header and directory; then bits and kind of three samples, then pixels
    places = (bits, kind) if samples == 1 else (directory, directory + 6)
    tags = (
        (256, 4, 1, width), (257, 4, 1, height), (258, 3, samples, places[0]), (259, 3, 1, 1),
        (262, 3, 1, 2 if samples == 3 else 1), (273, 4, 1, directory + 12), (277, 3, 1, samples), (278, 4, 1, height),
        (279, 4, 1, image.nbytes), (284, 3, 1, 1), (339, 3, samples, places[1]),
    )  # fmt: skip
    entries = b"".join(pack("<HHII", *tag) for tag in tags)
    header = b"II*\0" + pack("<IH", 8, len(tags)) + entries + pack("<I", 0)
    return header + pack("<6H", *[bits] * 3, *[kind] * 3) + image.tobytes()


def _point_cloud(layers: Layers) -> bytes:
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
    ".npz": (("depth", "prim_id", "u", "v", "points", "normals"), lambda layers: encode_numpy(np.savez, **layers)),
    ".exr": (("depth", "prim_id", "normals"), lambda layers: encode_exr(exr_channels(layers))),
    ".png": (("depth",), lambda layers: encode_png(depth_shading(layers["depth"]))),
    ".ply": (("points", "normals"), _point_cloud),
}
"""Layers that a file has, and its encoder, by its suffix."""
