"""Verbs that make a file: `render`, one picture; `bake`, a lightmap. Both show how far they are."""

from __future__ import annotations

import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from atra.command.picture import add_picture, load_lit, say_written
from atra.files.paths import write_atomically
from atra.hits import Hits
from atra.light import (
    Baker,
    BakeScene,
    Lightmap,
    ProgressiveBake,
    Scene,
    Seams,
    clay_view,
    denoised,
    lit_view,
    save_lit_model,
    save_maps,
    save_model,
)
from atra.light.checks import check_one_of
from atra.light.lightmaps.finish.export import finished
from atra.light.oidn import check_denoiser
from atra.light.pictures.files import check_picture_path, png_of
from atra.light.pictures.finish.tone import AUTO, TONES, check_exposure, stops_of, toned
from experiments.commands.messages import tell_restriction
from experiments.harness.configuration import Configuration
from experiments.harness.point import Point, make_own
from experiments.harness.points import plan_point
from experiments.harness.progress import say, say_duration
from experiments.harness.records import check_writable
from experiments.workloads.render import RENDER
from experiments.workloads.render.measure import make_renderer
from experiments.workloads.rounds import load_mesh
from scenes.lit.lighting import lit, why_grey


def picture_arguments(given: Sequence[str]) -> list[str]:
    """Arguments of the verb as those of a configuration: fields of the workload may be set without its name before
    them, and a picture by paths may be asked for by the options that `atra render` has for files."""
    own = {one.name for one in fields(RENDER.options)}
    parser = ArgumentParser("atra render scene=NAME", add_help=False, allow_abbrev=False)
    add_picture(parser)
    asked, rest = parser.parse_known_args(list(given))
    plain = [f"workload.{one}" if one.partition("=")[0] in own else one for one in rest]
    if len(rest) == len(given):
        return plain
    if asked.error is not None or asked.minutes is not None:
        parser.error("--error and --minutes are for files; give --samples")
    values = {
        "output": asked.output, "workload.samples": asked.samples, "workload.sky": asked.sky,
        "workload.frame": "path", "workload.max_depth": asked.bounces,
        "view.exposure": asked.exposure, "view.tone": asked.tone, "view.denoise": asked.denoise,
    }  # fmt: skip
    return [*(f"{name}={value}" for name, value in values.items() if value is not None), *plain]


def run_picture(configuration: Configuration) -> Path:
    """Make the picture, showing how far it is and when it will be done, and write it; returns its path.

    Raises InputError before any work for what no picture can be made of, for a name that ends in neither .png nor .exr,
    and where nothing can be written; MemoryBudgetError, StorageError.
    """
    path, shown = Path(configuration.output or "picture.png"), configuration.view
    check_picture_path(path)
    check_exposure(shown.exposure)
    check_one_of("view.tone", shown.tone, TONES)
    if shown.denoise:
        check_denoiser()
    check_writable(path.absolute().parent)
    point, console = plan_point(configuration).point, Console(stderr=True)
    mesh = load_mesh(point)
    options = point.workload_options
    scene, samples = options.under_sky(lit(point.scene, mesh, point.camera)), options.samples
    if (grey := why_grey(point.scene, mesh)) is not None:
        say(console, grey)
    start = time.monotonic()
    with make_renderer(point, scene, point.camera, make_own(point, mesh)) as renderer:
        with _progress(samples, console) as steps:
            for _ in steps:
                renderer.add(1)
        stops = renderer.save(path, exposure=shown.exposure, tone=shown.tone, denoise=shown.denoise)
    taken = say_duration(time.monotonic() - start)
    say(console, f"{point.scene}: {samples} samples of {point.width} x {point.height} pixels in {taken}")
    print(say_written(path, stops))
    tell_restriction(point.scene, console)
    return path


@contextmanager
def _progress(samples: int, console: Console) -> Iterator[Iterator[int]]:
    """Counts samples: a bar on a terminal, elsewhere a line whenever their number has doubled."""
    columns = (
        BarColumn(bar_width=24), MofNCompleteColumn(), TextColumn("samples"), TimeElapsedColumn(), TextColumn("left:"),
        TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task, start = bar.add_task("", total=samples), time.monotonic()

        def steps() -> Iterator[int]:
            for number in range(1, samples + 1):
                yield number
                bar.advance(task)
                if not console.is_terminal and number & (number - 1) == 0 and number < samples:
                    left_s = (time.monotonic() - start) / number * (samples - number)
                    say(console, f"[{number}/{samples}] samples, about {say_duration(left_s)} left")

        yield steps()


TONE = "neutral"
"""Tone map of the views of a bake."""

SHOWN = (1, 16, 256)
"""Samples after which the view is kept to be looked at, beside that of the finished map."""


@dataclass
class Views:
    """What the camera sees of a scene whose map converges. pictures: (H, W, 3) linear light by name."""

    hits: Hits
    scene: BakeScene
    pictures: dict[str, NDArray[np.float32]] = field(default_factory=dict)

    def keep(self, name: str, lightmap: Lightmap, seams: Seams | None = None) -> None:
        """The view as the map shows it now."""
        image = finished(lightmap, lightmap.combined, seams)
        self.pictures[name] = lit_view(self.hits, self.scene, lightmap.texels.atlas, image)

    def save(self, folder: Path) -> list[Path]:
        """Write each as PNG, in the exposure that suits the last, and one in clay."""
        stops = stops_of(list(self.pictures.values())[-1], AUTO)
        files = {name: toned(picture, stops, TONE) for name, picture in self.pictures.items()}
        files["view_clay"] = clay_view(self.hits)
        for name, picture in files.items():
            write_atomically(folder / f"{name}.png", png_of(picture))
        return [folder / f"{name}.png" for name in files]


def own_scene(point: Point) -> Scene | None:
    """The scene of a bake's glTF file, with its materials, nodes and lamps; None for other files, for other light than
    its own, and where triangles are subdivided or copied."""
    settings, path = point.workload_options, Path(point.scene_path or "")
    if point.subdivided or point.copies > 1:
        return None
    changes_light = settings.panorama or settings.lamps or settings.albedo is not None
    if settings.materials != "own" or changes_light or path.suffix.lower() not in (".glb", ".gltf"):
        return None
    return settings.under_sky(load_lit(path))  # type: ignore[no-any-return]


def run_bake(configuration: Configuration) -> Path:
    """Bake `workload.final_samples` samples, what the view shows first, and write maps, views and model; returns the
    folder.

    Interrupted, it writes what there is. Raises InputError for a workload that is no bake and as `Baker`, `denoised`
    and `LightmapPage` do.
    """
    point = plan_point(configuration).point
    room: Any = point.workload.part("measure")
    folder = Path(configuration.output or Path(configuration.results_dir) / point.workload.name / point.scene)
    check_writable(folder)
    settings, console, own = point.workload_options, Console(stderr=True), own_scene(point)
    mesh = load_mesh(point) if own is None else own.mesh
    scene = room.bake_scene(point, mesh) if own is None else BakeScene.of(own)
    if settings.materials == "own" and (grey := why_grey(point.scene, mesh)) is not None:
        say(console, grey)
    with make_own(point, mesh, point.camera) as tracer:
        views = Views(tracer.trace(), scene)
    print(f"charts of {mesh!r}")
    options = settings.options(point.threads, point.build_quality)
    with Baker(scene, room.atlas_of(point, mesh), **vars(options)) as baker:
        texels = baker.texels
        print(
            f"{len(texels):,} texels in {texels.atlas.charts} charts on {texels.atlas.width} x {texels.atlas.height}, "
            f"{texels.occupancy:.0%} of the map; {texels.faces_lost} faces have none"
        )
        if settings.priority:
            baker.look(point.camera)
        start = perf_counter()
        try:
            if configuration.live:
                _bake_live(baker, settings.final_samples, point, configuration.view.port)
            else:
                _bake(baker, settings.final_samples, views)
        except KeyboardInterrupt:
            print(f"interrupted after {int(baker.samples.min())} samples of every texel; writing these")
        taken_s = perf_counter() - start
        print(f"{baker.rays:,} rays in {taken_s:.1f} s, {baker.rays / taken_s / 1e6:.2f} million a second")
        lightmap, visible = baker.maps, baker.visible
    if settings.denoise:
        lightmap = denoised(lightmap, point.threads)
    views.keep("view", lightmap, Seams.of(mesh, lightmap.texels.atlas))
    written = save_maps(lightmap, folder, visible=visible) + views.save(folder)
    written.append(save_model(lightmap, scene, folder / "scene.glb"))
    if own is not None:
        written += save_lit_model(lightmap, own, str(point.scene_path), folder / "lit.glb")
    for path in written:
        print(f"written: {path}")
    tell_restriction(point.scene, console)
    return folder


def _bake(baker: Baker, target: int, views: Views) -> None:
    """To the target, with a bar where there is a terminal."""
    console = Console(stderr=True)
    columns = TextColumn("baking"), BarColumn(bar_width=24), TextColumn("{task.percentage:3.0f} %")
    times = TimeElapsedColumn(), TextColumn("to go"), TimeRemainingColumn()
    with Progress(*columns, *times, console=console, disable=not console.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=1.0)
        for count in [*(one for one in SHOWN if one < target), target]:
            while baker.advance(count):
                progress.update(task, completed=baker.share_done(target))
            if count < target:
                views.keep(f"view_{count}", baker.maps)


def _bake_live(baker: Baker, target: int, point: Point, port: int) -> None:
    """In a thread, shown on a page until that is closed."""
    from experiments.viewer.lightmap import LightmapPage
    from experiments.viewer.request import Pose

    camera: Any = point.camera
    first = Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees)
    bake = ProgressiveBake(baker, target)
    arguments = bake, baker.scene, baker.texels.atlas, target, first, port, point.scene
    with closing(LightmapPage(*arguments, threads=point.threads)) as page, bake:
        print(f"viewer: {page.address} shows {point.scene}; Ctrl-C ends it, and what there is is written", flush=True)
        page.run()
