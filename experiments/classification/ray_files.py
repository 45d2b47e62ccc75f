"""`atra rays SCENE`: files of rays for other programs, with digests, and how difficult the scene is for them.

SCENE.ply has the triangles, SCENE.json the scene's own view at each size. An image of it is judged by:
atra judge image.npz --mesh rays/SCENE.ply --camera rays/SCENE.json --view middle
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from atra.all_hits.reductions import Count
from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.hits import Hits
from atra.raster.tracer import RasterTracer
from atra.rays.rays import Rays
from experiments.classification.bvh.scene import BvhScene
from experiments.classification.bvh.single import BOXES
from experiments.classification.options import BvhOptions
from experiments.classification.ray_sets import SHORTEST, ray_set, rays_between
from experiments.commands.program import COMMAND, split_options
from experiments.commands.scene_files import cameras_of, ply_of
from scenes.built_in import BUILT_IN
from scenes.generated import FAMILIES
from scenes.loading import SceneSource, load_scene
from scenes.scene import Scene
from scenes.views import VIEWS, view_fields

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


Row = dict[str, Any]
"""What is known of a file of rays or of a view, in the order of the table's columns. crossed: triangles along a ray of
the image, on average. boxes: of our own BVH that a ray of the batch enters until its nearest hit."""


def run_rays(arguments: Sequence[str]) -> list[Path]:
    """Write a file for each scene, kind and size, the scenes' triangles and own views, a list of the files of rays,
    and a list of the scenes' views, into a folder.
    Raises InputError for no scene, an unknown one, and an unknown size."""
    options, names = split_options(arguments, ("size", "output", "files"))
    sizes = options.get("size", ",".join(SIZES)).split(",")
    folder, keeps = Path(options.pop("output", "rays")), options.get("files", "true")
    is_odd = any("=" in name for name in names) or keeps not in ("true", "false")
    if not names or is_odd or not set(sizes) <= SIZES.keys():
        raise InputError(f"expected: {USAGE}")
    folder.mkdir(parents=True, exist_ok=True)
    paths, files, views = list[Path](), list[Row](), list[Row]()

    def write(name: str, content: bytes) -> None:
        paths.append(folder / name)
        write_atomically(paths[-1], content)

    for name in names:
        scene = scene_of(name)
        if keeps == "true":
            write(f"{scene.name}.ply", ply_of(scene.mesh))
            write(f"{scene.name}.json", cameras_of(scene, {size: SIZES[size] for size in sizes}))
        with BvhScene(scene.mesh, BvhOptions()) as bvh:
            for size in sizes:
                for row, rays in _ray_files(scene, size, bvh):
                    if keeps == "true":
                        write(f"{scene.name}_{row['kind']}_{size}.npz", as_bytes(rays))
                    files.append(row)
                    print(f"{scene.name}, {row['kind']}, {size}: {len(rays):,} rays, {row['boxes']:.1f} boxes a ray")
            views += [_view_row(scene, view, bvh) for view in VIEWS]
    write("rays.csv", _table(files))
    write("views.csv", _table(views))
    print(f"written: {len(paths)} files in {folder}")
    return paths


def scene_of(name: str) -> Scene:
    """A built-in scene, a generated one such as terrain_100000, or one that is in the folder of fetched scenes."""
    if name in BUILT_IN:
        return load_scene(SceneSource.procedural, name, None)
    if name.rpartition("_")[0] in FAMILIES:
        return load_scene(SceneSource.generated, name, None)
    return load_scene(SceneSource.directory, name, None)


def _seen(scene: Scene, fields: Mapping[str, Any], side: int) -> tuple[Hits, float]:
    """An image of side x side pixels, and the triangles along a ray of it, on average: depth complexity."""
    with RasterTracer(scene.mesh, Camera(**fields, width=side, height=side)) as tracer:
        return tracer.trace(), float(tracer.gather(Count()).count.mean())


def _ray_files(scene: Scene, size: str, bvh: BvhScene) -> Iterator[tuple[Row, Rays]]:
    """All kinds of one size. bvh: of the scene."""
    hits, crossed = _seen(scene, scene.camera, SIZES[size])
    for kind in KINDS:
        rays = rays_of(kind, scene.mesh, hits)
        boxes = _boxes(bvh, rays, kind in ("shadow", "ambient"))
        row = {"scene": scene.name, "triangles": scene.mesh.triangle_count, "kind": kind, "size": size,
               "rays": len(rays), "sha256": digest_of(rays), "crossed": crossed, "boxes": boxes}  # fmt: skip
        yield row, rays


def _view_row(scene: Scene, view: str, bvh: BvhScene) -> Row:
    """What is known of one of VIEWS and its primary rays. bvh: of the scene. hit: share of pixels that see anything."""
    hits, crossed = _seen(scene, view_fields(scene.mesh, scene.camera, view), SIZES["middle"])
    rays = rays_of("primary", scene.mesh, hits)
    return {"scene": scene.name, "triangles": scene.mesh.triangle_count, "mesh_sha256": scene.mesh_sha256,
            "view": view, "sha256": digest_of(rays), "hit": float(hits.hit.mean()), "crossed": crossed,
            "boxes": _boxes(bvh, rays, False)}  # fmt: skip


def _boxes(bvh: BvhScene, rays: Rays, any_hit: bool) -> float:
    """Boxes that a ray enters, on average over about `_COUNTED` of them."""
    step = max(1, len(rays) // _COUNTED)
    some = Rays(*(getattr(rays, part)[::step] for part in _PARTS))
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
        return rays_between(places, lamp - places, SHORTEST, 1.0)
    side = hits.camera.width
    if kind == "parallel":
        down, across = np.divmod(np.arange(side * side), side)
        direction = np.array([0.25, -1.0, 0.125])
        places = low + size * np.stack([(across + 0.5) / side, np.full(side * side, 1.0), (down + 0.5) / side], axis=1)
        reach = size[1] * direction
        return rays_between(places - reach, np.broadcast_to(direction, places.shape), 0.0, np.inf)
    if kind == "random":
        random = np.random.default_rng(7)
        ends = low + size * random.random((2, side * side, 3))
        return rays_between(ends[0], ends[1] - ends[0], 0.0, np.inf)
    raise InputError(f"kind of rays is {kind!r}, expected one of {', '.join(KINDS)}")


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


def _table(rows: Sequence[Row]) -> bytes:
    """A line a row, as comma-separated values. rows: at least one."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0])
    for row in rows:
        writer.writerow(f"{value:.4g}" if isinstance(value, float) else value for value in row.values())
    return text.getvalue().encode()
