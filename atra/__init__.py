"""Affine-transformed ray alignment on Embree: exact primary visibility from fewer rays.

    with atra.AlignedTracer(mesh, camera, split=(128, 1)) as tracer:
        hits = tracer.trace()

Source: Y. Nishidate, I. Fujishiro, "Affine-transformed ray alignment for accelerating primary ray traversal -
Implementation with Embree".
"""

from atra.alignment.aligned import AlignedTracer, FramesTracer
from atra.alignment.alignment import Alignment
from atra.alignment.options import AlignedOptions, FramesOptions, ReferenceRayOptions
from atra.alignment.visible_first import VisibleFirstTracer
from atra.all_hits.reductions import Count, Layers, Thickness, Transmittance
from atra.all_hits.results import Counts, LayerHits, Thicknesses, Transmittances
from atra.bvh.options import BvhOptions
from atra.bvh.tracer import BvhTracer
from atra.errors import AtraError, ClosedError, EmbreeError, InputError, MemoryBudgetError
from atra.files.cameras.colmap import read_colmap
from atra.files.cameras.nerf import read_transforms
from atra.files.cameras.trimesh_scene import read_trimesh
from atra.files.meshes.face_sources import FaceSources, load_face_sources
from atra.files.meshes.loading import load_mesh
from atra.geometry.camera import CalibratedCamera, Camera
from atra.geometry.image_plane import ImagePlane
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.sampling import sub_pixel_offsets
from atra.geometry.split import Split
from atra.hits import Frames, Hits, VisibleTriangles
from atra.judge.compare import Agreement, Verdict, compare
from atra.packets.pixel import PixelTracer
from atra.packets.tiles import TiledTracer
from atra.planner.plan import Plan
from atra.planner.planning import plan
from atra.prim_ids import MISS
from atra.raster.tracer import RasterTracer
from atra.rays.rays import RayHits, Rays
from atra.rays.scene import RayScene
from atra.tracing.options import CellOptions, Options, PixelOptions, RasterOptions, RayOptions
from atra.tracing.tracer import Tracer
from atra.views.render_views import render_views

__version__ = "0.1.0"

__all__ = [
    "MISS",
    "Agreement",
    "AlignedOptions",
    "AlignedTracer",
    "Alignment",
    "AtraError",
    "BvhOptions",
    "BvhTracer",
    "CalibratedCamera",
    "Camera",
    "CellOptions",
    "ClosedError",
    "Count",
    "Counts",
    "EmbreeError",
    "FaceSources",
    "Frames",
    "FramesOptions",
    "FramesTracer",
    "Hits",
    "ImagePlane",
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
    "VisibleTriangles",
    "compare",
    "load_face_sources",
    "load_mesh",
    "plan",
    "read_colmap",
    "read_transforms",
    "read_trimesh",
    "render_views",
    "sub_pixel_offsets",
]
