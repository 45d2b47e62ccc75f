"""Planes of an image as files: depth, ids, normals and others, in the formats that other programs read."""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from struct import pack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.files.saving import check_package, depth_shading, encode_exr
from atra.prim_ids import MISS

PLANES = (
    "depth", "prim_id", "normals", "points", "u", "v", "mask", "instance", "material",
    "preview", "preview_ids", "preview_normals",
)  # fmt: skip
"""Names of planes. mask: what is hit. instance, material: numbers of nodes and materials of the mesh's file from 1, 0 =
none. Previews, to look at: depth as grey values, and ids and normals as colours."""

SOURCES = {"instance": "node", "material": "material"}
"""Planes that need a mesh's `FaceSources`, and the fields they show."""

_PREVIEWS: dict[str, tuple[str, Callable[[NDArray[Any]], NDArray[np.uint8]]]] = {
    "preview": ("depth", lambda depth: depth_shading(depth)),
    "preview_ids": ("prim_id", lambda prim_id: id_colours(prim_id)),
    "preview_normals": ("normals", lambda normals: normal_colours(normals)),
}
"""The plane that a preview is made of, and how."""

_GOLDEN = 2654435761
"""Odd, so that neighbouring ids have unlike colours."""

ALIASES = {"normal": "normals", "ids": "prim_id", "point": "points"}

PLANE_FORMATS = ("npz", "npy", "png", "exr", "tiff")
"""Formats of planes: one file of all for npz and exr, a file for each for the others."""

_MOST = 65535
"""Largest number of 16 bits."""


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
    check_package(f".{kind}" if kind == "exr" else "")
    found = {
        name: _PREVIEWS[name][1](plane(_PREVIEWS[name][0])) if name in _PREVIEWS else plane(name) for name in names
    }
    if kind == "npz":
        content = io.BytesIO()
        np.savez(content, **found)  # type: ignore[arg-type]
        files = {stem.with_name(f"{stem.name}.npz"): content.getvalue()}
    elif kind == "exr":
        files = {stem.with_name(f"{stem.name}.exr"): encode_exr(_channels(found))}
    else:
        encode = {
            "npy": lambda _, array: _npy(array),
            "png": lambda name, array: encode_png(_as_integers(name, array, depth_scale, saturate)),
            "tiff": lambda _, array: encode_tiff(array),
        }[kind]
        files = {stem.with_name(f"{stem.name}.{name}.{kind}"): encode(name, array) for name, array in found.items()}
    for path, bytes_ in files.items():
        write_atomically(path, bytes_)
    return list(files)


def id_colours(prim_id: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: a colour for each id, black = miss."""
    mixed = (prim_id.astype(np.uint64) + 1) * _GOLDEN
    mixed ^= mixed >> np.uint64(15)
    colours = np.stack([mixed >> np.uint64(shift) & np.uint64(0xFF) for shift in (0, 8, 16)], axis=-1)
    return np.where((prim_id == MISS)[..., None], 0, 55 + colours * 200 // 255).astype(np.uint8)


def normal_colours(normals: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: components from -1 to 1 as 0 to 255, black = miss."""
    return np.where(np.isfinite(normals), np.rint(np.nan_to_num(normals) * 127.5 + 127.5), 0).astype(np.uint8)


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
    if name in _PREVIEWS:
        return array
    raise InputError(f"{name} as PNG would lose digits, expected npz, npy, exr or tiff for it")


def _channels(found: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Planes as the channels of an EXR file."""
    channels: dict[str, NDArray[Any]] = {}
    for name, array in found.items():
        if name in _PREVIEWS:
            layers = array[..., None] if array.ndim == 2 else array
            channels |= {
                f"{name}.{letter}" if array.ndim == 3 else name: layers[..., number].astype(np.float32)
                for number, letter in enumerate("RGB"[: layers.shape[-1]])
            }
        elif array.ndim == 3:
            if array.dtype.itemsize > 4:
                raise InputError(f"{name} of this mesh as EXR would lose digits, expected npz, npy or tiff for it")
            letter = "N" if name == "normals" else "P"
            channels |= {f"{letter}.{axis}": array[..., number] for number, axis in enumerate("XYZ")}
        elif name == "mask":
            channels[name] = array.astype(np.float32)
        else:
            channels["Z" if name == "depth" else name] = array
    return channels


def _npy(array: NDArray[Any]) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return content.getvalue()


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
    samples, bits = image.shape[2] if image.ndim == 3 else 1, 8 * image.dtype.itemsize
    tags = {
        256: (4, width), 257: (4, height), 258: (3, bits), 259: (3, 1), 262: (3, 2 if samples == 3 else 1),
        273: (4, 0), 277: (3, samples), 278: (4, height), 279: (4, image.nbytes), 284: (3, 1),
        339: (3, 3 if image.dtype.kind == "f" else 1),
    }  # fmt: skip
    beside = 8 + 2 + 12 * len(tags) + 4  # header and directory; behind them what a tag has three numbers of
    tags[273] = (4, beside + 12)
    entries = b""
    for tag, (kind, value) in tags.items():
        is_per_sample = tag in (258, 339) and samples == 3
        place = beside + (6 if tag == 339 else 0) if is_per_sample else value
        entries += pack("<HHII", tag, kind, 3 if is_per_sample else 1, place)
    per_sample = pack("<6H", *[bits] * 3, *[tags[339][1]] * 3)
    header = b"II*\0" + pack("<I", 8) + pack("<H", len(tags)) + entries + pack("<I", 0)
    return header + per_sample + image.tobytes()
