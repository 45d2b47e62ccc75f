"""Formats of simulations (VTK, Gmsh, Abaqus, Nastran and others), read by the package meshio."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.meshes.parts import MeshFile, polygon_part

FORMATS = (
    "avs", "bdf", "cgns", "dat", "e", "ex2", "exo", "f3grid", "fem", "h5m", "hmf", "inp", "mdpa", "med", "mesh",
    "meshb", "msh", "nas", "post", "su2", "tec", "ugrid", "vol", "vtk", "vtu", "xdmf", "xmf",
)  # fmt: skip
"""Endings of the names of files that meshio reads."""

_CORNERS = {"triangle": 3, "quad": 4}


def read_cells_file(content: bytes, suffix: str) -> MeshFile:
    """The triangles, quads and polygons among the cells, in their order; those with curved edges by their corners.

    Other cells, such as lines and tetrahedra, are left out. Raises InputError where meshio is not installed, or fails.
    """
    found = _read(content, suffix)
    points = np.asarray(found.points, np.float64)[:, :3]
    vertices = np.pad(points, ((0, 0), (0, 3 - points.shape[1])))
    polygons, left_out, curved = [np.empty((0, 3), np.int64)], dict[str, int](), 0
    for block in found.cells:
        flat = block.type.rstrip("0123456789")
        if flat in _CORNERS:
            polygons.append(np.asarray(block.data, np.int64)[:, : _CORNERS[flat]])
            curved += len(block.data) if block.type != flat else 0
        elif flat == "polygon":
            polygons += [np.asarray(row, np.int64)[None] for row in block.data]
        else:
            left_out[block.type] = left_out.get(block.type, 0) + len(block.data)
    notes = [f"{count:,} cells of the kind {kind} are left out" for kind, count in left_out.items()]
    notes += [f"{curved:,} cells have curved edges, which are read as straight"] if curved else []
    sizes = np.repeat([rows.shape[1] for rows in polygons], [len(rows) for rows in polygons])
    part, more = polygon_part(vertices, sizes, np.concatenate([rows.ravel() for rows in polygons]))
    return MeshFile([part], notes=tuple(notes + more))


def _read(content: bytes, suffix: str) -> Any:
    """What meshio reads: from a file only, and it prints."""
    try:
        import meshio  # slow to import, and needed only here
    except ImportError:
        raise InputError("its format needs the package meshio, which is not installed: pip install meshio") from None
    reasons = []
    with TemporaryDirectory() as folder, redirect_stdout(io.StringIO()) as said:
        path = Path(folder) / f"mesh.{suffix}"
        path.write_bytes(content)
        more = ["avsucd"] if suffix == "inp" else []  # AVS gives its files the ending of Abaqus's
        for kind in [*meshio.extension_to_filetypes.get(f".{suffix}", []), *more]:
            try:
                return meshio.read(path, kind)
            except (Exception, SystemExit) as error:  # a reader of damaged bytes may raise anything
                reasons.append(f"{kind}: {str(error).replace(str(path), 'it').strip() or type(error).__name__}")
    raise InputError(f"meshio does not read it ({'; '.join(reasons)}; {' '.join(said.getvalue().split())})")
