"""Reading mesh files, which need not be trusted, and where in a file each triangle comes from."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.formats.cells import FORMATS, read_cells_file
from atra.files.formats.obj import read_obj_file
from atra.files.formats.off import read_off_file
from atra.files.formats.others import NEEDED, known_formats, read_other_file
from atra.files.formats.ply import read_ply_file
from atra.files.formats.stl import read_stl_file
from atra.files.formats.three_mf import read_3mf_file
from atra.files.gltf.geometry import read_gltf_file
from atra.files.meshes.parts import MeshFile, joined
from atra.files.reading import Allowance, read_regular_file
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import as_number

_READERS = {
    "obj": read_obj_file, "ply": read_ply_file, "stl": read_stl_file, "stl_ascii": read_stl_file, "off": read_off_file,
    "3mf": read_3mf_file,
}  # fmt: skip
_GLTF = ("gltf", "glb")


def load_mesh(path: str | Path, *, scale: float = 1.0, memory_per_byte: float | None = None) -> Mesh:
    """Read the triangles of a mesh file, in the order of the file; vertices are not merged.

    Parameters
    ----------
    path : path
        A file in a format that is read here (OBJ, PLY, STL, OFF, glTF, GLB, 3MF), or by trimesh or meshio where they
        are installed; `~` is expanded. The file need not be trusted; docs/trust.md says what of it is read.
    scale : float
        Factor for all coordinates, such as 0.0254 from inches to metres; with one the mesh has no unit.
    memory_per_byte : float, optional
        Bound on the memory that reading may take, in bytes for each byte of the file and of the buffers it names;
        128 MiB are always allowed. None: the environment variable ATRA_MEMORY_PER_BYTE, or 100. inf: free memory.

    Returns
    -------
    Mesh
        `mesh.units` is the unit that the file states; `mesh.notes` says what is left out or doubtful, as does one
        warning.

    Raises
    ------
    InputError
        Naming the path: missing, no regular file, an unknown format or one that needs a package, unreadable, cut
        short, without triangles, beyond memory_per_byte, or with values that `Mesh` refuses.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.load_mesh("model.ply", scale=0.001)  # doctest: +SKIP
    """
    path, factor = Path(path).expanduser(), as_number(scale)
    if not (isfinite(factor) and factor > 0.0):
        raise InputError(f"scale is {scale!r}, expected a number above 0")
    found = read_mesh_file(path, memory_per_byte)
    vertices, faces = joined(found.parts)
    if factor != 1.0:
        vertices = vertices * factor
    try:
        units = found.units if factor == 1.0 else None
        mesh = Mesh(vertices, faces, printable(path.stem), units, found.notes)  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if mesh.notes:
        warnings.warn(f"{printable(path.name)}: {'; '.join(mesh.notes)}", stacklevel=2)
    return mesh


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

    Examples
    --------
    >>> import atra
    >>> sources = atra.load_face_sources("model.obj")  # doctest: +SKIP
    >>> sources.materials[sources.material[0]]  # doctest: +SKIP
    'steel'
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


def read_mesh_file(path: Path, memory_per_byte: float | None = None) -> MeshFile:
    """What a mesh file holds, at least one part with triangles. Raises InputError as `load_mesh`."""
    if not path.exists() or path.is_dir():
        raise InputError(f"{path} {'is a folder' if path.is_dir() else 'does not exist'}, expected a mesh file")
    suffix = path.suffix.lower().lstrip(".")
    if suffix not in _READERS and suffix not in (*_GLTF, *FORMATS):
        _check_other(path, suffix)
    try:
        content = b"" if suffix in _GLTF else read_regular_file(path)
        if suffix in _GLTF:
            found = read_gltf_file(path, memory_per_byte)
        elif suffix in _READERS:
            found = _READERS[suffix](content, Allowance(len(content), memory_per_byte))
        else:
            found = read_cells_file(content, suffix) if suffix in FORMATS else read_other_file(path, content, suffix)
    except Exception as error:  # a reader of damaged bytes may raise anything
        reason = str(error).strip() or type(error).__name__
        raise InputError(f"{path} cannot be read as {suffix}: {reason}") from None
    parts = [part for part in found.parts if len(part.faces)]
    if not parts:
        beside = f" ({'; '.join(found.notes)})" if found.notes else " (a point cloud or a path has none)"
        raise InputError(f"{path} holds no triangles{beside}, expected a triangle mesh")
    return found._replace(parts=parts, notes=tuple(printable(note) for note in found.notes))


def _check_other(path: Path, suffix: str) -> None:
    """Raise InputError for a format that trimesh does not read."""
    formats = known_formats()
    if suffix in NEEDED and suffix not in formats:
        raise InputError(f"{path} needs a package to be read: pip install {NEEDED[suffix]}")
    if suffix not in formats:
        known = ", ".join(sorted({*_READERS, *_GLTF, *FORMATS, *NEEDED, *formats}))
        raise InputError(f"{path} has the unknown format {suffix!r}, expected one of {known} (unpack an archive first)")
