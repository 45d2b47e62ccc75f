"""Are converged pictures of this path tracer and of Mitsuba 3 the same? Compares means of blocks of 16 x 16 pixels.

    python -m experiments.studies equal_error_blocks reports/reference/equal_error_blocks samples=4096

Needs what the study `equal_error` needs. Each picture is made in batches of samples; their spread is the noise
of a block's mean, so that a difference can be told from noise. Rows of the same scene are replaced.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from atra.light import PathRenderer
from experiments.harness.environment import read_environment
from experiments.light.equal_error.measure import DEPTH, ROULETTE, Floats, block_means, mitsuba_renderer, pictures_of
from scenes.lit.equal_error import SCENES, Shown

BATCHES = 16

GOAL = 0.005
"""Relative difference of a block's means that counts as none."""

CERTAIN = 3.0
"""Standard errors beyond which a difference is not noise."""

VARIANT = "llvm_ad_rgb"


def _ours(shown: Shown, size: int, threads: int) -> Iterator[Floats]:
    scene, camera = shown
    with PathRenderer(
        scene, camera, threads=threads, bounces=DEPTH - 1, roulette_from=ROULETTE, jitter="pixel"
    ) as renderer:
        yield from islice(pictures_of(renderer, size), BATCHES)


def _mitsuba(shown: Shown, size: int, threads: int) -> Iterator[Floats]:
    render = mitsuba_renderer(shown, threads, VARIANT)
    return (render(size, seed) for seed in range(BATCHES))


def _mean_and_error(pictures: Iterator[Floats]) -> tuple[Floats, Floats]:
    """Mean and standard error of each block."""
    batches = np.array([block_means(picture) for picture in pictures])
    return batches.mean(axis=0), batches.std(axis=0, ddof=1) / np.sqrt(BATCHES)


def compare(name: str, samples: int, threads: int) -> dict[str, Any]:
    """A row of the table. Differences are relative to the larger of a block's mean and a tenth of the picture's."""
    shown, size = SCENES[name](), samples // BATCHES
    own, own_error = _mean_and_error(_ours(shown, size, threads))
    other, other_error = _mean_and_error(_mitsuba(shown, size, threads))
    scale = np.maximum(other, 0.1 * other.mean())
    apart, noise = np.abs(own - other) / scale, np.hypot(own_error, other_error) / scale
    return {
        "scene": name, "samples": samples, "blocks": apart.size, "median_apart": float(np.median(apart)),
        "most_apart": float(apart.max()), "noise": float(np.median(noise)),
        "within_goal": float((apart <= GOAL).mean()),
        "surely_apart": int((apart > GOAL + CERTAIN * noise).sum()), "mean_of_ours": float(own.mean() / other.mean()),
    }  # fmt: skip


def study(folder: str, *, scenes: Sequence[str] = tuple(SCENES), samples: int = 4096, threads: int = 2) -> None:
    """Compare pictures of so many samples and write the table."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    path, machine = Path(folder, "table.parquet"), read_environment()
    table = pd.read_parquet(path) if path.exists() else pd.DataFrame()
    for name in scenes:
        row = compare(name, samples, threads) | {"processor": machine["cpu"], "commit": machine["git_commit"]}
        table = pd.concat([table, pd.DataFrame([row])]).drop_duplicates("scene", keep="last", ignore_index=True)
        table.to_parquet(path, index=False)
        print(row, flush=True)
