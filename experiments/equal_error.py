"""Time to equal error of path tracing, ours and Mitsuba 3's: `python -m experiments.equal_error FOLDER`.

Both follow paths of the same depth through the same triangles and materials, in pictures without denoising. The error
of a picture of N samples is estimated from the spread of several such pictures: the root of the mean over pixels of
squared deviation over the squared mean. Time to an error is extrapolated from the larger pictures: half the error takes
four times as long. Means of blocks of 16 x 16 pixels of all samples are compared, too; the table has the median and the
largest difference.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.light import PathRenderer
from experiments.methods.peers.mitsuba_light import load_mitsuba
from experiments.workloads.render.measure import mitsuba_scene
from scenes.lit.equal_error import SCENES, Shown

DEPTH, ROULETTE = 8, 4
SIZES = (8, 32)
"""Samples of a picture."""

PICTURES = 5
"""Pictures of each size."""

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


def _measured(make: Callable[[int], Iterator[Floats]]) -> Found:
    seconds, errors, means = {}, {}, []
    for size in SIZES:
        taken, pictures = [], []
        maker = make(size)
        for _ in range(PICTURES):
            start = perf_counter()
            pictures.append(next(maker))
            taken.append(perf_counter() - start)
        seconds[size] = float(np.median(taken))
        errors[size] = relative_error(np.array(pictures))
        means.append(np.mean(pictures, axis=0))
    weights = np.array(SIZES, float)
    return Found(seconds, errors, np.tensordot(weights / weights.sum(), np.array(means), 1))


def ours(shown: Shown, threads: int) -> Found:
    """What `PathRenderer` takes and finds."""
    scene, camera = shown
    with PathRenderer(scene, camera, threads=threads, max_depth=DEPTH, roulette=ROULETTE, jitter="pixel") as renderer:
        renderer.add(1)  # compiles and builds

        def make(size: int) -> Iterator[Floats]:
            renderer.restart()
            before: Any = 0.0
            for number in range(1, PICTURES + 1):
                renderer.add(size)
                so_far = renderer.image.astype(np.float64) * number
                yield so_far - before
                before = so_far

        return _measured(make)


def mitsuba(shown: Shown, threads: int, variant: str) -> Found:
    """What Mitsuba's `path` integrator takes and finds."""
    mi, _ = load_mitsuba(variant, f"variant={variant}", threads)
    loaded = mitsuba_scene(mi, *shown, DEPTH, roulette=ROULETTE + 1)
    seeds = iter(range(1 << 30))

    def make(size: int) -> Iterator[Floats]:
        np.array(mi.render(loaded, spp=size, seed=next(seeds)))  # compiles for this size
        while True:
            yield np.array(mi.render(loaded, spp=size, seed=next(seeds)), np.float64)

    return _measured(make)


def block_differences(one: Floats, other: Floats) -> Floats:
    """Differences of means of blocks, over the larger of the block's mean and a tenth of the picture's."""

    def blocks(image: Floats) -> Floats:
        rows, columns = image.shape[0] // BLOCK, image.shape[1] // BLOCK
        cut = image[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK, 3)
        return np.asarray(cut.mean(axis=(1, 3, 4)))

    a, b = blocks(one), blocks(other)
    return np.asarray(np.abs(a - b) / np.maximum(b, 0.1 * b.mean()))


def measure(name: str, threads: int, variants: list[str]) -> dict[str, Any]:
    """A row of the table."""
    shown = SCENES[name]()
    own = ours(shown, threads)
    row: dict[str, Any] = {"scene": name, "threads": threads}
    for error in (0.05, 0.01):
        row[f"ours_s_{error:.0%}"] = own.time_to(error)
    for size in SIZES:
        row[f"ours_error_{size}"], row[f"ours_s_{size}"] = own.errors[size], own.seconds[size]
    for variant in variants:
        theirs = mitsuba(shown, threads, variant)
        for error in (0.05, 0.01):
            row[f"{variant}_s_{error:.0%}"] = theirs.time_to(error)
            row[f"over_{variant}_{error:.0%}"] = own.time_to(error) / theirs.time_to(error)
        for size in SIZES:
            row[f"{variant}_error_{size}"], row[f"{variant}_s_{size}"] = theirs.errors[size], theirs.seconds[size]
        row[f"{variant}_mean_ratio"] = float(own.mean.mean() / theirs.mean.mean())
        apart = block_differences(own.mean, theirs.mean)
        row[f"{variant}_blocks_apart"], row[f"{variant}_most_apart"] = float(np.median(apart)), float(apart.max())
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scene", action="append", choices=list(SCENES))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--variant", action="append", choices=["scalar_rgb", "llvm_ad_rgb"])
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    path = given.folder / f"threads_{given.threads}.csv"
    rows = pd.read_csv(path).to_dict("records") if path.exists() else []
    for name in given.scene or SCENES:
        row = measure(name, given.threads, given.variant or ["scalar_rgb", "llvm_ad_rgb"])
        rows = [one for one in rows if one["scene"] != name] + [row]
        pd.DataFrame(rows).to_csv(path, index=False, float_format="%.4g")
        print({key: value if isinstance(value, str) else round(value, 4) for key, value in row.items()}, flush=True)


if __name__ == "__main__":
    main()
