"""`atra bake MESH`: a lightmap of a scene with its materials and lights, as maps, views and a model."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from atra.command.cameras import one_camera
from atra.command.picture import add_limits, add_scene, add_shown, load_lit, progress_line
from atra.command.viewing import add_page
from atra.errors import InputError, printable
from atra.files.paths import write_atomically

if TYPE_CHECKING:
    from atra.geometry.camera import Camera
    from atra.light import Baker, Lightmap, Scene

SAMPLES, SIZE, BOUNCES = 256, 512, 4
"""Defaults."""

TOLD = (1, 16, 256)
"""Samples after which a bake says how far it is, where it does not write on a terminal."""

GLTF = (".glb", ".gltf")

_MODELS = ("scene.glb", "lit.glb")
"""Names of the models that a bake writes."""

Tell = Callable[[str, bool], None]


def add_bake(parser: ArgumentParser) -> None:
    """Add the arguments of `run_bake`."""
    parser.usage = "atra bake MESH [--option value ...], as in: atra bake room.glb --size 512"
    add_scene(parser)
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="folder of the files (default: MESH_baked)")
    parser.add_argument("--samples", type=int, default=SAMPLES, help=f"samples of each texel (default: {SAMPLES})")
    parser.add_argument("--size", type=int, default=SIZE, help=f"texels along a side of the map (default: {SIZE})")
    parser.add_argument("--bounces", type=int, default=BOUNCES, help=f"most reflections (default: {BOUNCES})")
    parser.add_argument(
        "--lights", choices=("aimed", "grid"), default="aimed",
        help="choice of lamps: by their power, or by what each gives near a surface; grid has less noise with hundreds "
        "of lamps (default: aimed)",
    )  # fmt: skip
    parser.add_argument("--live", action="store_true", help="show the map on a page while it bakes (extra viewer)")
    add_page(parser)
    add_shown(parser)
    add_limits(parser)


def run_bake(given: Namespace) -> int:
    """Bake, what the view shows first, and write maps, view and models; returns 0. Ctrl-C writes what there is.

    Raises InputError for files that cannot be used, and as `Baker`, `denoised` and `Page` do; StorageError.
    """
    from atra.light import Atlas, Baker, denoised, save_lit_model, save_maps, save_model
    from atra.light.checks import check_whole
    from atra.light.oidn import check_denoiser

    check_whole("samples", given.samples, 1, 1 << 20)
    check_whole("port", given.port, 0, 65535)
    if given.denoise:
        check_denoiser()  # now rather than after all samples
    folder = given.out or Path(f"{given.mesh.stem}_baked")
    check_keeps_input(given.mesh, folder)
    lit = load_lit(given.mesh, given.sky, given.memory_per_byte)
    camera = one_camera(given, lit.mesh, dict(lit.cameras))
    print(f"{printable(given.mesh.name)}: charts of {lit.mesh.triangle_count:,} triangles", flush=True)
    options: dict[str, Any] = {"bounces": given.bounces, "lights": given.lights, "threads": given.threads}
    with Baker(lit, Atlas.unwrap(lit.mesh, given.size), **options) as baker:
        texels = baker.texels
        print(
            f"{len(texels):,} texels in {texels.atlas.charts} charts on {texels.atlas.width} x {texels.atlas.height}, "
            f"{texels.occupancy:.0%} of the map; {texels.faces_lost} faces have none",
            flush=True,
        )
        baker.look(camera)
        start = perf_counter()
        try:
            if given.live:
                _bake_live(baker, given, camera)
            else:
                with progress_line() as tell:
                    bake(baker, given.samples, tell)
        except KeyboardInterrupt:
            least = int(baker.samples.min())
            print(f"\ninterrupted after {least} samples of every texel; writing these", file=sys.stderr)
        taken_s = perf_counter() - start
        print(f"{baker.rays:,} rays in {taken_s:.1f} s, {baker.rays / taken_s / 1e6:.2f} million a second")
        lightmap, visible = baker.maps, baker.visible
    if given.denoise:
        lightmap = denoised(lightmap, given.threads)
    written = save_maps(lightmap, folder, visible=visible) + _view(lightmap, lit, camera, given, folder)
    written.append(save_model(lightmap, lit, folder / "scene.glb"))
    if given.mesh.suffix.lower() in GLTF:
        written += save_lit_model(lightmap, lit, given.mesh, folder / "lit.glb")
    for path in written:
        print(f"written: {printable(str(path))}")
    return 0


def check_keeps_input(model: Path, folder: Path) -> None:
    """Raise InputError where a bake into `folder` would overwrite the model that it reads."""
    if model.name in _MODELS and model.resolve().parent == folder.resolve():
        raise InputError(f"--out {folder} would overwrite {model}, which is baked; give another folder")


def bake(baker: Baker, target: int, tell: Tell) -> None:
    """Bake to the target; what was done after each of `TOLD` samples is worth a line."""
    for count in [*(one for one in TOLD if one < target), target]:
        while baker.advance(count):
            tell(f"baked {baker.share_done(target):.0%}", False)
        tell(f"baked {baker.share_done(target):.0%}, {count} of {target} samples", True)


def _view(lightmap: Lightmap, scene: Scene, camera: Camera, given: Namespace, folder: Path) -> list[Path]:
    """Write what the camera sees, as PNG in the exposure that suits it, and in clay."""
    from atra.light import Seams, clay_view, lit_view, stops_of, toned
    from atra.light.lightmaps.finish.export import finished
    from atra.light.pictures.files import png_of
    from atra.raster.tracer import RasterTracer

    with RasterTracer(scene.mesh, camera, threads=given.threads) as tracer:
        hits = tracer.trace()
    atlas = lightmap.texels.atlas
    lit = lit_view(hits, scene, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    pictures = {"view": toned(lit, stops_of(lit, "auto"), given.tone), "view_clay": clay_view(hits)}
    for name, picture in pictures.items():
        write_atomically(folder / f"{name}.png", png_of(picture))
    return [folder / f"{name}.png" for name in pictures]


def _bake_live(baker: Baker, given: Namespace, camera: Camera) -> None:
    """Bake while the camera of a page rests, shown on it until it is closed."""
    from atra.light.viewer.lightmap import MapPainter
    from atra.light.viewer.page import Page
    from atra.light.viewer.request import Pose, Request, Settings

    pose = Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees)
    first, name = Request(pose, Settings(samples=given.samples)), printable(given.mesh.name)
    size = float(np.linalg.norm(np.ptp(baker.scene.mesh.bounds, axis=0)))
    with closing(MapPainter(baker, given.samples, given.threads)) as painter:
        with closing(Page(painter, first, given.port, name, size, settings=False)) as page:
            print(f"viewer: {page.address} shows {name}; Ctrl-C ends it, and what there is is written", flush=True)
            page.session.run()
        if painter.error is not None:
            raise painter.error
