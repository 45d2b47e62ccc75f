from .alignment.aligned import AlignedTracer as AlignedTracer
from .alignment.alignment import Alignment as Alignment
from .alignment.frames import FramesTracer as FramesTracer
from .alignment.visible_first import VisibleFirstTracer as VisibleFirstTracer
from .all_hits.reductions import (
    Count as Count,
)
from .all_hits.reductions import (
    Layers as Layers,
)
from .all_hits.reductions import (
    Thickness as Thickness,
)
from .all_hits.reductions import (
    Transmittance as Transmittance,
)
from .all_hits.results import (
    CountResult as CountResult,
)
from .all_hits.results import (
    LayersResult as LayersResult,
)
from .all_hits.results import (
    ThicknessResult as ThicknessResult,
)
from .all_hits.results import (
    TransmittanceResult as TransmittanceResult,
)
from .errors import (
    AtraError as AtraError,
)
from .errors import (
    ClosedError as ClosedError,
)
from .errors import (
    EmbreeError as EmbreeError,
)
from .errors import (
    InputError as InputError,
)
from .errors import (
    MemoryBudgetError as MemoryBudgetError,
)
from .errors import (
    StorageError as StorageError,
)
from .files.cameras.bop import read_bop as read_bop
from .files.cameras.calibration_files import read_calibration as read_calibration
from .files.cameras.colmap import read_colmap as read_colmap
from .files.cameras.nerf import read_transforms as read_transforms
from .files.cameras.trimesh import cameras_from_trimesh as cameras_from_trimesh
from .files.meshes.loading import FaceSources as FaceSources
from .files.meshes.loading import load_face_sources as load_face_sources
from .files.meshes.loading import load_mesh as load_mesh
from .geometry.camera import CalibratedCamera as CalibratedCamera
from .geometry.camera import Camera as Camera
from .geometry.camera import LensCamera as LensCamera
from .geometry.image_plane import ImagePlane as ImagePlane
from .geometry.lenses.models import (
    EquirectangularLens as EquirectangularLens,
)
from .geometry.lenses.models import (
    FisheyeLens as FisheyeLens,
)
from .geometry.lenses.models import (
    FovLens as FovLens,
)
from .geometry.lenses.models import (
    OpenCVLens as OpenCVLens,
)
from .geometry.mesh import Mesh as Mesh
from .geometry.orthographic import OrthographicCamera as OrthographicCamera
from .geometry.split import Split as Split
from .hits import Frames as Frames
from .hits import Hits as Hits
from .hits import VisibleTriangles as VisibleTriangles
from .judge.compare import Agreement as Agreement
from .judge.compare import Verdict as Verdict
from .judge.compare import compare as compare
from .judge.conventions import Convention as Convention
from .judge.foreign import (
    ForeignImage as ForeignImage,
)
from .judge.foreign import (
    ForeignJudgement as ForeignJudgement,
)
from .judge.foreign import (
    judge_image as judge_image,
)
from .methods import trace as trace
from .packets.pixel import PixelTracer as PixelTracer
from .prim_ids import MISS as MISS
from .raster.tracer import RasterTracer as RasterTracer
from .rays.all_hits.gathered import RayLayers as RayLayers
from .rays.all_hits.lists import RayHitLists as RayHitLists
from .rays.rays import RayHits as RayHits
from .rays.rays import Rays as Rays
from .rays.scene import RayScene as RayScene
from .tracing.method import Method as Method
from .tracing.method import Prepared as Prepared
from .tracing.tracer import Tracer as Tracer
from .views.face_counts import FaceCounts as FaceCounts
from .views.face_counts import face_counts as face_counts
from .views.orbit import orbit as orbit
from .views.render_views import render_views as render_views
from .views.sampling import sub_pixel_offsets as sub_pixel_offsets
from .views.visible_points import visible_points as visible_points

__version__: str
