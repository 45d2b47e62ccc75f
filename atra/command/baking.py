"""`atra bake MESH`: a lightmap of a scene with its materials and lights, as maps, views and a model."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import closing
from math import inf
from pathlib import Path
from time import monotonic, perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from atra.command.cameras import one_camera
from atra.command.picture import add_clamp, add_limits, add_scene, add_shown, load_lit, progress_line
from atra.command.viewing import add_page
from atra.errors import InputError, printable
from atra.files.paths import write_atomically

if TYPE_CHECKING:
    from atra.geometry.camera import Camera
    from atra.light import Baker, Lightmap, Scene

SAMPLES, SIZE, BOUNCES = 256, 512, 4
"""Defaults."""

MOST_SAMPLES = 1 << 20

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
    parser.add_argument("--samples", type=int, help=f"at most so many samples of each texel (default: {SAMPLES})")
    parser.add_argument("--error", type=float, metavar="PERCENT", help="stop at this estimated error of the luminance")
    parser.add_argument("--minutes", type=float, help="stop after so many minutes; the same command goes on")
    parser.add_argument("--size", type=int, default=SIZE, help=f"texels along a side of the map (default: {SIZE})")
    parser.add_argument(
        "--charts", choices=("auto", "file", "xatlas"), default="auto",
        help="by the file's second uv or by xatlas (default: the file's, if they suit a map)",
    )  # fmt: skip
    parser.add_argument(
        "--texels-per-unit", type=float, default=0.0, metavar="N", help="as many maps as that resolution needs"
    )
    parser.add_argument("--bounces", type=int, default=BOUNCES, help=f"most reflections (default: {BOUNCES})")
    add_clamp(parser)
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
    from atra.light import Baker, atlas_of, denoised, save_lit_model, save_maps, save_model
    from atra.light.checks import check_whole, checked_number
    from atra.light.oidn import check_denoiser
    from atra.light.pictures.finish.states import read_state, write_state

    has_limit = given.error is not None or given.minutes is not None
    default = MOST_SAMPLES if has_limit else SAMPLES
    target = default if given.samples is None else given.samples
    check_whole("samples", target, 1, MOST_SAMPLES)
    for name in ("error", "minutes"):
        if getattr(given, name) is not None:
            checked_number(name, getattr(given, name), 0.0, above=True)
    if given.live and has_limit:
        raise InputError("--live bakes until its page is left; leave out --error and --minutes")
    check_whole("port", given.port, 0, 65535)
    if given.denoise:
        check_denoiser()  # now rather than after all samples
    folder = given.out or Path(f"{given.mesh.stem}_baked")
    check_keeps_input(given.mesh, folder)
    lit = load_lit(given.mesh, given.sky, given.memory_per_byte, given.sky_rotation)
    camera = one_camera(given, lit.mesh, dict(lit.cameras))
    print(f"{printable(given.mesh.name)}: charts of {lit.mesh.triangle_count:,} triangles", flush=True)
    options: dict[str, Any] = {
        "bounces": given.bounces,
        "lights": given.lights,
        "threads": given.threads,
        "clamp": given.clamp,
    }
    atlas = atlas_of(lit, given.size, given.charts, given.texels_per_unit)
    with Baker(lit, atlas, **options) as baker:
        texels = baker.texels
        print(
            f"{len(texels):,} texels in {texels.atlas.charts} charts on {texels.atlas.width} x {texels.atlas.height}, "
            f"{texels.occupancy:.0%} of the map; {texels.faces_lost} faces have none",
            flush=True,
        )
        baker.look(camera)
        state, is_done = folder / "bake.state", False
        if state.exists():
            read_state(state, baker.restore, "bake")
            print(f"atra: goes on with {printable(str(state))}", file=sys.stderr)
        start = perf_counter()
        try:
            if given.live:
                is_done = _bake_live(baker, target, given, camera)
            else:
                with progress_line() as tell:
                    is_done = bake(baker, target, tell, given.error, given.minutes)
        except KeyboardInterrupt:
            least = int(baker.samples.min())
            print(f"\ninterrupted after {least} samples of every texel; writing these", file=sys.stderr)
        if is_done:
            state.unlink(missing_ok=True)
        elif baker.samples.any():
            write_state(state, baker.state)
            print(f"atra: the same command goes on from {printable(str(state))}", file=sys.stderr)
        taken_s = perf_counter() - start
        print(f"{baker.rays:,} rays in {taken_s:.1f} s, {baker.rays / taken_s / 1e6:.2f} million a second")
        lightmap, visible = baker.maps, baker.visible
    if given.denoise:
        lightmap = denoised(lightmap, given.threads)
    views, stops = _views(lightmap, lit, camera, given, folder)
    is_gltf = given.mesh.suffix.lower() in GLTF
    written = save_maps(lightmap, folder, visible=visible) + views
    own = given.mesh if is_gltf else None
    written.append(save_model(lightmap, lit, folder / "scene.glb", own, exposure=stops, tone=given.tone))
    if is_gltf:
        written += save_lit_model(lightmap, lit, given.mesh, folder / "lit.glb")
    for path in written:
        print(f"written: {printable(str(path))}")
    return 0


def check_keeps_input(model: Path, folder: Path) -> None:
    """Raise InputError where a bake into `folder` would overwrite the model that it reads."""
    if model.name in _MODELS and model.resolve().parent == folder.resolve():
        raise InputError(f"--out {folder} would overwrite {model}, which is baked; give another folder")


def bake(baker: Baker, target: int, tell: Tell, error: float | None = None, minutes: float | None = None) -> bool:
    """Bake until the first limit; what was done after each of `TOLD` samples is worth a line.

    target: samples of each texel. error: in percent. minutes: of this run. Returns whether the error that was asked
    for is reached, or, if none was, the target.
    """
    end = inf if minutes is None else monotonic() + 60.0 * minutes
    counts = TOLD if error is None else [1 << power for power in range(target.bit_length())]
    for count in [*(one for one in counts if one < target), target]:
        while baker.advance(count, lambda: monotonic() >= end):
            tell(f"baked {baker.share_done(count):.0%} of {count} samples", False)
            if monotonic() >= end:
                return False
        reached = None if error is None else baker.error
        told = "" if reached is None else f", error about {reached:.1%}"
        tell(f"baked {count} of {target} samples{told}", True)
        if error is not None and reached is not None and reached <= error / 100.0:
            return True
    return error is None


def _views(
    lightmap: Lightmap, scene: Scene, camera: Camera, given: Namespace, folder: Path
) -> tuple[list[Path], float]:
    """Write what the camera sees, as PNG in the exposure that suits it, and in clay; returns the files, and the
    exposure in stops."""
    from atra.light import Seams, clay_view, lit_view, stops_of, toned
    from atra.light.lightmaps.finish.export import finished
    from atra.light.pictures.files import png_of
    from atra.raster.tracer import RasterTracer

    with RasterTracer(scene.mesh, camera, threads=given.threads) as tracer:
        hits = tracer.trace()
    atlas = lightmap.texels.atlas
    lit = lit_view(hits, scene, atlas, finished(lightmap, lightmap.combined, Seams.of(scene.mesh, atlas)))
    stops = stops_of(lit, "auto")
    pictures = {"view": toned(lit, stops, given.tone), "view_clay": clay_view(hits)}
    for name, picture in pictures.items():
        write_atomically(folder / f"{name}.png", png_of(picture))
    return [folder / f"{name}.png" for name in pictures], stops


def _bake_live(baker: Baker, target: int, given: Namespace, camera: Camera) -> bool:
    """Bake while the camera of a page rests, shown on it until it is closed; returns whether it is done."""
    from atra.light.viewer.lightmap import MapPainter
    from atra.light.viewer.page import Page
    from atra.light.viewer.request import Pose, Request, Settings

    pose = Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees)
    first, name = Request(pose, Settings(samples=target)), printable(given.mesh.name)
    size = float(np.linalg.norm(np.ptp(baker.scene.mesh.bounds, axis=0)))
    with closing(MapPainter(baker, target, given.threads)) as painter:
        with closing(Page(painter, first, given.port, name, size, settings=False)) as page:
            print(f"viewer: {page.address} shows {name}; Ctrl-C ends it, and what there is is written", flush=True)
            page.session.run()
        if painter.error is not None:
            raise painter.error
    return bool((baker.samples >= target).all())
