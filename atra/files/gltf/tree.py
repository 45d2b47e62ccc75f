"""The JSON and the chunks of a glTF or GLB."""

from __future__ import annotations

from typing import Any

from atra.errors import InputError
from atra.files.reading import parse_json

_GLB_MAGIC, _GLB_JSON = b"glTF", b"JSON"
_GLB_VERSION = 2


def gltf_tree(content: bytes, suffix: str) -> Any:
    """The JSON of a glTF or GLB. Raises InputError for text that is no JSON, and for glTF 1.0."""
    is_glb = suffix == "glb"
    if is_glb and content[:4] == _GLB_MAGIC and int.from_bytes(content[4:8], "little") < _GLB_VERSION:
        raise _too_old("1.0")  # whose JSON lies elsewhere
    tree = parse_json(glb_chunks(content)[0] if is_glb else content)
    asset = tree.get("asset") if isinstance(tree, dict) else None
    version = asset.get("version", "") if isinstance(asset, dict) else ""
    if str(version).startswith(("0", "1")):
        raise _too_old(version)
    return tree


def _too_old(version: Any) -> InputError:
    return InputError(
        f"it is glTF {version!s:.10}, expected 2.0; convert it, such as by `npx gltf-pipeline -i old.gltf -o new.glb`"
    )


def without(extension: Any) -> str:
    """What to do about a file that needs an extension which is not read."""
    command = "ktxdecompress" if extension == "KHR_texture_basisu" else "copy"
    return f"export it without, or convert it, such as by `npx @gltf-transform/cli {command} old.glb new.glb`"


def glb_chunks(content: bytes) -> tuple[bytes, memoryview]:
    """The JSON chunk's text, and all chunks after it. Raises InputError for a chunk that is longer than the file."""
    if content[:4] != _GLB_MAGIC:
        raise InputError(f"it starts with {content[:4]!r}, expected {_GLB_MAGIC!r}")
    start, first = 12, b""
    while start + 8 <= len(content):
        length, kind = int.from_bytes(content[start : start + 4], "little"), content[start + 4 : start + 8]
        if start + 8 + length > len(content):
            raise InputError(f"a chunk claims {length} bytes, but the file ends {len(content) - start - 8} further on")
        if start == 12 and kind == _GLB_JSON:
            first = content[20 : 20 + length]
        start += 8 + length
    return first, memoryview(content)[20 + len(first) :]


def entry(tree: Any, kind: str, number: Any) -> Any:
    """Entry `number` of a list of the file. Raises InputError where there is none."""
    entries = tree.get(kind, [])
    if type(number) is not int or not 0 <= number < len(entries):
        raise InputError(f"it names {kind} {number!r}, but there are {len(entries)}, counted from 0")
    return entries[number]
