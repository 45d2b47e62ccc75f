"""Affine-transformed ray alignment on Embree: exact primary visibility from fewer rays.

    with atra.AlignedTracer(mesh, camera, split=(128, 1)) as tracer:
        hits = tracer.trace()

Source: Y. Nishidate, I. Fujishiro, "Affine-transformed ray alignment for accelerating primary ray traversal -
Implementation with Embree".
"""

from atra.alignment.alignment import Alignment
from atra.alignment.split import Split
from atra.errors import AtraError, EmbreeError, InputError, MemoryBudgetError
from atra.frames import Frames
from atra.gathering.gathered import Counts, LayerHits, Thicknesses, Transmittances
from atra.gathering.reductions import Count, Layers, Thickness, Transmittance
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.mesh_file import load_mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.sampling import sub_pixel_offsets
from atra.hits import Hits
from atra.judge.compare import Agreement, Verdict, compare
from atra.options import (
    AlignedOptions,
    CellOptions,
    Options,
    PixelOptions,
    RasterOptions,
    RayOptions,
    ReferenceRayOptions,
)
from atra.planner.plan import Plan
from atra.planner.planning import plan
from atra.prim_ids import MISS
from atra.rays.rays import RayHits, Rays
from atra.rays.scene import RayScene
from atra.tracers import (
    AlignedTracer,
    FramesTracer,
    PixelTracer,
    RasterTracer,
    TiledTracer,
    Tracer,
    VisibleFirstTracer,
)

__version__ = "0.1.0"

__all__ = [
    "MISS",
    "Agreement",
    "AlignedOptions",
    "AlignedTracer",
    "Alignment",
    "AtraError",
    "Camera",
    "CellOptions",
    "Count",
    "Counts",
    "EmbreeError",
    "Frames",
    "FramesTracer",
    "Hits",
    "InputError",
    "LayerHits",
    "Layers",
    "MemoryBudgetError",
    "Mesh",
    "Options",
    "OrthographicCamera",
    "PixelOptions",
    "PixelTracer",
    "Plan",
    "RasterOptions",
    "RasterTracer",
    "RayHits",
    "RayOptions",
    "RayScene",
    "Rays",
    "ReferenceRayOptions",
    "Split",
    "Thickness",
    "Thicknesses",
    "TiledTracer",
    "Tracer",
    "Transmittance",
    "Transmittances",
    "Verdict",
    "VisibleFirstTracer",
    "compare",
    "load_mesh",
    "plan",
    "sub_pixel_offsets",
]
