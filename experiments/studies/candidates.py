"""Candidates for the paper's 7.50 on the Cornell box: how far each goes, measured one by one.

    python -m experiments.studies candidates results/cornell_candidates

A candidate differs from the usual point in one setting. Its gain is that of aligned single rays at the best horizontal
split, culling on, over 1 x 1 in the same setting: `rtcIntersect1` per pixel, or aligned rays without culling, which
gather all hits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from atra.errors import InputError
from experiments.drawing.style import TIMES
from experiments.drawing.values import numbers
from experiments.methods.aligned import ALIGNED
from experiments.methods.pixel import PIXEL
from experiments.results.queries import chosen
from experiments.results.settings import say_setting
from experiments.results.statistics import Estimate, Pool, best_of
from experiments.results.table import read_table
from experiments.results.verdicts import Bounds
from experiments.workloads.reported import BEST_SPEEDUPS

ASKED_FOR = BEST_SPEEDUPS["cornell_box"]

SETTINGS = ("scene", "view", "eye", "threads", "build_quality", "instruction_set", "robust")
"""What candidates may differ in."""


@dataclass(frozen=True)
class Gain:
    """split: the best one, as "512 x 1"; empty where there is no choice. estimate: None = too few processes."""

    split: str
    estimate: Estimate | None

    def __str__(self) -> str:
        if self.estimate is None:
            return "too few processes"
        return f"{self.estimate} ({self.split})" if self.split else str(self.estimate)

    @property
    def verdict(self) -> str:
        """Whether it is as large as the paper's, by the one rule of verdict."""
        if self.estimate is None:
            return "not measured"
        return {True: "yes", False: "no", None: "undecided"}[Bounds(low=ASKED_FOR).decide(self.estimate)]


@dataclass(frozen=True)
class Candidate:
    """name: in words. nearest, all_hits: gains over 1 x 1 by what that finds; None where that reading has none."""

    name: str
    nearest: Gain | None
    all_hits: Gain | None

    @property
    def reaches(self) -> str:
        """Whether any of its gains is as large as the paper's."""
        verdicts = [gain.verdict for gain in (self.nearest, self.all_hits) if gain is not None]
        return next((verdict for verdict in ("yes", "undecided", "not measured") if verdict in verdicts), "no")


def candidates(processes: pd.DataFrame) -> Iterator[Candidate]:
    """The usual point first, then every candidate in the order of the table. processes: of sweep=cornell_candidates.

    Raises InputError where the usual point is missing.
    """
    rows = processes[chosen(processes, {"status": "ok"})]
    aligned, pixels = (rows[chosen(rows, {"packet_width": 1, "method": method.name})] for method in (ALIGNED, PIXEL))
    groups: dict[Any, pd.DataFrame] = dict(iter(aligned.groupby(list(SETTINGS), sort=False, dropna=False)))
    usual = _usual_of(groups)
    for key in (usual, *(group for group in groups if group != usual)):
        base = _speeds(pixels[chosen(pixels, {"robust": True})]) if key[-1] else {}
        yield Candidate(_say(key, usual), *_gains(groups[key], base))
    prepared = groups[usual].assign(speedup=_prepared_over_single(groups[usual]))
    yield Candidate("plan and build included", *_gains(prepared, {}))
    yield from _without_the_flag(rows, pixels, groups[usual])


def _usual_of(groups: Mapping[tuple[Any, ...], Any]) -> tuple[Any, ...]:
    """Settings shared by most candidates."""
    usual = tuple(max(values, key=values.count) for values in zip(*groups, strict=True))
    if usual not in groups:
        raise InputError(f"no point has the usual settings {usual}, expected aligned single rays of the whole sweep")
    return usual


def _say(key: tuple[Any, ...], usual: tuple[Any, ...]) -> str:
    differing = {name: value for name, value, other in zip(SETTINGS, key, usual, strict=True) if value != other}
    if "view" in differing:  # which explains the eye
        differing.pop("eye", None)
    return ", ".join(_SAY.get(name, say_setting)(name, value) for name, value in differing.items()) or "usual"


_SAY: Mapping[str, Callable[[str, Any], str]] = {
    "scene": lambda _, value: f"`{value}`",
    "eye": lambda _, value: f"eye at {value}",
    "view": lambda _, value: f"view `{value}`",
    "threads": lambda _, value: f"{value} threads",
    "robust": lambda _, value: "robust rays" if value else "fast rays",
}


def _prepared_over_single(rows: pd.DataFrame) -> Any:
    """First frames, with plan and build."""
    single = numbers(rows, "baseline_render_time_s") + numbers(rows, "baseline_build_time_s")
    own = sum(numbers(rows, f"{part}_time_s") for part in ("render", "plan", "build"))
    return single / own


def _speeds(rows: pd.DataFrame, column: str = "speedup") -> dict[Any, list[float]]:
    """The speed-ups of each point's processes, by its split; splits are None where a method has none."""
    samples: dict[Any, list[float]] = {}
    for split, culling, value in zip(rows["split_x"], rows["culling"], numbers(rows, column), strict=True):
        if np.isfinite(value):
            key = None if pd.isna(split) else (int(split), bool(culling))
            samples.setdefault(key, []).append(float(value))
    return samples


def _gains(rows: pd.DataFrame, base: dict[Any, list[float]], column: str = "speedup") -> tuple[Gain, Gain]:
    """Over rays that look for the nearest hit, and over aligned rays at 1 x 1 without culling. base: speed-ups of the
    former over `rtcIntersect1`, where they are something else."""
    speeds = _speeds(rows, column)
    pool = Pool.of([*speeds.values(), *base.values()])
    try:
        columns, best = best_of({key[0]: of for key, of in speeds.items() if key is not None and key[1]}, pool)
    except ValueError:  # none, or too few processes
        return Gain("", None), Gain("", None)
    split = f"{columns:,} {TIMES} 1"
    nearest = _over(best, base.get(None, ()), pool) if base else best
    return Gain(split, nearest), Gain(split, _over(best, speeds.get((1, False), ()), pool))


def _over(best: Estimate, values: Sequence[float], pool: Pool | None) -> Estimate | None:
    """None where there are too few values."""
    try:
        return best.over(Estimate.of(values, pool))
    except ValueError:
        return None


def _without_the_flag(rows: pd.DataFrame, pixels: pd.DataFrame, usual: pd.DataFrame) -> Iterator[Candidate]:
    """Gains over rays per pixel without Embree's flag that rays are alike: over single rays, and over packets."""
    name = "per pixel without the flag that rays are alike"
    alone = _speeds(pixels[chosen(pixels, {"coherent": False})])
    if alone:
        yield Candidate(f"single rays {name}", _gains(usual, alone)[0], None)
    wide, over = rows[rows["packet_width"].gt(1).fillna(False)], "speedup_vs_packets"
    packets = _speeds(wide[chosen(wide, {"method": PIXEL.name, "coherent": False})], over)
    if packets:
        aligned = wide[chosen(wide, {"method": ALIGNED.name})]
        yield Candidate(f"packets {name}, aligned packets with it", _gains(aligned, packets, over)[0], None)


def study(folder: str = "results/cornell_candidates") -> None:
    """Print how far each candidate goes. Raises InputError for a folder without a table of the sweep."""
    processes = read_table(Path(folder) / "processes.parquet")
    if processes is None:
        raise InputError(f"{folder} has no processes.parquet, expected the results of sweep=cornell_candidates")
    for candidate in candidates(processes):
        told = f"nearest hit {candidate.nearest}, all hits {candidate.all_hits}; {ASKED_FOR}: {candidate.reaches}"
        print(f"{candidate.name}: {told}")
