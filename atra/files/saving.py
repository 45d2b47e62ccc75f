"""Images as files: encoders, `save_layers` for a whole image, and `write_planes` for depth, ids, normals and others."""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from struct import pack
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.prim_ids import MISS

Layers = Mapping[str, NDArray[Any]]
"""Arrays of an image by their names in `atra.Hits`."""

_PACKAGES = {".exr": ("OpenEXR", "openexr"), ".png": ("PIL", "pillow")}
"""Package that reading files with a suffix needs, or writing .exr, and its name for pip."""

PLANES = (
    "depth", "prim_id", "normals", "points", "u", "v", "mask", "instance", "material",
    "preview", "preview_ids", "preview_normals",
)  # fmt: skip
"""Names of planes. mask: what is hit. instance, material: numbers of nodes and materials of the mesh's file from 1, 0 =
none. Previews, to look at: depth as grey values, and ids and normals as colours."""

SOURCES = {"instance": "node", "material": "material"}
"""Planes that need a mesh's `FaceSources`, and the fields they show."""

_UP = 2
"""PNG's filter that stores how bytes differ from those of the row above: files are a fifth smaller."""

_GOLDEN = 2654435761
"""Odd, so that neighbouring ids have unlike colours."""

ALIASES = {"normal": "normals", "ids": "prim_id", "point": "points"}

PLANE_FORMATS = ("npz", "npy", "png", "exr", "tiff")
"""Formats of planes: one file of all for npz and exr, a file for each for the others."""

_MOST = 65535
"""Largest number of 16 bits."""

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
    """A PNG file of (H, W), (H, W, 3) or, with alpha, (H, W, 4) uint8 or uint16."""
    height, width = image.shape[:2]
    rows = np.ascontiguousarray(image, image.dtype.newbyteorder(">")).reshape(height, -1).view(np.uint8)
    lines = np.full((height, rows.shape[1] + 1), _UP, np.uint8)
    lines[:, 1:] = np.diff(rows, axis=0, prepend=np.uint8(0))
    colour = {2: 0, 3: 2 if image.shape[-1] == 3 else 6}[image.ndim]
    header = pack(">IIBBBBB", width, height, 8 * image.dtype.itemsize, colour, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes())), (b"IEND", b""))
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


def _id_colours(prim_id: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: a colour for each id, black = miss."""
    mixed = (prim_id.astype(np.uint64) + 1) * _GOLDEN
    mixed ^= mixed >> np.uint64(15)
    colours = np.stack([mixed >> np.uint64(shift) & np.uint64(0xFF) for shift in (0, 8, 16)], axis=-1)
    return np.where((prim_id == MISS)[..., None], 0, 55 + colours * 200 // 255).astype(np.uint8)


def _normal_colours(normals: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: components from -1 to 1 as 0 to 255, black = miss."""
    return np.where(np.isfinite(normals), np.rint(np.nan_to_num(normals) * 127.5 + 127.5), 0).astype(np.uint8)


_WRITERS: dict[str, tuple[tuple[str, ...], Callable[[Layers], bytes]]] = {
    ".npz": (("depth", "prim_id", "u", "v", "points", "normals"), lambda layers: encode_numpy(np.savez, **layers)),
    ".exr": (("depth", "prim_id", "normals"), lambda layers: encode_exr(exr_channels(layers))),
    ".png": (("depth",), lambda layers: encode_png(depth_shading(layers["depth"]))),
    ".ply": (("points", "normals"), _point_cloud),
}
"""Layers that a file has, and its encoder, by its suffix."""

PREVIEWS: dict[str, tuple[str, Callable[[NDArray[Any]], NDArray[np.uint8]]]] = {
    "preview": ("depth", depth_shading),
    "preview_ids": ("prim_id", _id_colours),
    "preview_normals": ("normals", _normal_colours),
}
"""The plane that a preview is made of, and how."""


def plane_names(given: Sequence[str]) -> list[str]:
    """Names of planes, each once. Raises InputError for an unknown one."""
    names = list(dict.fromkeys(ALIASES.get(name, name) for name in given))
    unknown = next((name for name in names if name not in PLANES), None)
    if unknown is not None or not names:
        raise InputError(f"planes are {', '.join(given) or 'none'}, expected some of {', '.join(PLANES)}")
    return names


def write_planes(
    stem: Path,
    planes: Sequence[str],
    kind: str,
    plane: Callable[[str], NDArray[Any]],
    depth_scale: float = 1000.0,
    saturate: bool = False,
) -> list[Path]:
    """Write planes of an image, each file whole or not at all; returns the files.

    stem: the files' path without suffix. planes: of `PLANES`. kind: of `PLANE_FORMATS`. plane: returns one by its name;
    only those asked for are computed. depth_scale, saturate: of depth and ids as PNG, see `atra.Hits.save_planes`.
    Raises InputError for unknown names, a missing package and values that do not fit, StorageError.
    """
    names = plane_names(planes)
    if kind not in PLANE_FORMATS:
        raise InputError(f"the format of planes is {kind!r}, expected one of {', '.join(PLANE_FORMATS)}")
    if kind == "exr":
        check_package(".exr")  # before anything is computed
    found = {name: PREVIEWS[name][1](plane(PREVIEWS[name][0])) if name in PREVIEWS else plane(name) for name in names}
    if kind in ("npz", "exr"):
        whole = encode_numpy(np.savez, **found) if kind == "npz" else encode_exr(exr_channels(found))
        files = {f".{kind}": whole}
    elif kind == "png":
        files = {
            f".{name}.png": encode_png(_as_integers(name, array, depth_scale, saturate))
            for name, array in found.items()
        }
    else:
        encode = partial(encode_numpy, np.save) if kind == "npy" else encode_tiff
        files = {f".{name}.{kind}": encode(array) for name, array in found.items()}
    paths = {stem.with_name(stem.name + end): content for end, content in files.items()}
    for path, content in paths.items():
        write_atomically(path, content)
    return list(paths)


def fit_16_bits(what: str, values: NDArray[np.floating], saturate: bool, remedy: str) -> NDArray[np.uint16]:
    """`values` rounded to uint16. Raises InputError that counts those that do not fit, unless they saturate."""
    with np.errstate(invalid="ignore"):
        rounded = np.rint(values)
        misfits = ~((rounded >= 0.0) & (rounded <= _MOST))
    if misfits.any() and not saturate:
        raise InputError(
            f"{int(misfits.sum()):,} of {misfits.size:,} {what} do not fit 16 bits: they reach from "
            f"{float(np.nanmin(values)):,.6g} to {float(np.nanmax(values)):,.6g}, expected 0 to {_MOST:,}; {remedy}"
        )
    return np.clip(np.nan_to_num(rounded), 0, _MOST).astype(np.uint16)


def _as_integers(name: str, array: NDArray[Any], depth_scale: float, saturate: bool) -> NDArray[Any]:
    """A plane as PNG stores it."""
    if name == "depth":
        hit = np.isfinite(array)
        scaled = np.where(hit, array, 0.0).astype(np.float64) * depth_scale
        return fit_16_bits("depths", scaled, saturate, "take another depth scale, or saturate")
    if name == "prim_id":
        numbers = np.where(array == MISS, 0, array.astype(np.int64) + 1).astype(np.float64)
        return fit_16_bits("ids", numbers, False, "write them as npz, npy, exr or tiff")
    if name in SOURCES:
        return fit_16_bits(f"numbers of {name}s", array.astype(np.float64), False, "write them as npz, npy or tiff")
    if name == "mask":
        return np.where(array, 255, 0).astype(np.uint8)
    if name == "normals":
        return np.where(np.isfinite(array), np.rint((array * 0.5 + 0.5) * _MOST), 0).astype(np.uint16)
    if name in PREVIEWS:
        return array
    raise InputError(f"{name} as PNG would lose digits, expected npz, npy, exr or tiff for it")
