"""Judges of `bake` that no query says; claims.toml says what is claimed, and the queries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.light.bake import RARE, STAGES
from experiments.light.bake.judges import judge_buffers, judge_culling_map, judge_mitsuba
from experiments.results.claims import Judge
from experiments.results.queries import read_claims
from experiments.results.verdicts import Bounds, Which, value_judge


def _where(**values: object) -> Which:
    """Which rows have these values."""

    def found(rows: pd.DataFrame) -> pd.Series:
        kept = [column(rows, name).eq(value).fillna(False).astype(bool) for name, value in values.items()]
        return pd.concat(kept, axis=1).all(axis=1)

    return found


_ALONE = _where(against="compaction", compaction="bounces", priority=False, albedo="own")


def _share_of(*stages: str) -> Callable[[pd.DataFrame], object]:
    """The share of a round's time that some stages take."""

    def share(rows: pd.DataFrame) -> object:
        part, whole = (sum(numbers(rows, f"{stage}_s") for stage in some) for some in (stages, STAGES))
        return part / whole

    return share


_MITSUBA = _where(against="mitsuba", threads=1)
_SAME_SETTINGS = _where(against="mitsuba", threads=1, robust_rays=False)

_JUDGES: Mapping[str, Judge] = {
    "buffers": judge_buffers,
    "rare-stages": value_judge(_share_of(*RARE), _ALONE, Bounds(high=0.05)),
    "no-waiting": value_judge(_share_of("other"), _ALONE, Bounds(high=0.01)),
    "culling-map": judge_culling_map,
    "target-mitsuba": partial(judge_mitsuba, which=_MITSUBA, ratio="speedup_vs_best_other", least=1.0),
    "target-mitsuba-error": partial(judge_mitsuba, which=_SAME_SETTINGS, ratio="quality_vs_other", least=2.0),
}  # fmt: skip

CLAIMS = read_claims(Path(__file__).with_suffix(".toml"), {name: {"": judge} for name, judge in _JUDGES.items()})
