"""Face sources: the face, material and node in a mesh file that each triangle comes from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from atra.files.meshes.loading import read_mesh_file


@dataclass(frozen=True, eq=False)
class FaceSources:
    """The places of a mesh's triangles in its file; row i is the triangle with `prim_id` i.

    face: (F,) uint32, number of the face in the file, from 0; in a glTF, of the triangle in its primitive; in a 3MF, in
    its object.
    material: (F,) int32, index into `materials`, -1 = none.
    node: (F,) int32, index into `nodes`, -1 = none.
    materials: names in the order of the file, of OBJ and glTF; in a glTF a number stands for a missing name.
    nodes: names in the order of the file, of glTF; as for `materials`.
    """

    face: NDArray[np.uint32]
    material: NDArray[np.int32]
    node: NDArray[np.int32]
    materials: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()


def load_face_sources(path: str | Path, *, memory_per_byte: float | None = None) -> FaceSources:
    """The face, material and node that each triangle of `load_mesh(path)` comes from.

    memory_per_byte: as for `load_mesh`. Raises InputError as `load_mesh`.
    """
    found = read_mesh_file(Path(path).expanduser(), memory_per_byte)
    counts = [len(part.faces) for part in found.parts]
    materials = [np.broadcast_to(np.asarray(part.material, np.int32), len(part.faces)) for part in found.parts]
    return FaceSources(
        np.concatenate([part.face for part in found.parts]).astype(np.uint32),
        np.concatenate(materials),
        np.repeat(np.array([part.node for part in found.parts], np.int32), counts),
        found.materials,
        found.nodes,
    )
