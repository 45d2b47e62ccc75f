"""Point of several frames -> the tracer of all of them together, and the tracers of one frame each beside it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from atra.alignment.alignment import Alignment
from atra.alignment.split import Split
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import Agreement, compare
from atra.tracers import FramesTracer, Tracer
from atra.tracers.lifetime import Lifetime
from atra.tracers.tracer import Images
from experiments.harness.configuration import Method, Motion, Quantity
from experiments.harness.point import Point
from experiments.methods.tracing import aligned_options, make_tracer
from experiments.workloads.multiframe.motion import frames_of

SEPARATE, SEPARATE_VISIBLE = "separate", "visible_first"
"""Names in the samples of several frames: one aligned tracer a frame, and one visible-first tracer a frame."""


@dataclass(frozen=True)
class SeparateImages:
    """What tracers of one frame each return, in order."""

    images: tuple[Hits, ...]


class SeparateFrames(Lifetime):
    """One tracer a frame (there may be one frame only), one frame after the other: what the frames of a point's own
    method are measured against.

    All its times and numbers are sums over the frames.
    """

    def __init__(self, tracers: Sequence[Tracer[Hits]]) -> None:
        super().__init__()
        self.tracers = tuple(tracers)
        first = self.tracers[0]
        self.mesh, self.camera = first.mesh, first.camera
        self.packet_width, self.threads = first.packet_width, first.threads
        self.views = tuple(view for tracer in self.tracers for view in tracer.views)

    @property
    def triangle_count(self) -> int:
        return sum(tracer.triangle_count for tracer in self.tracers)

    @property
    def embree_bytes(self) -> int:
        return sum(tracer.embree_bytes for tracer in self.tracers)

    @property
    def counters(self) -> Mapping[str, float]:
        total: Counter[str] = Counter()
        for tracer in self.tracers:
            total.update(tracer.counters)
        return total

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: SeparateImages | None = None) -> SeparateImages:
        """All frames, in order. out: an earlier result that is no longer needed."""
        earlier = (None,) * len(self.tracers) if out is None else out.images
        pairs = zip(self.tracers, earlier, strict=True)
        return SeparateImages(tuple(tracer.trace(offset, hits) for tracer, hits in pairs))

    def _plan(self) -> float:
        for tracer in self.tracers:
            tracer.plan()
        return sum(tracer.plan_time_s for tracer in self.tracers)

    def _build(self) -> float:
        for tracer in self.tracers:
            tracer.build()
        return sum(tracer.build_time_s for tracer in self.tracers)

    def _release(self) -> None:
        for tracer in self.tracers:
            tracer.close()


def check_frames(point: Point) -> None:
    """Raise InputError for several frames of a method or quantity that knows only one."""
    if point.frames == 1:
        return
    if Method(point.method) is not Method.aligned:
        raise InputError(
            f"frames is {point.frames} with method={point.method}, which traces one frame; use method=aligned, which "
            "is measured beside every other way"
        )
    if Quantity(point.quantity) not in (Quantity.time, Quantity.memory):
        raise InputError(
            f"frames is {point.frames} with measure.quantity={point.quantity}, expected time or memory: the others are "
            "of one frame"
        )


def make_own_tracer(point: Point, mesh: Mesh, camera: Camera, split: tuple[int, int] | None = None) -> Tracer:
    """As `make_tracer`; of several frames, which `point.motion` makes of mesh and camera, all in one pass.

    Raises InputError and MemoryBudgetError as the tracers do.
    """
    if point.motion is None:
        return make_tracer(point, mesh, camera, split)
    motion = Motion(point.motion)
    cameras, meshes = frames_of(camera, mesh, point.frames, motion)
    of_frame = Split(*(split or (point.split_x, point.split_y)), width=camera.width, height=camera.height)
    if motion is Motion.eyes:
        alignment = Alignment.of_eyes(cameras[0], cameras[1], of_frame)
    else:
        alignment = Alignment.of_frames(cameras, of_frame)
    return FramesTracer(meshes, alignment, **aligned_options(point))


def make_for_each_frame(own: Tracer, make: Callable[[Mesh, View], Tracer[Hits]]) -> SeparateFrames:
    """What `make` makes of the mesh and the camera of each frame of `own`, which may be of one frame alone."""
    return SeparateFrames([make(mesh, camera) for mesh, camera in own.views])


def separate_methods(point: Point) -> dict[str, Callable[..., Tracer]]:
    """How one frame is traced alone with the point's split, by name in the samples; arguments as of `make_tracer`.

    Empty for a point of one frame. Each frame alone has the whole of the point's memory budget.
    """
    if point.frames == 1:
        return {}
    one = replace(point, frames=1, motion=None)
    visible = replace(one, method=Method.visible_first.value, geometry="copied", culling=True)
    return {SEPARATE: partial(make_tracer, one), SEPARATE_VISIBLE: partial(make_tracer, visible)}


def compare_images(found: Images, references: Images) -> list[Agreement]:
    """`compare` of every frame."""
    pairs = zip(found.images, references.images, strict=True)
    return [compare(hits.mesh, hits.camera, hits, reference) for hits, reference in pairs]
