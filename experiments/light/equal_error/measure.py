"""Time to equal error of path tracing, ours and Mitsuba 3's.

Both follow paths of the same depth through the same triangles and materials, in pictures without denoising. The error
of a picture of N samples is estimated from the spread of several such pictures: the root of the mean over pixels of
squared deviation over the squared mean. Time to an error is extrapolated from the larger pictures: half the error takes
four times as long. Means of blocks of 16 x 16 pixels of all samples are compared, too; the table has the median and the
largest difference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from itertools import count
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.light import PathRenderer, Renderer
from experiments.light.mitsuba_light import load_mitsuba
from experiments.light.render.measure import mitsuba_scene
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
    mean: Floats

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
    seconds: dict[str, dict[int, float]] = {name: {} for name in makers}
    errors: dict[str, dict[int, float]] = {name: {} for name in makers}
    means: dict[str, list[Floats]] = {name: [] for name in makers}
    for size in SIZES:
        series = {name: make(size) for name, make in makers.items()}
        taken: dict[str, list[float]] = {name: [] for name in makers}
        pictures: dict[str, list[Floats]] = {name: [] for name in makers}
        for _ in range(PICTURES):
            for name, one in series.items():
                make_picture, start = next(one), perf_counter()
                pictures[name].append(make_picture())
                taken[name].append(perf_counter() - start)
        for name in makers:
            seconds[name][size] = float(np.median(taken[name]))
            errors[name][size] = relative_error(np.array(pictures[name]))
            means[name].append(np.mean(pictures[name], axis=0))
    weights = np.array(SIZES, float) / sum(SIZES)
    return {
        name: Found(seconds[name], errors[name], np.tensordot(weights, np.array(means[name]), 1)) for name in makers
    }


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
    render, seeds = mitsuba_renderer(shown, threads, variant), count()
    mi = import_module("mitsuba")

    def make(size: int) -> Iterator[Callable[[], Floats]]:
        mi.set_variant(variant)
        render(size, next(seeds))
        while True:
            mi.set_variant(variant)
            yield partial(render, size, next(seeds))

    return make


def mitsuba_renderer(shown: Shown, threads: int, variant: str) -> Callable[[int, int], Floats]:
    """A call that makes a picture by Mitsuba's `path` integrator. Its arguments: samples, seed."""
    mi, _ = load_mitsuba(variant, f"variant={variant}", threads)
    loaded = mitsuba_scene(mi, *shown, DEPTH, roulette=ROULETTE + 1)

    return lambda size, seed: np.array(mi.render(loaded, spp=size, seed=seed), np.float64)


def block_means(image: Floats) -> Floats:
    """Means of blocks of BLOCK x BLOCK pixels, over colours too. image: (H, W, 3)."""
    rows, columns = image.shape[0] // BLOCK, image.shape[1] // BLOCK
    cut = image[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3)
    return np.asarray(cut.mean(axis=(1, 3, 4)))


def block_differences(one: Floats, other: Floats) -> Floats:
    """Differences of means of blocks, over the larger of the block's mean and a tenth of the picture's."""
    a, b = block_means(one), block_means(other)
    return np.asarray(np.abs(a - b) / np.maximum(b, 0.1 * b.mean()))


def measure(name: str, threads: int, others: Iterable[str]) -> Iterator[dict[str, Any]]:
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
    for renderer, one in found.items():
        yield _row(name, threads, renderer, one, found[OURS])


def _row(name: str, threads: int, renderer: str, found: Found, own: Found) -> dict[str, Any]:
    row: dict[str, Any] = {"scene": name, "threads": threads, "renderer": renderer}
    for error in ERRORS:
        row[f"time_to_{error:.0%}_s"] = found.time_to(error)
    row["times_of_ours"] = found.time_to(ERRORS[0]) / own.time_to(ERRORS[0])
    for size in SIZES:
        row[f"error_of_{size}"], row[f"time_of_{size}_s"] = found.errors[size], found.seconds[size]
    apart = block_differences(own.mean, found.mean)
    row["mean_of_ours"] = float(own.mean.mean() / found.mean.mean())
    return row | {"blocks_apart": float(np.median(apart)), "most_apart": float(apart.max())}
