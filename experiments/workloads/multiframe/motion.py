"""Several frames from one view: the camera and mesh of each, and the tracer of all of them together."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment, Split
from atra.alignment.frames import FramesTracer
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.numbers import Vector
from experiments.harness.point import Point
from experiments.methods.options import keywords_of, split_of

EYE_DISTANCE = 1 / 200
"""Distance of two eyes as a share of the scene's diagonal: 6.5 cm in a room of 13 m."""

STEP, STEP_TURN_DEGREES, STEP_ZOOM = 1 / 400, 0.5, 1.005
"""A frame of a walk adds a step, as a share of the scene's diagonal, a turn, and a factor of the field of view."""

MESH_TURN_DEGREES = -0.5
"""Turn that a frame adds to the mesh; clockwise seen from above."""

MOTIONS = ("eyes", "walk", "turn")
"""How the frames of a point differ (`frames_of`)."""


def frames_of(camera: Camera, mesh: Mesh, frames: int, motion: str) -> tuple[tuple[Camera, ...], tuple[Mesh, ...]]:
    """The camera and the mesh of every frame; the same arguments give the same frames.

    eyes: two parallel cameras, half of EYE_DISTANCE to the left and to the right of `camera`. walk: the camera steps
    forward, turns left and widens its field of view. turn: the mesh turns about the line through `camera.target` along
    `camera.up` (about the scene's middle, walls would pass through an eye in a corner). Frame 0 of a walk and a turn is
    the view as given. Frames share a mesh that stands still.
    Raises InputError for a field of view that grows to 180 degrees.
    """
    if motion == "turn":
        return (camera,) * frames, tuple(_turned(mesh, camera, frame) for frame in range(frames))
    size = float(np.linalg.norm(mesh.bounds[1] - mesh.bounds[0]))
    if motion == "walk":
        return tuple(_walked(camera, size * STEP, frame) for frame in range(frames)), (mesh,) * frames
    aside = camera.axes[0] * (size * EYE_DISTANCE / 2)
    return (_moved(camera, -aside), _moved(camera, aside)), (mesh, mesh)


def _moved(camera: Camera, by: NDArray[np.float64]) -> Camera:
    """The camera elsewhere, looking the same way."""
    return replace(camera, eye=_vector(camera.eye + by), target=_vector(camera.target + by))


def _walked(camera: Camera, step: float, frame: int) -> Camera:
    if frame == 0:
        return camera
    view = np.subtract(camera.target, camera.eye)
    eye = camera.eye + frame * step * camera.axes[2]
    target = eye + _rotation(camera.up, frame * STEP_TURN_DEGREES) @ view
    fov_y_degrees = camera.fov_y_degrees * STEP_ZOOM**frame
    return replace(camera, eye=_vector(eye), target=_vector(target), fov_y_degrees=fov_y_degrees)


def _turned(mesh: Mesh, camera: Camera, frame: int) -> Mesh:
    if frame == 0:
        return mesh
    vertices = (mesh.vertices - np.array(camera.target)) @ _rotation(camera.up, frame * MESH_TURN_DEGREES).T
    return Mesh(vertices + camera.target, mesh.faces, name=f"{mesh.name}, frame {frame}")


def _rotation(axis: Vector, degrees: float) -> NDArray[np.float64]:
    """(3, 3): turns points counter-clockwise for who looks against `axis` (Rodrigues' formula)."""
    x, y, z = np.divide(axis, np.linalg.norm(axis))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + sin(radians(degrees)) * cross + (1 - cos(radians(degrees))) * cross @ cross


def _vector(values: NDArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z


def make_together(point: Point, mesh: Mesh, camera: Camera) -> FramesTracer:
    """All frames of the point's motion in one pass. Raises InputError and MemoryBudgetError as the tracer does."""
    asked = point.workload_options
    cameras, meshes = frames_of(camera, mesh, asked.frames, asked.motion)
    split_x, split_y = split_of(point.options)
    of_frame = Split(split_x, split_y, width=camera.width, height=camera.height)
    reference = point.options.reference
    if asked.motion == "eyes":
        alignment = Alignment.of_eyes(cameras[0], cameras[1], of_frame, reference)
    else:
        alignment = Alignment.of_frames(cameras, of_frame, reference)
    return FramesTracer(meshes, alignment, **keywords_of(FramesTracer, point.options, point.tracing))
