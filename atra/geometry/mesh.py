"""Triangles: what is traced, and how a file becomes it."""

from __future__ import annotations

import io
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import InputError, printable
from atra.geometry.mesh_claims import check_claims, check_memory
from atra.geometry.mesh_geometry import geometry_of

Part = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Vertices and faces."""

# The triangle test multiplies three lengths in float32; beyond this their product leaves float32 and a triangle would
# vanish from the image without a word. Embree also drops triangles with coordinates above 1.8e18 silently. How near
# the eye must be depends on the camera: see `ray_space.check_range`.
_LARGEST_COORDINATE = 1e12

# Warnings of NumPy's by which text that is no number, or no index, goes on as another value.
_DAMAGE = ("string or file could not be read to its end", "invalid value encountered in cast")

_LONGER_PRODUCT = 4.0
"""How many times the product of the shortest two edges that of the two at the first corner is in a needle."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Indexed triangles in world space.

    vertices: (V, 3) float32, scene units; any real array-like is copied and converted.
    faces: (F, 3) uint32, three vertex indices each; row i is the triangle with `prim_id` i. Any integer array-like.
    name: what messages and records call it.

    Both arrays are C-contiguous, private copies and read-only. Zero-area triangles are kept, so that `prim_id` is the
    row of the source. Raises InputError for a wrong shape or dtype, no triangle, a coordinate that is not finite or
    beyond 1e12 in size (first one named), or an index outside the vertices (first face named).
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    name: str = "mesh"

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", _checked_vertices(self.vertices))
        object.__setattr__(self, "faces", _checked_faces(self.faces, len(self.vertices)))

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Copies and unpickled arrays can be written to, whatever the original was.
        self.__dict__.update(state)
        for array in (self.vertices, self.faces):
            array.setflags(write=False)

    @property
    def triangle_count(self) -> int:
        """F, degenerate triangles included."""
        return len(self.faces)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64, lowest and highest corner of the box around all vertices that a face uses."""
        is_used = np.zeros(len(self.vertices), np.bool_)
        is_used[self.faces] = True
        used = self.vertices[is_used].T.copy()  # an axis at a time is several times faster
        return np.stack([used.min(axis=1), used.max(axis=1)]).astype(np.float64)

    @cached_property
    def without_area(self) -> NDArray[np.int64]:
        """(N,) int64, `prim_id` of the triangles whose corners lie on a line, ascending: no ray hits them."""
        corners = self.vertices.astype(np.float64)[self.faces]
        # Differences of float32 values and their products are exact in float64, or nearly so.
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return np.flatnonzero((normals == 0.0).all(axis=1))

    @cached_property
    def traced_faces(self) -> NDArray[np.uint32]:
        """(F, 3) uint32: `faces`, the corners of each needle turned so that its longest edge lies opposite the first.

        What tracers hand to Embree. Its test multiplies the two edges at the first corner, and in float32 the product
        of two long edges of a needle says little about its plane (docs/methods.md has measurements). Other triangles
        stay as they are: two that share their longest edge, like the halves of a square, are tested there with the same
        numbers if it starts at the first corner of both, and no ray slips through between them.
        """
        corners = [self.vertices[self.faces[:, corner]].astype(np.float64) for corner in range(3)]
        lengths = np.stack([np.linalg.norm(corners[i - 2] - corners[i - 1], axis=1) for i in range(3)], axis=1)
        product = lengths.prod(axis=1)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            at_corner = product / lengths  # of the two edges there
        first = np.argmax(lengths, axis=1)
        best = np.take_along_axis(at_corner, first[:, None], axis=1)[:, 0]
        first[~(at_corner[:, 0] > _LONGER_PRODUCT * best)] = 0
        turned = np.take_along_axis(self.faces, (first[:, None] + np.arange(3)) % 3, axis=1)
        turned.setflags(write=False)
        return turned

    def triangles(self, prim_id: NDArray[np.integer]) -> NDArray[np.float64]:
        """Corners (N, 3, 3) float64 of the faces `prim_id` (N,): face, corner, axis.

        Raises InputError naming the first `prim_id` this mesh does not have.
        """
        prim_id = np.asarray(prim_id)
        absent = (prim_id < 0) | (prim_id >= self.triangle_count)
        if absent.any():
            raise InputError(
                f"prim_id {prim_id[absent].flat[0]} is not in {self.name!r}, which has {self.triangle_count} triangles"
            )
        return self.vertices[self.faces[prim_id]].astype(np.float64)


def _checked_vertices(given: ArrayLike) -> NDArray[np.float32]:
    vertices = _as_array("vertices", given)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        if vertices.size == 0:
            raise InputError("the mesh has no vertices, expected at least one triangle")
        raise InputError(f"vertices have shape {vertices.shape}, expected (V, 3)")
    if len(vertices) == 0:
        raise InputError("the mesh has no vertices, expected at least one triangle")
    if vertices.dtype.kind not in "iuf":
        raise InputError(f"vertices have dtype {vertices.dtype}, expected real numbers")
    good = np.abs(vertices.astype(np.float64)) <= _LARGEST_COORDINATE  # False for NaN and inf, too
    if not good.all():
        index = int(np.nonzero(~good.all(axis=1))[0][0])
        value = tuple(float(c) for c in vertices[index])
        raise InputError(
            f"vertex {index} is {value}, expected finite numbers of at most {_LARGEST_COORDINATE:g} in size"
        )
    copied = np.array(vertices, dtype=np.float32, order="C")
    copied.setflags(write=False)
    return copied


def _checked_faces(given: ArrayLike, vertex_count: int) -> NDArray[np.uint32]:
    faces = _as_array("faces", given)
    if faces.size == 0:
        raise InputError("the mesh has no faces, expected at least one triangle")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(f"faces have shape {faces.shape}, expected (F, 3): triangles")
    if faces.dtype.kind not in "iu":
        raise InputError(f"faces have dtype {faces.dtype}, expected whole numbers")
    bad = (faces < 0) | (faces >= vertex_count)
    if bad.any():
        face, corner = (int(i) for i in np.argwhere(bad)[0])
        raise InputError(f"face {face} names vertex {faces[face, corner]}, but the mesh has {vertex_count} vertices")
    copied = np.array(faces, dtype=np.uint32, order="C")
    copied.setflags(write=False)
    return copied


def _as_array(name: str, given: ArrayLike) -> NDArray[Any]:
    try:
        return np.asarray(given)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} cannot be read as an array: {error}") from None


def load_mesh(path: str | Path) -> Mesh:
    """Read the triangles of a file, in file order: nothing merged, reordered or dropped.

    path: a mesh file of a format trimesh reads (PLY, OBJ, STL, OFF, glTF, …); `~` is expanded. Polygons are cut into
    triangles; where PLY or OFF mix them with triangles, their pieces come last. A scene graph is flattened, each
    instance moved by its transform. Materials and textures are not read; a glTF may name buffers in its own folder
    only. STL has no shared vertices, so its mesh has none.

    The file need not be trusted (docs/trust.md). Raises InputError naming the path: missing, no regular file, an
    unknown format, unreadable, cut short, without triangles, with instances that the free memory cannot hold, or with
    values that `Mesh` refuses. An OBJ with relative (negative) indices and a glTF with compressed or sparse geometry,
    with triangle fans or with nodes of several parents are refused, since trimesh misreads them, and so is an archive,
    since trimesh skips the members it cannot read.
    """
    path = Path(path).expanduser()
    if path.is_dir():
        raise InputError(f"{path} is a folder, expected a mesh file")
    if not path.exists():
        raise InputError(f"{path} does not exist, expected a mesh file")
    parts, promised = _read(path)
    if not parts:
        raise InputError(f"{path} holds no triangles (a point cloud or a path has none), expected a triangle mesh")
    first_vertex = np.cumsum([0] + [len(vertices) for vertices, _ in parts[:-1]])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, first_vertex, strict=True)])
    if len(faces) < promised:
        raise InputError(f"{path} gives {len(faces)} faces, but promises {promised}: it seems cut short or damaged")
    try:
        return Mesh(vertices, faces, name=printable(path.stem))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _read(path: Path) -> tuple[list[Part], int]:
    """The parts of a file in the order of its scene graph, and how many faces it promises."""
    import trimesh  # slow to import, and needed only where a file is read
    from trimesh.exchange.load import mesh_formats

    suffix = path.suffix.lower().lstrip(".")
    formats = mesh_formats()
    if suffix not in formats:
        known = ", ".join(sorted(formats))
        raise InputError(f"{path} has the unknown format {suffix!r}, expected one of {known} (unpack an archive first)")
    try:
        content = read_regular_file(path)
        promised = check_claims(content, suffix)
        with warnings.catch_warnings(), _warnings_of_trimesh_refused():
            warnings.simplefilter("ignore")
            for damage in _DAMAGE:
                warnings.filterwarnings("error", message=damage)
            scene = trimesh.load_scene(
                io.BytesIO(geometry_of(content, suffix)),
                file_type=suffix,
                resolver=_folder_of(path),
                process=False,
                skip_materials=True,
                maintain_order=True,
            )
        return list(_flattened(scene)), promised
    except Exception as error:  # a reader of foreign bytes may raise anything
        reason = str(error).strip() or type(error).__name__
        raise InputError(f"{path} cannot be read as {suffix}: {reason}") from None


class _Refusal(logging.Handler):
    """Turns what is logged into an error."""

    def emit(self, record: logging.LogRecord) -> None:
        raise InputError(record.getMessage())


@contextmanager
def _warnings_of_trimesh_refused() -> Iterator[None]:
    """trimesh logs what it goes on without, with a traceback, which Python prints where no logging is set up."""
    logger, refusal = logging.getLogger("trimesh"), _Refusal(logging.WARNING)
    logger.addHandler(refusal)
    try:
        yield
    finally:
        logger.removeHandler(refusal)


def _folder_of(path: Path) -> Any:
    """Gives trimesh the files that a mesh file names, out of its own folder."""
    from trimesh.resolvers import FilePathResolver

    class Folder(FilePathResolver):  # type: ignore[misc]
        def get(self, name: str) -> bytes:
            return _once(self.absolute(name))

    _once = cache(read_regular_file)
    return Folder(str(path))


def read_regular_file(path: Path) -> bytes:
    """What a file holds. Raises InputError for a pipe or a device, which may block for ever or never end."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path.name} is no regular file")
    return path.read_bytes()


def _flattened(scene: Any) -> Iterator[Part]:
    """Vertices in world space and faces of every mesh instance, in the order of the scene graph."""
    import trimesh

    parts = {
        name: _checked_part(part)
        for name, part in scene.geometry.items()
        if isinstance(part, trimesh.Trimesh) and len(part.faces)
    }
    world, nodes = _world_transforms(scene.graph), scene.graph.transforms.node_data
    placed = [(world[node], nodes[node]["geometry"]) for node in scene.graph.nodes_geometry]
    placed = [(transform, parts[name]) for transform, name in placed if name in parts]
    check_memory(sum(len(vertices) + len(faces) for _, (vertices, faces) in placed))
    identity = np.eye(4)
    for transform, (vertices, faces) in placed:
        if not np.array_equal(transform, identity):  # identity keeps the file's bits
            vertices = vertices @ transform[:3, :3].T + transform[:3, 3]
        yield vertices, faces


def _checked_part(part: Any) -> Part:
    vertices, faces = np.asarray(part.vertices, np.float64), np.asarray(part.faces, np.int64)
    if faces.min() < 0 or faces.max() >= len(vertices):  # before parts are joined and hide it
        face = int(np.nonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))[0][0])
        raise InputError(f"face {face} names {faces[face].tolist()}, but there are {len(vertices)} vertices")
    return vertices, faces


def _world_transforms(graph: Any) -> dict[Any, NDArray[np.float64]]:
    """Of all nodes below the base, each from its parent's: trimesh would multiply the whole path anew for each."""
    children, edges = graph.transforms.children, graph.transforms.edge_data
    world, waiting = {graph.base_frame: np.eye(4)}, [graph.base_frame]
    while waiting:
        parent = waiting.pop()
        for child in children.get(parent, ()):
            world[child] = world[parent] @ edges[parent, child]["matrix"]
            waiting.append(child)
    return world
