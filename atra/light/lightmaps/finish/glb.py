"""A glTF that grows: its tree, its bytes, and the binary file of both."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.numbers import COMPONENT_TYPES

ELEMENTS = 34963
"""Target of a buffer view that holds indices."""

LIGHTMAP = "MOZ_lightmap"
"""Extension by which a material names its lightmap."""

_ARRAY = 34962
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_LINEAR, _CLAMP = 9729, 33071
_KINDS = {np.dtype(name).str: kind for kind, name in COMPONENT_TYPES.items()}


def glb_path(path: Path | str) -> Path:
    """The path of a model. Raises InputError for another suffix than .glb."""
    path = Path(path)
    if path.suffix.lower() != ".glb":
        raise InputError(f"a model is to be written to {str(path)!r}, expected a name that ends in .glb")
    return path


class Glb:
    """A glTF in the making. tree: its JSON, which grows. views: fields and content of its buffer views."""

    def __init__(self, tree: Any) -> None:
        self.tree = tree
        self.views: list[tuple[Any, bytes]] = []

    def add(self, kind: str, entry: Any) -> int:
        """Add an entry of a kind, such as "meshes"; returns its number."""
        self.tree.setdefault(kind, []).append(entry)
        return len(self.tree[kind]) - 1

    def add_view(self, content: bytes, **fields: Any) -> int:
        """A buffer view; returns its number."""
        self.views.append((fields, content))
        return len(self.views) - 1

    def add_texture(self, png: bytes, name: str, **fields: Any) -> int:
        """A texture of a map; returns its number."""
        image = self.add("images", {"name": name, "mimeType": "image/png", "bufferView": self.add_view(png)})
        sampler = {"magFilter": _LINEAR, "minFilter": _LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP}
        return self.add("textures", {"name": name, "source": image, "sampler": self.add("samplers", sampler), **fields})

    def add_rows(self, rows: NDArray[Any], target: int = _ARRAY, **fields: Any) -> int:
        """An accessor of (N, K) rows; returns its number. fields: its others, such as `normalized`."""
        rows = np.ascontiguousarray(rows)
        size, item = rows.shape[1], rows.dtype.itemsize
        kind = "SCALAR" if size == 1 else f"VEC{size}"
        made = fields | {"count": len(rows), "type": kind, "componentType": _KINDS[rows.dtype.str]}
        if target == _ARRAY:
            made |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        padded = np.zeros((len(rows), -(-size * item // 4) * 4), np.uint8)
        padded[:, : size * item] = rows.view(np.uint8).reshape(len(rows), -1)
        of_view = {"target": target} | ({"byteStride": padded.shape[1]} if target == _ARRAY else {})
        return self.add("accessors", made | {"bufferView": self.add_view(padded.tobytes(), **of_view)})

    def use(self, *extensions: str) -> None:
        """Name extensions as used."""
        self.tree["extensionsUsed"] = sorted({*self.tree.get("extensionsUsed", ()), *extensions})

    def encoded(self) -> bytes:
        """The binary file."""
        content, entries = bytearray(), []
        for fields, part in self.views:
            content += b"\0" * (-len(content) % 4)
            entries.append({"buffer": 0, "byteOffset": len(content), "byteLength": len(part), **fields})
            content += part
        tree = self.tree | {"bufferViews": entries, "buffers": [{"byteLength": len(content)}]}
        text, chunks = json.dumps(tree, separators=(",", ":")).encode(), b""
        for kind, part, blank in ((_JSON, text, b" "), (_BINARY, bytes(content), b"\0")):
            part += blank * (-len(part) % 4)
            chunks += len(part).to_bytes(4, "little") + kind.to_bytes(4, "little") + part
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
