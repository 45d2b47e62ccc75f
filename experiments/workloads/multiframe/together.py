"""All frames of a point, traced together in one pass."""

from __future__ import annotations

from atra.alignment.aligned import FramesTracer
from atra.alignment.alignment import Alignment, Split
from atra.alignment.options import FramesOptions
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from experiments.harness.point import Point
from experiments.workloads.multiframe import Motion
from experiments.workloads.multiframe.motion import frames_of


def make_together(point: Point, mesh: Mesh, camera: Camera) -> FramesTracer:
    """All frames, which the point's motion makes of mesh and camera, in one pass.

    Raises InputError and MemoryBudgetError as the tracer does.
    """
    asked = point.workload_options
    cameras, meshes = frames_of(camera, mesh, asked.frames, asked.motion)
    split_x, split_y = point.options.split
    of_frame = Split(split_x, split_y, width=camera.width, height=camera.height)
    reference = point.options.reference
    if asked.motion is Motion.eyes:
        alignment = Alignment.of_eyes(cameras[0], cameras[1], of_frame, reference)
    else:
        alignment = Alignment.of_frames(cameras, of_frame, reference)
    return FramesTracer(meshes, alignment, **point.options.keywords(point.tracing, FramesOptions))
