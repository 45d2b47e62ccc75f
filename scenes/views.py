"""Views of a scene beside its own, made from it the same way at every call."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.packets.pixel import PixelTracer

HOSTILE_VIEWS = ("along_axis", "rolled")
"""Those in which components of directions are all but zero, for `sweep=agreement`."""

VIEWS = ("own", "turned", "near", "above", "aside", "around", "wide", "corner", *HOSTILE_VIEWS)


def view_fields(mesh: Mesh, own: Mapping[str, Any], view: str) -> dict[str, Any]:
    """eye, target, up and fov_y_degrees of a view; `own` has those of the scene's own.

    own: as it is. turned, aside: turned by 40 degrees to the right; by 25 to the left and 10 down. near: moved in by
    0.4 of the distance to what the middle of the own view shows, and turned down by 10 degrees. around: a quarter
    nearer to that point and 25 degrees around it. wide: the field of view half as large again, moved back by 0.2 of
    the distance. above, corner: the whole model from outside, from above one corner; from the side of another, nearer.
    along_axis: along the world's axis nearest to the own view, but for 2e-19 of another. rolled: along it, too, and
    rolled by a quarter turn as float64 has it, whose cosine is 6e-17.
    Raises InputError for an unknown view.
    """
    if view not in VIEWS:
        raise InputError(f"scene.view is {view!r}, expected one of {', '.join(VIEWS)}")
    fields = dict(own)
    if view == "own":
        return fields
    eye = np.asarray(own["eye"], np.float64)
    right, down, forward = Camera(**own, width=1, height=1).axes
    if view in ("above", "corner"):
        centre, size = mesh.bounds.mean(axis=0), float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
        # Off the axes of the own view, whatever those of the world are.
        side, back, up = (0.5, 0.6, 0.7) if view == "above" else (-0.55, 0.35, 0.2)
        eye = centre + size * (side * right - back * forward - up * down)
        return fields | {"eye": eye.tolist(), "target": centre.tolist(), "fov_y_degrees": 45.0}
    if view in HOSTILE_VIEWS:
        axis = int(np.argmax(np.abs(forward)))
        other = max({0, 1, 2} - {axis}, key=lambda one: abs(down[one]))  # the height: at 0 there is often a floor
        side = 3 - axis - other
        target, upwards = eye.copy(), np.zeros(3)
        target[axis] += np.copysign(1.0, forward[axis])
        if view == "along_axis":
            eye[side] = -1e-3  # beside a larger number the difference would be lost, and at 0 there may be a wall
            target[side] = np.nextafter(eye[side], -1.0)
            upwards[other] = 1.0
        else:
            upwards[side], upwards[other] = sin(pi / 2), cos(pi / 2)
        return fields | {"eye": eye.tolist(), "target": target.tolist(), "up": upwards.tolist()}
    distance = _distance(mesh, own)
    if view == "turned":
        forward = _turned(forward, right, 40.0)
    elif view == "aside":
        forward = _turned(_turned(forward, right, -25.0), down, 10.0)
    elif view == "near":
        eye, forward = eye + 0.4 * distance * forward, _turned(forward, down, 10.0)
    elif view == "around":
        middle = eye + distance * forward
        forward = _turned(forward, right, 25.0)
        eye = middle - 0.75 * distance * forward
    elif view == "wide":
        eye = eye - 0.2 * distance * forward
        fields["fov_y_degrees"] = min(1.5 * float(own["fov_y_degrees"]), 120.0)
    return fields | {"eye": eye.tolist(), "target": (eye + distance * forward).tolist()}


def _turned(forward: NDArray[np.float64], towards: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """`forward`, turned towards another axis; both of unit length, at right angles or nearly so."""
    across = towards - (towards @ forward) * forward
    turned = cos(radians(degrees)) * forward + sin(radians(degrees)) * across / np.linalg.norm(across)
    return turned / np.linalg.norm(turned)


def _distance(mesh: Mesh, own: Mapping[str, Any]) -> float:
    """Depth of what the middle of the own view shows, scene units, in four digits: the last bits of a depth follow the
    instruction set, and views are the same on every machine. Half the model's size where nothing is seen."""
    with PixelTracer(mesh, Camera(**own, width=1, height=1), packet_width=1, threads=1, ties="any") as tracer:
        depth = float(tracer.trace().depth[0, 0])
    return float(f"{depth:.4g}") if np.isfinite(depth) else 0.5 * float(np.linalg.norm(np.ptp(mesh.bounds, axis=0)))
