"""Nodes of a glTF: where its meshes, cameras and lights are."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.reading import Allowance
from atra.geometry.camera import Camera
from atra.geometry.numbers import as_vector
from atra.geometry.view import View
from atra.light.lights import Light, PointLight, SpotLight, Sun
from atra.light.reading.gltf_numbers import Numbers, entry

_HEIGHT = 720
"""Rows of a camera's image; files do not tell."""

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
    many = node.given.get("extensions", {}).get("EXT_mesh_gpu_instancing")
    if many is None:
        return [node.to_world]
    found = {
        name: numbers.floats(number, 4 if name == "ROTATION" else 3)
        for name, number in many.get("attributes", {}).items()
        if name in ("TRANSLATION", "ROTATION", "SCALE")
    }
    count = min((len(rows) for rows in found.values()), default=0)
    allowance.check(f"{count:,} instances", count * _BYTES_PER_PLACE)
    keys = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
    return [
        node.to_world @ _transform(node.number, {keys[name]: rows[k] for name, rows in found.items()})
        for k in range(count)
    ]


def _transform(number: int, node: Any) -> NDArray[np.float64]:
    if "matrix" in node:
        matrix = np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    else:
        x, y, z, w = _unit(np.asarray(node.get("rotation", (0, 0, 0, 1)), np.float64).reshape(4))
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        with np.errstate(invalid="ignore"):  # what is not finite is refused below
            matrix[:3, :3] *= np.asarray(node.get("scale", (1, 1, 1)), np.float64).reshape(3)
        matrix[:3, 3] = np.asarray(node.get("translation", (0, 0, 0)), np.float64).reshape(3)
    if not np.isfinite(matrix).all():
        raise InputError(f"node {number} has a transform that is not finite")
    return matrix


def _unit(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    length = float(np.linalg.norm(quaternion))
    return quaternion / length if length > 0.0 else np.array([0.0, 0.0, 0.0, 1.0])


def camera_of(tree: Any, node: Node, left_out: dict[str, None]) -> tuple[str, View] | None:
    """The name and camera of a node, None if it has none that is read."""
    if "camera" not in node.given:
        return None
    given = entry(tree, "cameras", node.given["camera"])
    perspective = given.get("perspective")
    if given.get("type") != "perspective" or perspective is None:
        left_out["orthographic cameras"] = None
        return None
    name = str(node.given.get("name") or given.get("name") or f"camera {node.number}")
    eye, ahead, up = node.to_world[:3, 3], -node.to_world[:3, 2], node.to_world[:3, 1]
    width = max(1, min(1 << 14, round(_HEIGHT * float(perspective.get("aspectRatio", 16 / 9)))))
    target = eye + ahead / (np.linalg.norm(ahead) or 1.0)
    fov = degrees(float(perspective["yfov"]))
    return name, Camera(as_vector(eye), as_vector(target), as_vector(up), fov, width, _HEIGHT)


def light_of(tree: Any, node: Node, left_out: dict[str, None]) -> Light | None:
    """The light of a node by KHR_lights_punctual, None if it has none, or one that does not shine."""
    number = node.given.get("extensions", {}).get("KHR_lights_punctual", {}).get("light")
    if number is None:
        return None
    given = entry(tree.get("extensions", {}).get("KHR_lights_punctual", {}), "lights", number)
    colour = np.nan_to_num(np.asarray(given.get("color", (1, 1, 1)), np.float64).reshape(3)).clip(0.0, 1e6)
    power = float(given.get("intensity", 1.0)) / pi  # the file's candela and lux are of light before reflection
    if not 0.0 < power < 1e12 or not colour.any():
        left_out["lights whose intensity is not above 0"] = None
        return None
    if "range" in given:
        left_out["range of lights"] = None
    position, direction = as_vector(node.to_world[:3, 3]), as_vector(-node.to_world[:3, 2])
    tint = as_vector(colour)
    match given.get("type"):
        case "directional":
            return Sun(direction, 0.0, tint, power)
        case "point":
            return PointLight(position, tint, power)
        case "spot":
            cone = given.get("spot", {})
            outer = min(90.0, max(1e-3, degrees(float(cone.get("outerConeAngle", pi / 4)))))
            inner = min(outer, max(0.0, degrees(float(cone.get("innerConeAngle", 0.0)))))
            return SpotLight(position, direction, inner, outer, tint, power)
    left_out[f"lights of type {given.get('type')!r:.40}"] = None
    return None
