"""Nodes of a glTF, and where they place their meshes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.tree import entry
from atra.files.reading import Allowance
from atra.geometry.calibration import rotation_of_quaternion

_BYTES_PER_PLACE = 300


class Node(NamedTuple):
    """A node of the scene. number: in the file. to_world: (4, 4) float64."""

    number: int
    given: Any
    to_world: NDArray[np.float64]


def nodes_of(tree: Any) -> Iterator[Node]:
    """The nodes of the default scene, parents first. Raises InputError for cycles, and for several parents."""
    entries = tree.get("nodes", [])
    if "scenes" in tree:
        roots = entry(tree, "scenes", tree.get("scene", 0)).get("nodes", [])
    else:
        roots = sorted(set(range(len(entries))).difference(*(node.get("children", []) for node in entries)))
    seen: set[int] = set()
    waiting = [(number, np.eye(4)) for number in reversed(roots)]
    while waiting:
        number, parent = waiting.pop()
        node = entry(tree, "nodes", number)
        if number in seen:
            raise InputError(f"node {number} is its own ancestor, or has several parents; export the nodes as a tree")
        seen.add(number)
        to_world = parent @ _transform(number, node)
        yield Node(number, node, to_world)
        waiting += [(child, to_world) for child in reversed(node.get("children", []))]


def places_of(node: Node, numbers: Numbers, allowance: Allowance) -> list[NDArray[np.float64]]:
    """Where a node places its mesh: once, or as often as EXT_mesh_gpu_instancing says."""
    found = instances_of(node.given, numbers)
    if found is None:
        return [node.to_world]
    count = min(map(len, found.values()), default=0)
    allowance.check(f"{count:,} instances", count * _BYTES_PER_PLACE)
    places = ({name: rows[k] for name, rows in found.items()} for k in range(count))
    return [node.to_world @ _transform(node.number, place) for place in places]


def instances_of(node: Any, numbers: Numbers) -> dict[str, NDArray[np.float64]] | None:
    """Translations, rotations and scales of a node's instances, (N, 3 or 4), by EXT_mesh_gpu_instancing; None without
    that."""
    many = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if many is None:
        return None
    return {
        name.lower(): numbers.floats(number, 4 if name == "ROTATION" else 3)
        for name, number in many.get("attributes", {}).items()
        if name in ("TRANSLATION", "ROTATION", "SCALE")
    }


def _transform(number: int, node: Any) -> NDArray[np.float64]:
    if "matrix" in node:
        matrix = np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    else:
        quaternion = np.asarray(node.get("rotation", (0, 0, 0, 1)), np.float64).reshape(4)
        length = float(np.linalg.norm(quaternion))
        x, y, z, w = quaternion / length if length > 0.0 else (0.0, 0.0, 0.0, 1.0)
        matrix = np.eye(4)
        matrix[:3, :3] = rotation_of_quaternion(w, x, y, z)
        with np.errstate(invalid="ignore"):  # what is not finite is refused below
            matrix[:3, :3] *= np.asarray(node.get("scale", (1, 1, 1)), np.float64).reshape(3)
        matrix[:3, 3] = np.asarray(node.get("translation", (0, 0, 0)), np.float64).reshape(3)
    if not np.isfinite(matrix).all():
        raise InputError(f"node {number} has a transform that is not finite")
    return matrix
