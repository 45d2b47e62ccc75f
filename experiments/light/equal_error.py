"""Time to equal error of path tracing, ours and Mitsuba 3's; writes a table and draws it.

    python -m experiments.studies equal_error reports/reference/equal_error threads=1

Needs the extra `peers` and LLVM's library (Debian: libllvm19; DRJIT_LIBLLVM_PATH names the file). Rows of the same
scene, threads and renderer are replaced.

Both follow paths of the same depth through the same triangles and materials, in pictures without denoising. The error
of a picture of N samples is estimated from the spread of several such pictures: the root of the mean over pixels of
squared deviation over the squared mean. Time to an error is extrapolated from the larger pictures: half the error takes
four times as long. Means of blocks of 16 x 16 pixels of all samples are compared, too; the table has the median and the
largest difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.light import PathRenderer, Renderer
from experiments.drawing.figure import Axis, Figure, Level, Line, Panel
from experiments.drawing.render import render
from experiments.drawing.style import BLACK, BLUE, DASHED, GREY, ORANGE, SKY
from experiments.harness.environment import read_environment
from experiments.light.mitsuba_light import load_mitsuba, mitsuba_scene
from scenes.lit.equal_error import SCENES, Shown

DEPTH, ROULETTE = 8, 4
SIZES = (8, 32)
"""Samples of a picture."""

PICTURES = 5
"""Pictures of each size."""

ERRORS = (0.05, 0.01)
"""Relative errors to which the time is found."""

OURS, FAST, BEFORE = "ours", "ours, as Mitsuba sets Embree", "ours, lights met by chance"
MITSUBA = "scalar_rgb", "llvm_ad_rgb"
"""Renderers: this one; the same with Embree's fast setting and hierarchy of high quality, which Mitsuba uses; the same
without rays aimed at lights; and Mitsuba's variants."""

_OPTIONS: dict[str, dict[str, Any]] = {FAST: {"robust": False, "build_quality": "high"}, BEFORE: {"lights": "found"}}

BLOCK = 16
_FLOOR = 0.02
"""Pixels darker than this share of the mean count as that bright."""

Floats = NDArray[np.float64]


@dataclass
class Found:
    """What was found of a renderer: seconds and error by samples, and the mean of all pictures."""

    seconds: dict[int, float]
    errors: dict[int, float]
    mean: Any

    def time_to(self, error: float) -> float:
        """Seconds until this relative error."""
        many = SIZES[-1]
        return self.seconds[many] * (self.errors[many] / error) ** 2


def relative_error(pictures: Floats) -> float:
    """Relative error of one picture, from (K, H, W, 3) independent pictures."""
    mean = pictures.mean(axis=0)
    spread = ((pictures - mean) ** 2).sum(axis=0) / (len(pictures) - 1)
    return float(np.sqrt((spread / np.maximum(mean, _FLOOR * mean.mean()) ** 2).mean()))


Maker = Callable[[int], Iterator[Callable[[], Floats]]]
"""Calls that make independent pictures of so many samples each. What comes before a call is not timed."""


def measured(makers: Mapping[str, Maker]) -> dict[str, Found]:
    """What each renderer takes and finds; pictures are made in turns, so that what slows the machine slows all."""
    found = {name: Found({}, {}, 0.0) for name in makers}
    for size in SIZES:
        series = {name: make(size) for name, make in makers.items()}
        taken: dict[str, list[float]] = {name: [] for name in makers}
        pictures: dict[str, list[Floats]] = {name: [] for name in makers}
        for _ in range(PICTURES):
            for name, one in series.items():
                make_picture, start = next(one), perf_counter()
                pictures[name].append(make_picture())
                taken[name].append(perf_counter() - start)
        for name, of_one in found.items():
            of_one.seconds[size] = float(np.median(taken[name]))
            of_one.errors[size] = relative_error(np.array(pictures[name]))
            of_one.mean = of_one.mean + size / sum(SIZES) * np.mean(pictures[name], axis=0)
    return found


@contextmanager
def ours(shown: Shown, threads: int, **options: Any) -> Iterator[Maker]:
    """Pictures by `PathRenderer`, which has compiled and built what it needs. options: of it."""
    scene, camera = shown
    same: Any = {"threads": threads, "bounces": DEPTH - 1, "roulette_from": ROULETTE, "jitter": "pixel"}
    with PathRenderer(scene, camera, **same | options) as renderer:
        renderer.add(1)

        def make(size: int) -> Iterator[Callable[[], Floats]]:
            renderer.restart()
            pictures = pictures_of(renderer, size)
            while True:
                yield partial(next, pictures)

        yield make


def pictures_of(renderer: Renderer, size: int) -> Iterator[Floats]:
    """Independent pictures of `size` samples each, by a renderer without samples, as many as are asked for."""
    before: Any = 0.0
    for number in count(1):
        renderer.add(size)
        so_far = renderer.image.astype(np.float64) * number
        yield so_far - before
        before = so_far


def mitsuba(shown: Shown, threads: int, variant: str) -> Maker:
    """Pictures by Mitsuba's `path` integrator, which has compiled what each size needs.

    Another variant ran before; it takes a tenth of a second to change it.
    """
    mi, _ = load_mitsuba(variant, f"variant={variant}", threads)
    loaded, seeds = mitsuba_scene(mi, *shown, DEPTH, roulette=ROULETTE + 1), count()

    def picture(size: int) -> Floats:
        return np.array(mi.render(loaded, spp=size, seed=next(seeds)), np.float64)

    def make(size: int) -> Iterator[Callable[[], Floats]]:
        mi.set_variant(variant)
        picture(size)
        while True:
            mi.set_variant(variant)
            yield partial(picture, size)

    return make


def block_means(image: Floats) -> Floats:
    """Means of blocks of BLOCK x BLOCK pixels, over colours too. image: (H, W, 3)."""
    rows, columns = image.shape[0] // BLOCK, image.shape[1] // BLOCK
    cut = image[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3)
    return np.asarray(cut.mean(axis=(1, 3, 4)))


def block_differences(one: Floats, other: Floats) -> Floats:
    """Differences of means of blocks, over the larger of the block's mean and a tenth of the picture's."""
    a, b = block_means(one), block_means(other)
    return np.asarray(np.abs(a - b) / np.maximum(b, 0.1 * b.mean()))


def measure(name: str, threads: int, others: Sequence[str]) -> Iterator[dict[str, Any]]:
    """A row of the table for each renderer of a scene: this one, and the others."""
    shown = SCENES[name]()
    with ExitStack() as stack:
        makers = {OURS: stack.enter_context(ours(shown, threads))}
        for other in others:
            if other in MITSUBA:
                makers[other] = mitsuba(shown, threads, other)
            else:
                makers[other] = stack.enter_context(ours(shown, threads, **_OPTIONS[other]))
        found = measured(makers)
    own = found[OURS]
    for renderer, one in found.items():
        row: dict[str, Any] = {"scene": name, "threads": threads, "renderer": renderer}
        row |= {f"time_to_{error:.0%}_s": one.time_to(error) for error in ERRORS}
        row["times_of_ours"] = one.time_to(ERRORS[0]) / own.time_to(ERRORS[0])
        for size in SIZES:
            row[f"error_of_{size}"], row[f"time_of_{size}_s"] = one.errors[size], one.seconds[size]
        apart = block_differences(own.mean, one.mean)
        row["mean_of_ours"] = float(own.mean.mean() / one.mean.mean())
        yield row | {"blocks_apart": float(np.median(apart)), "most_apart": float(apart.max())}


def study(
    folder: str, *, scenes: Sequence[str] = tuple(SCENES), threads: int = 1,
    renderers: Sequence[str] = (FAST, BEFORE, *MITSUBA),
) -> None:  # fmt: skip
    """Measure these renderers beside ours, and write table and figure."""
    for name in scenes:
        table = keep_rows(Path(folder), measure(name, threads, renderers), ["scene", "threads", "renderer"])
        Path(folder, "errors.png").write_bytes(render(errors_figure(table), "png"))


def keep_rows(folder: Path, rows: Iterator[dict[str, Any]], key: list[str]) -> pd.DataFrame:
    """Add rows to the table of a folder, in place of those of the same key, and print them; returns the table."""
    folder.mkdir(parents=True, exist_ok=True)
    path, machine = folder / "table.parquet", read_environment()
    same = {"processor": machine["cpu"], "cores": machine["logical_cores"], "commit": machine["git_commit"]}
    made = pd.DataFrame(list(rows))
    parts = [pd.read_parquet(path)] if path.exists() else []
    table = pd.concat([*parts, made.assign(**same)]).drop_duplicates(key, keep="last", ignore_index=True)
    table.to_parquet(path, index=False)
    print(made.round(4).to_string(index=False), flush=True)
    return table


_LOOKS = {
    OURS: (ORANGE, "-", "o"),
    FAST: (ORANGE, DASHED, "D"),
    BEFORE: (GREY, DASHED, "s"),
    "scalar_rgb": (SKY, "-", "^"),
    "llvm_ad_rgb": (BLUE, "-", "v"),
}
_NAMES = {"scalar_rgb": "Mitsuba 3, scalar", "llvm_ad_rgb": "Mitsuba 3, LLVM"}


def errors_figure(table: pd.DataFrame) -> Figure:
    """A panel for each scene: for the fewest threads of the table, what was measured of each renderer, and the line on
    which half the error takes four times as long, until the smallest error that is asked for."""
    shown = table[table["threads"] == table["threads"].min()]
    panels = [_panel(str(scene), rows) for scene, rows in shown.groupby("scene", sort=False)]
    legend = [_NAMES.get(name, name) for name in _LOOKS]
    errors = Axis("relative error", say="{:.3g} %".format)
    return Figure("lines", panels, Axis("seconds"), errors, legend=legend, columns=4)


def _panel(scene: str, rows: pd.DataFrame) -> Panel:
    lines = []
    for row in rows.to_dict("records"):
        color, dashes, marker = _LOOKS[row["renderer"]]
        seconds, errors = (
            np.array([row[f"{what}_of_{size}{unit}"] for size in SIZES], np.float64)
            for what, unit in (("time", "_s"), ("error", ""))
        )
        until = np.geomspace(errors[-1], min(errors[-1], ERRORS[-1]), 2)
        slope = {"color": color, "linestyle": dashes}
        lines.append(Line("_slope", seconds[-1] * (errors[-1] / until) ** 2, 100 * until, slope, thin=True))
        label, looks = _NAMES.get(row["renderer"], row["renderer"]), {"color": color, "marker": marker}
        lines.append(Line(label, seconds, 100 * errors, {**looks, "linestyle": "none"}))
    levels = [Level("_asked", 100 * error, {"color": BLACK, "linewidth": 0.6}) for error in ERRORS]
    return Panel(scene, lines=lines, levels=levels)
