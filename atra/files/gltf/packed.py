"""Compressed parts of a glTF, decoded by optional packages: Draco, meshoptimizer, and Basis images in KTX2."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.tree import without
from atra.files.reading import Allowance

DRACO = "KHR_draco_mesh_compression"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
BASIS = "KHR_texture_basisu"
KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
"""The first bytes of a KTX2 file."""


def draco_rows(content: bytes, attributes: dict[str, int]) -> tuple[dict[str, NDArray[Any]], NDArray[np.int64]]:
    """Rows of the attributes of a primitive, by their names, and corners (3 F,) of its triangles. attributes: the
    numbers by which Draco knows them."""
    found = _package("DracoPy", "a primitive", DRACO).decode(content)
    rows = {name: found.get_attribute_by_unique_id(number)["data"] for name, number in attributes.items()}
    return rows, np.asarray(found.faces, np.int64).ravel()


def meshopt_bytes(content: bytes, given: Any) -> bytes:
    """A buffer view that meshoptimizer has compressed. given: its extension."""
    count, stride = int(given["count"]), int(given["byteStride"])
    Allowance(len(content)).check(f"{count:,} compressed elements", count * stride)
    decode = _package("meshopt", "a buffer view", MESHOPT[0]).decode_gltf_buffer
    return bytes(np.ascontiguousarray(decode(content, count, stride, given["mode"], given.get("filter"))))


def ktx2_texels(content: bytes) -> NDArray[np.uint8]:
    """(H, W, 4) of a Basis image in KTX2."""
    basis = _package("opengl_basisu", "an image", BASIS)
    texture = basis.open(content)
    Allowance(len(content)).check(f"{texture.width} x {texture.height} pixels", 4 * texture.width * texture.height)
    return np.asarray(texture.transcode(basis.Target.RGBA8).data, np.uint8)


def _package(name: str, what: str, extension: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"{what} is compressed by {extension}, which the package {name} reads: pip install {name}; or "
            f"{without(extension)}"
        ) from None
