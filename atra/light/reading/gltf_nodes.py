"""Cameras and lights of a glTF's nodes."""

from __future__ import annotations

from math import degrees, pi
from typing import Any

import numpy as np

from atra.files.gltf.nodes import Node
from atra.files.gltf.tree import entry
from atra.geometry.camera import Camera
from atra.geometry.numbers import as_vector
from atra.geometry.view import View
from atra.light.lights import Light, PointLight, SpotLight, Sun

_HEIGHT = 720
"""Rows of a camera's image; files do not tell."""


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
