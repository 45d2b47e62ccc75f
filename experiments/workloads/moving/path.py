"""The path of a moving camera: eyes on a small circle around the eye of a view, each one another."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin

import numpy as np

from atra.geometry.mesh import Mesh
from atra.geometry.view import View

EYES = 16
"""Places on the circle."""

RADIUS = 1 / 400
"""Of the circle, as a share of the scene's diagonal: 3 cm in a room of 13 m, a quick step of a walk from eye to eye."""


def eyes_around(camera: View, mesh: Mesh) -> tuple[View, ...]:
    """EYES cameras that look the same way as `camera`, on a circle around it and across its view; none is `camera`."""
    radius = RADIUS * float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    right, down, _ = camera.axes
    ways = [radius * (cos(2 * pi * place / EYES) * right + sin(2 * pi * place / EYES) * down) for place in range(EYES)]
    return tuple(
        replace(camera, eye=tuple(np.add(camera.eye, way)), target=tuple(np.add(camera.target, way)))  # type: ignore[type-var]
        for way in ways
    )
