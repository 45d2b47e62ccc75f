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
    points = np.asarray(found.points, np.float64)
    vertices = np.zeros((len(points), 3))
    vertices[:, : points.shape[1]] = points[:, :3]
    sizes, corners, left_out, curved = [], [], dict[str, int](), 0
    for block in found.cells:
        kind, rows = block.type, block.data
        flat = next((name for name in _CORNERS if kind.rstrip("0123456789") == name), None)
        if flat is not None:
            rows = np.asarray(rows)
            curved += len(rows) if kind != flat else 0
            corners.append(rows[:, : _CORNERS[flat]].astype(np.int64).ravel())
            sizes.append(np.full(len(rows), _CORNERS[flat]))
        elif kind.startswith("polygon"):
            corners += [np.asarray(row, np.int64) for row in rows]
            sizes.append(np.array([len(row) for row in rows], np.int64))
        else:
            left_out[kind] = left_out.get(kind, 0) + len(rows)
    notes = [f"{count:,} cells of the kind {kind} are left out" for kind, count in left_out.items()]
    notes += [f"{curved:,} cells have curved edges, which are read as straight"] if curved else []
    empty = [np.empty(0, np.int64)]
    part, more = polygon_part(vertices, np.concatenate(sizes + empty), np.concatenate(corners + empty))
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
