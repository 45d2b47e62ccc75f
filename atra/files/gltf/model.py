"""A glTF or GLB as its readers share it: what may be read, and its primitives where nodes place them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.folder import Folder
from atra.files.gltf.nodes import Node, nodes_of, places_of
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.poses import Pose, poses_of
from atra.files.gltf.primitives import FAN, TRIANGLES, claimed_rows
from atra.files.gltf.tree import entry, gltf_tree, without
from atra.files.meshes.parts import NONE
from atra.files.reading import Allowance, read_regular_file

_BYTES_PER_NODE = 500
"""Memory for a node, however empty."""


class Source(NamedTuple):
    """Where a placed primitive comes from: a node, and the numbers of its mesh and of the primitive in it. place:
    (4, 4), from the primitive to the world."""

    node: Node
    mesh: int
    primitive: int
    given: Any
    place: NDArray[np.float64]


Made = TypeVar("Made", bound=Sequence[Any])
"""What a reader makes of a primitive: vertices, faces, and more."""


class Gltf:
    """A glTF or GLB. nodes: those of the default scene. left_out: what is not read, by name.

    is_read: whether an extension that the file requires is read. named: lists of entries that name files, whose bytes
    count for memory_per_byte. bytes_per_row, bytes_per_part: memory for a face or vertex, and for a placed primitive.
    Raises InputError for extensions that are required and not read, for nodes with several parents, and for more nodes
    than allowed.
    """

    def __init__(
        self,
        path: Path,
        memory_per_byte: float | None,
        is_read: Callable[[str], Any],
        bytes_per_row: int,
        bytes_per_part: int,
        named: tuple[str, ...] = ("buffers",),
    ) -> None:
        content, suffix = read_regular_file(path), path.suffix.lower().lstrip(".")
        self.tree, self.folder = gltf_tree(content, suffix), Folder(path)
        self._bytes_per_row, self._bytes_per_part = bytes_per_row, bytes_per_part
        for name in self.tree.get("extensionsRequired", []):
            if not is_read(name):
                raise InputError(f"it requires the extension {name!r:.60}, which is not read; {without(name)}")
        uris = {one["uri"] for kind in named for one in self.tree.get(kind, []) if "uri" in one}
        beside = {self.folder.path_of(uri): self.folder.size_of(uri) for uri in uris if not uri.startswith("data:")}
        self.allowance = Allowance(len(content) + sum(beside.values()), memory_per_byte)
        count = len(self.tree.get("nodes", []))
        self.allowance.check(f"{count:,} nodes", count * _BYTES_PER_NODE)
        self.numbers = Numbers(self.tree, content, suffix, self.folder)
        self.nodes = list(nodes_of(self.tree))
        self.left_out: dict[str, None] = dict.fromkeys(["animations"] if self.tree.get("animations") else [])

    def primitives(self, read: Callable[[Any, Pose], Made]) -> Iterator[tuple[Source, Made]]:
        """The primitives of triangles, nodes depth first in their order; each is read once in each pose.

        read: makes a primitive, in the space of its mesh. Raises InputError for more than memory_per_byte allows.
        """
        poses = poses_of(self.tree, self.nodes, self.numbers)
        made: dict[tuple[int, int, int], Made] = {}
        count = rows = 0
        for node, mesh in ((node, node.given["mesh"]) for node in self.nodes if "mesh" in node.given):
            pose = poses[node.number]
            own = NONE if pose.is_plain else node.number
            places = [np.eye(4)] if pose.joints is not None else places_of(node, self.numbers, self.allowance)
            for place in places:
                for k, given in enumerate(entry(self.tree, "meshes", mesh)["primitives"]):
                    if not self._has_triangles(given):
                        continue
                    count += 1
                    self.allowance.check(f"{count:,} parts and more", count * self._bytes_per_part)
                    if (mesh, k, own) not in made:
                        self._check_rows(rows + claimed_rows(given, self.numbers))
                        made[mesh, k, own] = read(given, pose)
                    found = made[mesh, k, own]
                    rows += len(found[0]) + len(found[1])
                    self._check_rows(rows)
                    yield Source(node, mesh, k, given, place), found

    def _has_triangles(self, primitive: Any) -> bool:
        mode = primitive.get("mode", TRIANGLES)
        if mode not in range(FAN + 1):
            raise InputError(f"a primitive has the mode {mode!r:.50}, expected 0 to {FAN}")
        if mode < TRIANGLES:
            self.left_out["points and lines"] = None
        return bool(mode >= TRIANGLES)

    def _check_rows(self, rows: int) -> None:
        self.allowance.check(f"{rows:,} faces and vertices", rows * self._bytes_per_row)
