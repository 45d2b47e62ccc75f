"""`atra rays SCENE`: files of rays for other programs, with digests, and how difficult the scene is for them.

SCENE.ply has the triangles, SCENE.json the scene's own view at each size. An image of it is judged by:
atra judge image.npz --mesh rays/SCENE.ply --camera rays/SCENE.json --view middle
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from atra.all_hits.reductions import Count
from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.hits import Hits
from atra.raster.tracer import RasterTracer
from atra.rays.rays import Rays
from experiments.classification.ray_sets import SHORTEST, ray_set
from experiments.commands.program import COMMAND, split_options
from experiments.commands.scene_files import cameras_of, ply_of
from scenes.built_in import BUILT_IN
from scenes.generated import FAMILIES
from scenes.loading import SceneSource, load_scene
from scenes.scene import Scene
from scenes.views import VIEWS, view_fields

if TYPE_CHECKING:
    from experiments.classification.bvh.scene import BvhScene

SIZES = {"small": 64, "middle": 256, "large": 1024}
"""Pixels along each side of the image that the rays are of."""

OF_IMAGE = {"primary": "primary", "ambient": "occlusion", "bounces": "diffuse"}
"""Kind of a file -> kind of `ray_sets.ray_set`."""

KINDS = ("primary", "shadow", "ambient", "bounces", "parallel", "random")
"""Rays of the image's pixels; from what they hit to a lamp under the ceiling, as any hit will do; the same to places
nearby; one bounce; side by side along one direction; and from anywhere to anywhere."""

_COUNTED = 1 << 14
"""Rays of a batch, about, whose boxes are counted."""

USAGE = (
    f"{COMMAND} rays cornell_box terrain_100000 [size=small,middle,large] [output=FOLDER] [files=false]; "
    "with files=false only the tables of digests and difficulty are written"
)


@dataclass(frozen=True)
class RayFile:
    """A batch of rays and what is known of it. crossed: triangles along a ray of the image, on average. boxes: of our
    own BVH that a ray of the batch enters until its nearest hit."""

    scene: str
    triangles: int
    kind: str
    size: str
    rays: int
    sha256: str
    crossed: float
    boxes: float

    @property
    def name(self) -> str:
        return f"{self.scene}_{self.kind}_{self.size}.npz"


@dataclass(frozen=True)
class ViewOfScene:
    """A view of a scene, one of `scenes.views.VIEWS`, as an image of 256 x 256 pixels.

    sha256: of its primary rays. hit: share of pixels that see a triangle. crossed, boxes: as of RayFile, primary rays.
    """

    scene: str
    triangles: int
    mesh_sha256: str
    view: str
    sha256: str
    hit: float
    crossed: float
    boxes: float


def run_rays(arguments: Sequence[str]) -> list[Path]:
    """Write a file for each scene, kind and size, the scenes' triangles and own views, a list of the files of rays,
    and a list of the scenes' views, into a folder.
    Raises InputError for no scene, an unknown one, and an unknown size."""
    from experiments.classification.bvh.scene import BvhScene

    options, names = split_options(arguments, ("size", "output", "files"))
    sizes = options.get("size", ",".join(SIZES)).split(",")
    folder = Path(options.pop("output", "rays"))
    keeps = options.get("files", "true")
    is_odd = any("=" in one for one in names) or keeps not in ("true", "false")
    if not names or is_odd or not set(sizes) <= SIZES.keys():
        raise InputError(f"expected: {USAGE}")
    folder.mkdir(parents=True, exist_ok=True)
    paths: list[Path] = []
    files: list[RayFile] = []
    views: list[ViewOfScene] = []
    for name in names:
        scene = scene_of(name)
        if keeps == "true":
            whole = {f"{scene.name}.ply": ply_of(scene.mesh), f"{scene.name}.json": cameras_of(scene, _chosen(sizes))}
            for file, content in whole.items():
                write_atomically(folder / file, content)
                paths.append(folder / file)
                print(f"{file}: {len(content):,} bytes")
        with BvhScene(scene.mesh) as bvh:
            for size in sizes:
                for one, rays in ray_files(scene, size, bvh):
                    if keeps == "true":
                        paths.append(folder / one.name)
                        write_atomically(paths[-1], as_bytes(rays))
                    files.append(one)
                    print(f"{one.name}: {one.rays:,} rays, {one.boxes:.1f} boxes a ray, sha256 {one.sha256[:16]}")
            views += [view_of(scene, view, bvh) for view in VIEWS]
    tables = {folder / "rays.csv": table_of(files), folder / "views.csv": table_of(views)}
    for path, content in tables.items():
        write_atomically(path, content)
        print(f"written: {path}")
    return [*paths, *tables]


def _chosen(sizes: Sequence[str]) -> Mapping[str, int]:
    return {size: SIZES[size] for size in sizes}


def scene_of(name: str) -> Scene:
    """A built-in scene, a generated one such as terrain_100000, or one that is in the folder of fetched scenes."""
    if name in BUILT_IN:
        return load_scene(SceneSource.procedural, name, None)
    if name.rpartition("_")[0] in FAMILIES:
        return load_scene(SceneSource.generated, name, None)
    return load_scene(SceneSource.directory, name, None)


def ray_files(scene: Scene, size: str, bvh: BvhScene) -> Iterator[tuple[RayFile, Rays]]:
    """All kinds of one size. bvh: of the scene."""
    mesh, side = scene.mesh, SIZES[size]
    with RasterTracer(mesh, Camera(**scene.camera, width=side, height=side)) as tracer:
        hits = tracer.trace()
        crossed = _crossed(tracer)
    for kind in KINDS:
        rays = rays_of(kind, mesh, hits)
        boxes = _boxes(bvh, rays, kind in ("shadow", "ambient"))
        yield RayFile(scene.name, mesh.triangle_count, kind, size, len(rays), digest_of(rays), crossed, boxes), rays


def view_of(scene: Scene, view: str, bvh: BvhScene) -> ViewOfScene:
    """What is known of one of VIEWS. bvh: of the scene."""
    mesh, side = scene.mesh, SIZES["middle"]
    with RasterTracer(mesh, Camera(**view_fields(mesh, scene.camera, view), width=side, height=side)) as tracer:
        hits = tracer.trace()
        crossed = _crossed(tracer)
    rays = rays_of("primary", mesh, hits)
    share = float(hits.hit.mean())
    boxes = _boxes(bvh, rays, False)
    return ViewOfScene(scene.name, mesh.triangle_count, scene.mesh_sha256, view, digest_of(rays), share, crossed, boxes)


def _crossed(tracer: RasterTracer) -> float:
    """Triangles along a ray of the image, on average: depth complexity."""
    return float(tracer.gather(Count()).count.mean())


def _boxes(bvh: BvhScene, rays: Rays, any_hit: bool) -> float:
    """Boxes that a ray enters, on average over about `_COUNTED` of them."""
    from experiments.classification.bvh.single import BOXES

    some = _every(rays, max(1, len(rays) // _COUNTED))
    _, counts = bvh.count(bvh.prepare(some), any_hit)
    return float(counts[BOXES]) / max(len(some), 1)


def rays_of(kind: str, mesh: Mesh, hits: Hits) -> Rays:
    """One of KINDS. hits: the image of the mesh whose pixels they start from, or of which there are as many."""
    if kind in OF_IMAGE:
        return ray_set(OF_IMAGE[kind], mesh, hits.camera, hits)
    low, size = mesh.bounds[0].astype(np.float64), np.ptp(mesh.bounds, axis=0).astype(np.float64)
    if kind == "shadow":
        places = hits.points[hits.hit].astype(np.float64)
        lamp = low + size * (0.5, 0.9, 0.5)
        return _rays(places, lamp - places, SHORTEST, 1.0)
    side = hits.camera.width
    if kind == "parallel":
        down, across = np.divmod(np.arange(side * side), side)
        direction = np.array([0.25, -1.0, 0.125])
        places = low + size * np.stack([(across + 0.5) / side, np.full(side * side, 1.0), (down + 0.5) / side], axis=1)
        reach = size[1] * direction
        return _rays(places - reach, np.broadcast_to(direction, places.shape), 0.0, np.inf)
    if kind == "random":
        random = np.random.default_rng(7)
        ends = low + size * random.random((2, side * side, 3))
        return _rays(ends[0], ends[1] - ends[0], 0.0, np.inf)
    raise InputError(f"kind of rays is {kind!r}, expected one of {', '.join(KINDS)}")


def _rays(origins: np.ndarray, directions: np.ndarray, tnear: float, tfar: float) -> Rays:
    ends = (np.full(len(origins), end, np.float32) for end in (tnear, tfar))
    return Rays(origins.astype(np.float32), directions.astype(np.float32), *ends)


def _every(rays: Rays, step: int) -> Rays:
    return Rays(rays.origins[::step], rays.directions[::step], rays.tnear[::step], rays.tfar[::step])


_PARTS = ("origins", "directions", "tnear", "tfar")


def digest_of(rays: Rays) -> str:
    """SHA-256 of origins, directions, tnear and tfar, float32 little-endian, one array after the other."""
    digest = hashlib.sha256()
    for part in _PARTS:
        digest.update(np.ascontiguousarray(getattr(rays, part), "<f4").tobytes())
    return digest.hexdigest()


def as_bytes(rays: Rays) -> bytes:
    """An NPZ file with the four arrays by name."""
    buffer = io.BytesIO()
    np.savez(buffer, **{part: getattr(rays, part) for part in _PARTS})
    return buffer.getvalue()


def table_of(rows: Sequence[RayFile] | Sequence[ViewOfScene]) -> bytes:
    """A line a row, as comma-separated values. rows: at least one."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(vars(rows[0]))
    for one in rows:
        told = (f"{value:.4g}" if isinstance(value, float) else value for value in vars(one).values())
        writer.writerow(told)
    return text.getvalue().encode()
