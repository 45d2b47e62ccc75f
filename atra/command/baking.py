"""`atra bake MESH`: a lightmap of a scene with its materials and lights, as maps, views and a model."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from atra.command.cameras import one_camera
from atra.command.picture import add_limits, add_scene, add_shown, load_lit, progress_line
from atra.command.viewing import add_page
from atra.errors import printable
from atra.files.paths import write_atomically

if TYPE_CHECKING:
    from atra.geometry.camera import Camera
    from atra.hits import Hits
    from atra.light import Baker, BakeScene, Lightmap, Seams

SAMPLES, SIZE, BOUNCES = 256, 512, 4
"""Defaults."""

SHOWN = (1, 16, 256)
"""Samples after which the view is kept to be looked at, beside that of the finished map."""

GLTF = (".glb", ".gltf")

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
        "--lights", choices=("uniform", "grid"), default="uniform",
        help="choice of lights at a reflection; grid has less noise with hundreds of lights, and takes all surfaces as "
        "dull (default: uniform)",
    )  # fmt: skip
    parser.add_argument("--live", action="store_true", help="show the map on a page while it bakes (extra viewer)")
    add_page(parser)
    add_shown(parser)
    add_limits(parser)


def run_bake(given: Namespace) -> int:
    """Bake, what the view shows first, and write maps, views and models; returns 0. Interrupted, it writes what there
    is.

    Raises InputError for files that cannot be used, and as `Baker`, `denoised` and `LightmapPage` do; StorageError.
    """
    from atra.light import Atlas, Baker, BakeScene, Seams, denoised, save_lit_model, save_maps, save_model
    from atra.light.checks import check_whole
    from atra.light.oidn import check_denoiser

    check_whole("samples", given.samples, 1, 1 << 20)
    check_whole("port", given.port, 0, 65535)
    if given.denoise:
        check_denoiser()  # now rather than after all samples
    folder = given.out or Path(f"{given.mesh.stem}_baked")
    lit = load_lit(given.mesh, given.sky, given.memory_per_byte)
    camera = one_camera(given, lit.mesh, dict(lit.cameras))
    scene = BakeScene.of(lit)
    print(f"{printable(given.mesh.name)}: charts of {lit.mesh.triangle_count:,} triangles", flush=True)
    options: dict[str, Any] = {"bounces": given.bounces, "lights": given.lights, "threads": given.threads}
    with Baker(lit if given.lights == "uniform" else scene, Atlas.unwrap(lit.mesh, given.size), **options) as baker:
        texels = baker.texels
        print(
            f"{len(texels):,} texels in {texels.atlas.charts} charts on {texels.atlas.width} x {texels.atlas.height}, "
            f"{texels.occupancy:.0%} of the map; {texels.faces_lost} faces have none",
            flush=True,
        )
        views = Views(camera, scene, given.tone, given.threads)
        baker.look(camera)
        start = perf_counter()
        try:
            if given.live:
                _bake_live(baker, scene, given, camera)
            else:
                with progress_line() as tell:
                    bake(baker, given.samples, views, tell)
        except KeyboardInterrupt:
            least = int(baker.samples.min())
            print(f"\ninterrupted after {least} samples of every texel; writing these", file=sys.stderr)
        taken_s = perf_counter() - start
        print(f"{baker.rays:,} rays in {taken_s:.1f} s, {baker.rays / taken_s / 1e6:.2f} million a second")
        lightmap, visible = baker.maps, baker.visible
    if given.denoise:
        lightmap = denoised(lightmap, given.threads)
    views.keep("view", lightmap, Seams.of(scene.mesh, lightmap.texels.atlas))
    written = save_maps(lightmap, folder, visible=visible) + views.save(folder)
    written.append(save_model(lightmap, scene, folder / "scene.glb"))
    if given.mesh.suffix.lower() in GLTF:
        written += save_lit_model(lightmap, lit, given.mesh, folder / "lit.glb")
    for path in written:
        print(f"written: {printable(str(path))}")
    return 0


class Views:
    """What a camera sees of a scene whose map converges, kept by name as (H, W, 3) linear light."""

    def __init__(self, camera: Camera, scene: BakeScene, tone: str, threads: int | None = None) -> None:
        from atra.raster.tracer import RasterTracer

        with RasterTracer(scene.mesh, camera, threads=threads) as tracer:
            self.hits: Hits = tracer.trace()
        self._scene, self._tone = scene, tone
        self.pictures: dict[str, Any] = {}

    def keep(self, name: str, lightmap: Lightmap, seams: Seams | None = None) -> None:
        """The view as the map shows it now."""
        from atra.light import lit_view
        from atra.light.lightmaps.finish.export import finished

        image = finished(lightmap, lightmap.combined, seams)
        self.pictures[name] = lit_view(self.hits, self._scene, lightmap.texels.atlas, image)

    def save(self, folder: Path) -> list[Path]:
        """Write each as PNG, in the exposure that suits the last, and one in clay."""
        from atra.light import clay_view, stops_of, toned
        from atra.light.pictures.files import png_of

        stops = stops_of(list(self.pictures.values())[-1], "auto")
        files = {name: toned(picture, stops, self._tone) for name, picture in self.pictures.items()}
        files["view_clay"] = clay_view(self.hits)
        for name, picture in files.items():
            write_atomically(folder / f"{name}.png", png_of(picture))
        return [folder / f"{name}.png" for name in files]


def bake(baker: Baker, target: int, views: Views, tell: Tell) -> None:
    """Bake to the target, keeping the view after `SHOWN` samples."""
    for count in [*(one for one in SHOWN if one < target), target]:
        while baker.advance(count):
            tell(f"baked {baker.share_done(target):.0%}", False)
        if count < target:
            views.keep(f"view_{count}", baker.maps)
        tell(f"baked {baker.share_done(target):.0%}, {count} of {target} samples", True)


def _bake_live(baker: Baker, scene: BakeScene, given: Namespace, camera: Camera) -> None:
    """Bake in a thread, shown on a page until that is closed."""
    from atra.light import ProgressiveBake
    from atra.light.viewer.lightmap import LightmapPage
    from atra.light.viewer.request import Pose

    first = Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees)
    progress, name = ProgressiveBake(baker, given.samples), printable(given.mesh.name)
    shown = progress, scene, baker.texels.atlas, given.samples
    page = LightmapPage(*shown, first=first, port=given.port, title=name, threads=given.threads)
    with closing(page), progress:
        print(f"viewer: {page.address} shows {name}; Ctrl-C ends it, and what there is is written", flush=True)
        page.run()
