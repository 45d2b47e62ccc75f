"""Planes of an image as files: depth, ids, normals and others, in the formats that other programs read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.files.saving import (
    check_package,
    depth_shading,
    encode_exr,
    encode_numpy,
    encode_png,
    encode_tiff,
    exr_channels,
)
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
    "preview": ("depth", depth_shading),
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
    if kind == "exr":
        check_package(".exr")  # before anything is computed
    found = {
        name: _PREVIEWS[name][1](plane(_PREVIEWS[name][0])) if name in _PREVIEWS else plane(name) for name in names
    }
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
