"""The triangles of a glTF or GLB, as its nodes place them. Source: Khronos, "glTF 2.0 Specification"."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from atra.errors import printable
from atra.files.gltf.model import Gltf
from atra.files.gltf.packed import DRACO, MESHOPT
from atra.files.gltf.primitives import read_primitive
from atra.files.meshes.parts import BYTES_PER_ROW, NONE, MeshFile, placed_part

_READ = {DRACO, *MESHOPT, "KHR_mesh_quantization", "EXT_mesh_gpu_instancing"}
_NOT_GEOMETRY = re.compile(r"[A-Z]+_(?:materials?|textures?|lights?)_\w+")
"""Extensions that a file may require."""

_BYTES_PER_PART = 20_000
"""Memory for a placed primitive, more than it takes: the bound then covers the time of reading it, too."""


def read_gltf_file(path: Path, memory_per_byte: float | None) -> MeshFile:
    """The triangles of the default scene: nodes depth first in their order, primitives in theirs.

    Vertices are in world space; a transform that mirrors turns the winding of its faces. Raises InputError for required
    extensions that are not read, and for nodes with several parents.
    """
    sizes = BYTES_PER_ROW, _BYTES_PER_PART
    model = Gltf(path, memory_per_byte, lambda name: name in _READ or _NOT_GEOMETRY.fullmatch(name), *sizes)
    parts = [
        placed_part(*made, source.place, source.given.get("material", NONE), source.node.number)
        for source, made in model.primitives(lambda given, pose: read_primitive(given, model.numbers, pose))
    ]
    materials, nodes = (_names(model.tree.get(kind, [])) for kind in ("materials", "nodes"))
    return MeshFile(parts, materials, nodes, "meter", tuple(f"{one} are left out" for one in model.left_out))


def _names(things: Any) -> tuple[str, ...]:
    return tuple(printable(str(one.get("name", number))) for number, one in enumerate(things))
