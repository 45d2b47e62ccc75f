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

    Attributes
    ----------
    face : (F,) uint32
        Number of the face in the file, from 0; in a glTF, of the triangle in its primitive; in a 3MF, in its object.
    material, node : (F,) int32
        Index into `materials` and `nodes`, -1 = none.
    materials, nodes : tuple of str
        Names in the order of the file: materials of OBJ and glTF, nodes of glTF, where a number stands for a missing
        name.
    """

    face: NDArray[np.uint32]
    material: NDArray[np.int32]
    node: NDArray[np.int32]
    materials: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()


def load_face_sources(path: str | Path, *, memory_per_byte: float | None = None) -> FaceSources:
    """The face, material and node that each triangle of `load_mesh(path)` comes from.

    Parameters
    ----------
    path, memory_per_byte :
        As for `load_mesh`.

    Returns
    -------
    FaceSources

    Raises
    ------
    InputError
        As `load_mesh`.
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
