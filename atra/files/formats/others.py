"""Formats that trimesh reads, such as COLLADA, and the packages that it needs for some."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from atra.errors import InputError
from atra.files.meshes.parts import MeshFile, Part, placed_part, polygon_part
from atra.files.reading import read_regular_file

NEEDED = {
    "dae": "pycollada", "zae": "pycollada", "step": "cascadio", "stp": "cascadio", "3dxml": "lxml networkx",
    "xaml": "lxml", "ctm": "openctm",
}  # fmt: skip
"""Packages without which trimesh does not know a format."""

_UNITS = {"meters": "meter", "0.0254 * meters": "inch", "0.01 * meters": "centimeter", "0.001 * meters": "millimeter",
          "mm": "millimeter"}  # fmt: skip
"""Our words for what trimesh says."""

# NumPy's warnings when it replaces text that is no number, or no index, by another value.
_DAMAGE = ("string or file could not be read to its end", "invalid value encountered in cast")


def known_formats() -> set[str]:
    """The formats that trimesh reads with the packages that are installed."""
    from trimesh.exchange.load import mesh_formats  # slow to import, and needed only where a file is read

    return set(mesh_formats())


def read_other_file(path: Path, content: bytes, suffix: str) -> MeshFile:
    """The triangles of every mesh instance in world space, in the order of trimesh's scene graph."""
    import trimesh

    logger, refusing = logging.getLogger("trimesh"), _Refusing(logging.WARNING)
    with warnings.catch_warnings(), ExitStack() as undone:
        logger.addHandler(refusing)
        undone.callback(logger.removeHandler, refusing)
        warnings.simplefilter("ignore")
        for damage in _DAMAGE:
            warnings.filterwarnings("error", message=damage)
        scene = trimesh.load_scene(
            io.BytesIO(content),
            file_type=suffix,
            resolver=_folder_of(path),
            process=False,
            skip_materials=True,
            maintain_order=True,
        )
    notes: dict[str, None] = {}
    parts = list(_flattened(scene, notes))
    units = next((part.metadata["units"] for part in scene.geometry.values() if "units" in part.metadata), None)
    return MeshFile(parts, units=None if units is None else _UNITS.get(units, str(units)), notes=tuple(notes))


class _Refusing(logging.Handler):
    """Refuses files in which trimesh skips something, which it only logs."""

    def emit(self, record: logging.LogRecord) -> None:
        raise InputError(record.getMessage())


def _folder_of(path: Path) -> Any:
    """The resolver that gives trimesh the files which a mesh file names."""
    from trimesh.resolvers import FilePathResolver

    class Folder(FilePathResolver):  # type: ignore[misc]
        def get(self, name: str) -> bytes:
            return read_regular_file(self.absolute(name))

    return Folder(str(path))


def _flattened(scene: Any, notes: dict[str, None]) -> Iterator[Part]:
    import trimesh

    parts = {}
    for name, part in scene.geometry.items():
        if isinstance(part, trimesh.Trimesh) and len(part.faces):
            faces = np.asarray(part.faces, np.int64)
            vertices = np.asarray(part.vertices, np.float64)
            parts[name], more = polygon_part(vertices, np.broadcast_to(3, len(faces)), faces.ravel())
            notes |= dict.fromkeys(more)
    for node in scene.graph.nodes_geometry:
        to_world, name = scene.graph[node]
        if name in parts:
            yield placed_part(parts[name].vertices, parts[name].faces, to_world)
