"""Surface files that installed packages ship measure the same by us and by an independent reader.

`python -m tests.files.test_surface_files [FOLDER ...]` lists, for each file under the folders, or the packages of this
environment: triangles, area, volume and bounds by us, and how an independent reader differs. It downloads nothing.
"""

from __future__ import annotations

import os
import sys
import sysconfig
import warnings
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

import atra
from atra.errors import InputError

SUFFIXES = {"obj", "ply", "stl", "off", "glb", "gltf", "3mf", "vtk", "vtu", "msh", "inp", "mesh", "bdf", "dae"}

_MOST_BYTES = 50_000_000


class Measures(NamedTuple):
    """Number, area, signed volume and bounds of triangles, whose corners are not merged."""

    triangles: int
    area: float
    volume: float
    bounds: np.ndarray[Any, np.dtype[np.float64]]


def measure(vertices: Any, faces: Any) -> Measures:
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    used = vertices[np.unique(faces)]
    volume = float(np.einsum("nc,nc->n", a - used[0], normals).sum() / 6)
    area = float(np.linalg.norm(normals, axis=1).sum() / 2)
    return Measures(len(faces), area, volume, np.array([used.min(axis=0), used.max(axis=0)]))


def by_pymeshlab(path: Path) -> Measures:
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(path))
    meshes.generate_by_merging_visible_meshes()
    mesh = meshes.current_mesh()
    return measure(mesh.vertex_matrix(), mesh.face_matrix())


def by_open3d(path: Path) -> Measures:
    import open3d

    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    mesh = open3d.io.read_triangle_mesh(str(path))
    return measure(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def by_pyvista(path: Path) -> Measures:
    import pyvista

    surface = pyvista.read(path)
    if not isinstance(surface, pyvista.PolyData):
        kinds = np.isin(surface.celltypes, (5, 7, 9))
        surface = surface.extract_cells(kinds).extract_surface()
    surface = surface.triangulate()
    return measure(surface.points, surface.regular_faces)


READERS = {"pymeshlab": by_pymeshlab, "Open3D": by_open3d, "PyVista": by_pyvista}


def surface_files(folders: list[Path]) -> Iterator[Path]:
    found = {path.resolve() for folder in folders for path in folder.rglob("*.*")}
    for path in sorted(found):
        if path.suffix.lower()[1:] in SUFFIXES and path.is_file() and path.stat().st_size < _MOST_BYTES:
            yield path


def difference(ours: Measures, theirs: Measures) -> str:
    """What differs beyond the rounding of float32, in words; nothing if nothing does."""
    size = float(np.ptp(ours.bounds, axis=0).max()) or 1.0
    told = []
    if ours.triangles != theirs.triangles:
        told.append(f"{theirs.triangles:,} triangles")
    if abs(ours.area - theirs.area) > 1e-4 * ours.area:
        told.append(f"area {theirs.area:.6g}")
    if abs(ours.volume - theirs.volume) > 1e-4 * (size * ours.area):
        told.append(f"volume {theirs.volume:.6g}")
    if np.abs(ours.bounds - theirs.bounds).max() > 1e-4 * size:
        told.append(f"bounds {theirs.bounds.round(4).tolist()}")
    return ", ".join(told)


class Independent:
    """The independent readers, each in a process of its own, since a broken one may take its process with it."""

    def __init__(self) -> None:
        self._pools = {name: self._pool() for name in READERS}

    @staticmethod
    def _pool() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, get_context("spawn"))

    def measures(self, name: str, path: Path) -> Measures | None:
        """None where the reader is not installed, does not know the format, or fails."""
        try:
            return self._pools[name].submit(READERS[name], path).result(timeout=100)
        except BrokenProcessPool:
            self._pools[name] = self._pool()
        except Exception:  # of any kind
            pass
        return None


def compare(path: Path, readers: Independent) -> tuple[str, str, str]:
    """The outcome, ours in words, and which reader agrees; those asked before it that differ, in words."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mesh = atra.load_mesh(path)
    except InputError as error:
        return "refused", str(error).replace(str(path), "")[:150], ""
    ours, told = measure(mesh.vertices, mesh.faces), list[str]()
    notes = f"; {'; '.join(mesh.notes)}" if mesh.notes else ""
    words = f"{ours.triangles:,} triangles, area {ours.area:.6g}, volume {ours.volume:.6g}"
    words = f"{words}, bounds {ours.bounds.round(4).tolist()}{notes}"
    for name in READERS:
        theirs = readers.measures(name, path)
        if theirs is not None:
            differs = difference(ours, theirs)
            told.append(f"{name} {differs or 'agrees'}")
            if not differs:
                return "agree", words, "; ".join(told)
    return "differ" if told else "unjudged", words, "; ".join(told)


EXPLAINED = {
    "calf.obj": "49 bent polygons, which each reader cuts otherwise",
    "link3.obj": "pymeshlab leaves out 3 faces that are there twice or have no area; the area is the same",
    "hokuyo.obj": "pymeshlab leaves out faces that are there twice or have no area; the area is the same",
    "l_finger_collision.stl": "others leave out 18 triangles without area",
}


def outcomes(folders: list[Path]) -> Iterator[tuple[Path, str, str, str]]:
    readers = Independent()
    return ((path, *compare(path, readers)) for path in surface_files(folders))


@pytest.mark.skipif(
    not any(find_spec(name) for name in ("pymeshlab", "open3d", "pyvista")), reason="needs an independent reader"
)
@pytest.mark.slow
@pytest.mark.uncovered
def test_files_of_installed_packages_measure_as_an_independent_reader_says():
    folders = [Path(name) for name in os.environ.get("ATRA_SURFACE_FILES", sysconfig.get_path("purelib")).split(":")]
    counts = Counter()
    for path, outcome, ours, told in outcomes(folders):
        counts[outcome] += 1
        assert outcome != "differ" or path.name in EXPLAINED, f"{path}: {ours}, but {told}"
    if not counts["agree"]:
        pytest.skip("no package that is installed ships surface files")


if __name__ == "__main__":
    counts = Counter()
    for path, outcome, ours, told in outcomes([Path(name) for name in sys.argv[1:] or [sysconfig.get_path("purelib")]]):
        counts[outcome] += 1
        print(f"{outcome}: {path.parent.name}/{path.name}: {ours} | {told}", flush=True)
    print(dict(counts))
