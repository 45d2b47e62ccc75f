"""Where skins and morph targets move the vertices of a glTF: by joints as its nodes place them, and by weights."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.gltf.nodes import Node
from atra.files.gltf.numbers import Numbers
from atra.files.gltf.tree import entry


class Pose(NamedTuple):
    """How a node moves the vertices of its mesh. weights: of morph targets. joints: (J, 4, 4) from the mesh's space to
    the world, or None without a skin; a skin counts instead of the node's own place."""

    weights: tuple[float, ...] = ()
    joints: NDArray[np.float64] | None = None

    @property
    def is_plain(self) -> bool:
        """Whether nothing is moved."""
        return self.joints is None and not any(self.weights)


AT_REST = Pose()
"""Moves no vertex."""


def poses_of(tree: Any, nodes: list[Node], numbers: Numbers) -> dict[int, Pose]:
    """The poses of those nodes of the default scene that have a mesh, by their numbers. nodes: all of the scene."""
    worlds = {node.number: node.to_world for node in nodes}
    return {node.number: _pose(tree, node, worlds, numbers) for node in nodes if "mesh" in node.given}


def _pose(tree: Any, node: Node, worlds: dict[int, NDArray[np.float64]], numbers: Numbers) -> Pose:
    given = node.given.get("weights", entry(tree, "meshes", node.given["mesh"]).get("weights", ()))
    weights = tuple(np.nan_to_num(np.asarray(given, np.float64).reshape(-1)).tolist())
    if "skin" not in node.given:
        return Pose(weights)
    skin = entry(tree, "skins", node.given["skin"])
    missing = [joint for joint in skin["joints"] if joint not in worlds]
    if missing:
        raise InputError(f"skin {node.given['skin']} has the joint {missing[0]!r:.40}, which is no node of the scene")
    joints = np.array([worlds[joint] for joint in skin["joints"]]).reshape(-1, 4, 4)
    if "inverseBindMatrices" in skin:
        inverse = numbers.floats(skin["inverseBindMatrices"], 16).reshape(-1, 4, 4).transpose(0, 2, 1)
        if len(inverse) < len(joints):
            raise InputError(f"a skin has {len(inverse)} inverse bind matrices for {len(joints)} joints")
        joints = joints @ inverse[: len(joints)]
    return Pose(weights, joints)


def moved(rows: NDArray[np.float64], name: str, primitive: Any, numbers: Numbers, pose: Pose) -> NDArray[np.float64]:
    """Rows (V, 3) of POSITION or NORMAL of a primitive, in its pose; normals are not of unit length."""
    for weight, target in zip(pose.weights, primitive.get("targets", ()), strict=False):
        if weight != 0.0 and name in target:
            more = numbers.floats(target[name], 3)
            if more.shape != rows.shape:
                raise InputError(f"a morph target has {len(more)} rows, but there are {len(rows)} vertices")
            rows = rows + weight * more
    attributes = primitive["attributes"]
    if pose.joints is None or "JOINTS_0" not in attributes:
        return rows
    turns, total = np.zeros((len(rows), 3, 4)), np.zeros(len(rows))
    for k in range(8):
        if f"JOINTS_{k // 4}" not in attributes:
            break
        joint = numbers.rows(attributes[f"JOINTS_{k // 4}"])[1][:, k % 4]
        share = numbers.floats(attributes[f"WEIGHTS_{k // 4}"], 4)[:, k % 4]
        if len(joint) != len(rows) or len(share) != len(rows) or (len(joint) and joint.max() >= len(pose.joints)):
            raise InputError(f"JOINTS_{k // 4} names joints that the skin has not, or not one for each vertex")
        turns += share[:, None, None] * pose.joints[joint, :3]
        total += share
    turns /= np.where(total > 0.0, total, 1.0)[:, None, None]
    if name == "POSITION":
        return np.asarray(np.einsum("vij,vj->vi", turns[..., :3], rows) + turns[..., 3])
    columns = [turns[..., k] for k in range(3)]
    cofactors = [np.cross(columns[(k + 1) % 3], columns[(k + 2) % 3]) for k in range(3)]
    return np.asarray(sum(cofactors[k] * rows[:, k, None] for k in range(3)))
