"""Reading mesh files, which need not be trusted."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError, printable
from atra.files.meshes.claims import check_claims, gltf_tree
from atra.files.meshes.stripping import geometry_of
from atra.files.reading import Allowance, read_regular_file
from atra.geometry.mesh import Mesh


class Part(NamedTuple):
    """Vertices and faces of a mesh instance, the name of its node; raw: elements of a PLY as trimesh read them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    node: str
    raw: Any = None


# NumPy's warnings when it replaces text that is no number, or no index, by another value.
_DAMAGE = ("string or file could not be read to its end", "invalid value encountered in cast")


def load_mesh(path: str | Path, *, memory_per_byte: float | None = None) -> Mesh:
    """Read the triangles of a mesh file in file order; nothing is merged or dropped.

    path: a file in a format that trimesh reads (PLY, OBJ, STL, OFF, glTF, …); `~` is expanded. Polygons are cut into
    triangles. PLY, OFF, and an OBJ whose faces are all alike give triangles first, then one half of every quad, then
    the other halves, then fans of larger polygons; other OBJ files keep the order of their faces (`load_face_sources`
    tells each triangle's face). Instances of a scene graph are copied and transformed. Materials and textures are not
    read; a glTF may name buffers in its own folder only. A mesh from an STL shares no vertices.

    memory_per_byte: bound on the memory that reading may take, in bytes for each byte of the file and of the buffers it
    names; 128 MiB are always allowed. None: the environment variable ATRA_MEMORY_PER_BYTE, or 100. inf: free memory.

    The file need not be trusted (docs/trust.md). Raises InputError naming the path: missing, no regular file, an
    unknown format, unreadable, cut short, without triangles, beyond memory_per_byte, or with values that `Mesh`
    refuses. Refused, too, is what trimesh misreads: an OBJ with indices below 1, a glTF with compressed or sparse
    geometry, triangle fans or nodes with several parents, and archives.
    """
    path = Path(path).expanduser()
    parts = read_parts(path, memory_per_byte)
    first_vertex = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])
    vertices = np.concatenate([part.vertices for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, first_vertex, strict=True)])
    try:
        return Mesh(vertices, faces, name=printable(path.stem))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_parts(path: Path, memory_per_byte: float | None = None) -> list[Part]:
    """The parts of a file, at least one, in the order of its scene graph. Raises InputError as `load_mesh`."""
    if path.is_dir():
        raise InputError(f"{path} is a folder, expected a mesh file")
    if not path.exists():
        raise InputError(f"{path} does not exist, expected a mesh file")
    parts, promised = _read(path, memory_per_byte)
    if not parts:
        raise InputError(f"{path} holds no triangles (a point cloud or a path has none), expected a triangle mesh")
    count = sum(len(part.faces) for part in parts)
    if count < promised:
        raise InputError(f"{path} gives {count} faces, but promises {promised}: it seems cut short or damaged")
    return parts


def _read(path: Path, memory_per_byte: float | None) -> tuple[list[Part], int]:
    import trimesh  # slow to import, and needed only where a file is read
    from trimesh.exchange.load import mesh_formats

    suffix = path.suffix.lower().lstrip(".")
    formats = mesh_formats()
    if suffix not in formats:
        known = ", ".join(sorted(formats))
        raise InputError(f"{path} has the unknown format {suffix!r}, expected one of {known} (unpack an archive first)")
    try:
        content = read_regular_file(path)
        folder = _folder_of(path)
        tree = gltf_tree(content, suffix)
        allowance = Allowance(len(content) + _bytes_beside(tree, folder), memory_per_byte)
        promised = check_claims(content, suffix, tree, allowance)
        with warnings.catch_warnings(), _warnings_of_trimesh_refused():
            warnings.simplefilter("ignore")
            for damage in _DAMAGE:
                warnings.filterwarnings("error", message=damage)
            scene = trimesh.load_scene(
                io.BytesIO(geometry_of(content, suffix, tree)),
                file_type=suffix,
                resolver=folder,
                process=False,
                skip_materials=True,
                maintain_order=True,
            )
        return list(_flattened(scene)), promised
    except Exception as error:  # a reader of damaged bytes may raise anything
        reason = str(error).strip() or type(error).__name__
        raise InputError(f"{path} cannot be read as {suffix}: {reason}") from None


class _Refusal(logging.Handler):
    """Raises what is logged as an InputError."""

    def emit(self, record: logging.LogRecord) -> None:
        raise InputError(record.getMessage())


@contextmanager
def _warnings_of_trimesh_refused() -> Iterator[None]:
    """Refuse files in which trimesh skips something, which it only logs."""
    logger, refusal = logging.getLogger("trimesh"), _Refusal(logging.WARNING)
    logger.addHandler(refusal)
    try:
        yield
    finally:
        logger.removeHandler(refusal)


def _folder_of(path: Path) -> Any:
    """The resolver that gives trimesh the files which a mesh file names, each read once."""
    from trimesh.resolvers import FilePathResolver

    class Folder(FilePathResolver):  # type: ignore[misc]
        def get(self, name: str) -> bytes:
            return _once(self.absolute(name))

    _once = cache(read_regular_file)
    return Folder(str(path))


def _bytes_beside(tree: Any, folder: Any) -> int:
    """The total size of the files that a glTF names."""
    if tree is None:
        return 0
    names = {buffer.get("uri", "data:") for buffer in tree.get("buffers", [])}
    paths = {folder.absolute(name) for name in names if not name.startswith("data:")}
    return sum(path.stat().st_size for path in paths if path.is_file())


def _flattened(scene: Any) -> Iterator[Part]:
    """Vertices in world space and faces of every mesh instance, in the order of the scene graph."""
    import trimesh

    parts = {
        name: _checked_part(part)
        for name, part in scene.geometry.items()
        if isinstance(part, trimesh.Trimesh) and len(part.faces)
    }
    world, nodes = _world_transforms(scene.graph), scene.graph.transforms.node_data
    for node in scene.graph.nodes_geometry:
        part = parts.get(nodes[node]["geometry"])
        if part is None:
            continue
        transform, vertices = world[node], part.vertices
        if not np.array_equal(transform, np.eye(4)):  # identity keeps the file's bits
            vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
        yield Part(vertices, part.faces, str(node), part.raw)


def _checked_part(part: Any) -> Part:
    vertices, faces = np.asarray(part.vertices, np.float64), np.asarray(part.faces, np.int64)
    if faces.min() < 0 or faces.max() >= len(vertices):  # joined parts would hide it
        face = int(np.nonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))[0][0])
        raise InputError(f"face {face} names {faces[face].tolist()}, but there are {len(vertices)} vertices")
    return Part(vertices, faces, "", part.metadata.get("_ply_raw"))


def _world_transforms(graph: Any) -> dict[Any, NDArray[np.float64]]:
    """World transforms of all nodes below the base, each from its parent's; trimesh would multiply whole paths."""
    children, edges = graph.transforms.children, graph.transforms.edge_data
    world, waiting = {graph.base_frame: np.eye(4)}, [graph.base_frame]
    while waiting:
        parent = waiting.pop()
        for child in children.get(parent, ()):
            world[child] = world[parent] @ edges[parent, child]["matrix"]
            waiting.append(child)
    return world
