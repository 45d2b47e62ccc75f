"""`python run.py bake scene=<name> output=<folder>`: makes a lightmap, with what is left and when it will be done."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from atra.bake import Baker, save_maps, save_model
from experiments.harness.configuration import Configuration, check_writable
from experiments.harness.points import plan_points
from experiments.workloads import find_workload
from experiments.workloads.rounds import load_mesh


def run_bake(configuration: Configuration) -> Path:
    """Bake `workload.final_samples` samples, what the view shows first, and write maps and model; returns the folder.

    Interrupted, it writes what there is. Raises InputError for a workload that is no bake and as `Baker` does.
    """
    (planned,) = plan_points([configuration])
    if planned.problem is not None:
        raise planned.problem
    point = planned.point
    room = find_workload(point.workload).part("measure")
    assert room is not None
    folder = Path(configuration.output or Path(configuration.results_dir) / "bake" / point.scene)
    check_writable(folder)
    settings, mesh = point.workload_options, load_mesh(point)
    scene = room.bake_scene(point, mesh)
    print(f"charts of {mesh!r}")
    options = settings.options(point.threads, point.build_quality)
    with Baker(scene, room.atlas_of(point, mesh), options=options) as baker:
        texels = baker.texels
        print(
            f"{len(texels):,} texels in {texels.atlas.charts} charts on {texels.atlas.width} x {texels.atlas.height}, "
            f"{texels.occupancy:.0%} of the map; {texels.faces_lost} faces have none"
        )
        if settings.priority:
            baker.set_view(point.camera)
        start = perf_counter()
        try:
            _bake(baker, settings.final_samples)
        except KeyboardInterrupt:
            print(f"interrupted after {int(baker.samples.min())} samples of every texel; writing these")
        taken_s = perf_counter() - start
        print(f"{baker.rays:,} rays in {taken_s:.1f} s, {baker.rays / taken_s / 1e6:.2f} million a second")
        lightmap, visible = baker.maps, baker.visible
    for path in [*save_maps(lightmap, folder, visible=visible), save_model(lightmap, scene, folder / "scene.glb")]:
        print(f"written: {path}")
    return folder


def _bake(baker: Baker, target: int) -> None:
    """To the target, with a bar where there is a terminal."""
    console = Console(stderr=True)
    columns = TextColumn("baking"), BarColumn(bar_width=24), TextColumn("{task.percentage:3.0f} %")
    times = TimeElapsedColumn(), TextColumn("to go"), TimeRemainingColumn()
    with Progress(*columns, *times, console=console, disable=not console.is_terminal, transient=True) as progress:
        task = progress.add_task("", total=target * len(baker.texels))
        while baker.advance(target):
            progress.update(task, completed=int(baker.samples.sum(dtype=int)))
