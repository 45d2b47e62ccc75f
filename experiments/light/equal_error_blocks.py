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

from experiments.light.equal_error import Floats, Maker, block_means, keep_rows, mitsuba, ours
from scenes.lit.equal_error import SCENES

BATCHES = 16

GOAL = 0.005
"""Relative difference of a block's means that counts as none."""

CERTAIN = 3.0
"""Standard errors beyond which a difference is not noise."""

VARIANT = "llvm_ad_rgb"


def compare(name: str, samples: int, threads: int) -> Iterator[dict[str, Any]]:
    """A row of the table. Differences are relative to the larger of a block's mean and a tenth of the picture's."""
    shown = SCENES[name]()
    with ours(shown, threads) as make:
        own, own_error = _mean_and_error(make, samples)
    other, other_error = _mean_and_error(mitsuba(shown, threads, VARIANT), samples)
    scale = np.maximum(other, 0.1 * other.mean())
    apart, noise = np.abs(own - other) / scale, np.hypot(own_error, other_error) / scale
    yield {
        "scene": name, "samples": samples, "blocks": apart.size, "median_apart": float(np.median(apart)),
        "most_apart": float(apart.max()), "noise": float(np.median(noise)),
        "within_goal": float((apart <= GOAL).mean()),
        "surely_apart": int((apart > GOAL + CERTAIN * noise).sum()), "mean_of_ours": float(own.mean() / other.mean()),
    }  # fmt: skip


def _mean_and_error(make: Maker, samples: int) -> tuple[Floats, Floats]:
    """Mean and standard error of each block."""
    pictures = islice(make(samples // BATCHES), BATCHES)
    batches = np.array([block_means(picture()) for picture in pictures])
    return batches.mean(axis=0), batches.std(axis=0, ddof=1) / np.sqrt(BATCHES)


def study(folder: str, *, scenes: Sequence[str] = tuple(SCENES), samples: int = 4096, threads: int = 2) -> None:
    """Compare pictures of so many samples and write the table."""
    for name in scenes:
        keep_rows(Path(folder), compare(name, samples, threads), ["scene"])
