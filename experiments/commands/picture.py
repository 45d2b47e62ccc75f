"""`python run.py render scene=sponza samples=64 output=picture.exr`: one picture as a file."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from atra.light.pictures.files import check_picture_path
from experiments.commands.messages import tell_restriction
from experiments.harness.configuration import Configuration, check_writable
from experiments.harness.point import make_own
from experiments.harness.points import plan_point
from experiments.harness.progress import say, say_duration
from experiments.workloads.render import RENDER
from experiments.workloads.render.measure import make_renderer
from experiments.workloads.rounds import load_mesh
from scenes.lit.lighting import lit


def picture_arguments(given: Sequence[str]) -> list[str]:
    """Arguments of the verb as those of a configuration: fields of the workload may be set without its name before
    them."""
    own = {one.name for one in fields(RENDER.options)}
    return [f"workload.{one}" if one.partition("=")[0] in own else one for one in given]


def run_picture(configuration: Configuration) -> Path:
    """Make the picture, showing how far it is and when it will be done, and write it; returns its path.

    Raises InputError before any work for what no picture can be made of, for a name that ends in neither .png nor .exr,
    and where nothing can be written; MemoryBudgetError, StorageError.
    """
    path = Path(configuration.output or "picture.png")
    check_picture_path(path)
    check_writable(path.absolute().parent)
    point, console = plan_point(configuration).point, Console(stderr=True)
    mesh = load_mesh(point)
    options = point.workload_options
    scene, samples = options.under_sky(lit(point.scene, mesh, point.camera)), options.samples
    start = time.monotonic()
    with make_renderer(point, scene, point.camera, make_own(point, mesh)) as renderer:
        with _progress(samples, console) as steps:
            for _ in steps:
                renderer.add(1)
        renderer.save(path)
    taken = say_duration(time.monotonic() - start)
    say(console, f"{point.scene}: {samples} samples of {point.width} x {point.height} pixels in {taken}")
    print(f"written: {path}")
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
