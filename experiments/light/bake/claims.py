"""What judges a table of `bake`; claims.toml says what is claimed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import pandas as pd

from experiments.drawing.values import column, numbers
from experiments.light.bake import RARE, STAGES
from experiments.light.bake.judges import judge_buffers, judge_culling_map, judge_mitsuba
from experiments.methods.visible_first import VISIBLE_FIRST
from experiments.results.claims import Judge, Judgement, NotMeasuredError, read_claims
from experiments.results.verdicts import Bounds, Which, ratio_judge, value_judge


def _where(rows: pd.DataFrame, **values: object) -> pd.Series:
    """Which rows have these values."""
    found = rows["scene"].notna()
    for name, value in values.items():
        found &= column(rows, name).eq(value).fillna(False).astype(bool)
    return found


def _against(what: str, **values: object) -> Which:
    return lambda rows: _where(rows, against=what, **values)


def _no_gpu(table: pd.DataFrame | None) -> Judgement:
    raise NotMeasuredError("there is no GPU here")


def _share_of(rows: pd.DataFrame, stages: tuple[str, ...]) -> object:
    whole = sum(numbers(rows, f"{stage}_s") for stage in STAGES)
    return sum(numbers(rows, f"{stage}_s") for stage in stages) / whole


def _plain(compaction: str) -> Which:
    return _against("compaction", compaction=compaction, priority=False, albedo="own", packets="1")


def _dark(rows: pd.DataFrame) -> pd.Series:
    bounces = _against("compaction", compaction="bounces", packets="1")(rows)
    return bounces & column(rows, "albedo").ne("own")


def _emptiest(which: Which) -> Which:
    def found(rows: pd.DataFrame) -> pd.Series:
        chosen = which(rows)
        occupancy = pd.to_numeric(column(rows, "occupancy").where(chosen), errors="coerce")
        return chosen & occupancy.eq(occupancy.min())

    return found


def _view(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, priority=True, compaction="bounces") & column(rows, "view_speedup").notna()


def _half_seen(rows: pd.DataFrame) -> pd.Series:
    return _view(rows) & pd.Series(numbers(rows, "visible_share") <= 0.5, rows.index)


def _natural(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, occupancy="any")


def _expanded(rows: pd.DataFrame) -> pd.Series:
    return _against("expansion")(rows) & pd.Series(numbers(rows, "expansion") >= 16, rows.index)


def _denoised(rows: pd.DataFrame) -> pd.Series:
    return _where(rows, denoise=True)


def _counted(share: Callable[[pd.DataFrame], object], which: Which, bounds: Bounds) -> Judge:
    return value_judge(share, which, bounds, counted=True)


_MORE = Bounds(low=1.0)

_JUDGES: Mapping[str, Judge] = {
    "occupancy": _counted(lambda rows: numbers(rows, "map_occupancy"), _natural, Bounds(0.5, 0.7)),
    "compaction-tracing": ratio_judge("tracing_vs_other", _plain("texels"), _MORE),
    "compaction-shading": ratio_judge("shading_vs_other", _plain("texels"), _MORE),
    "compaction-bounces": ratio_judge("speedup_vs_other", _plain("bounces"), _MORE),
    "occupancy-no-matter": ratio_judge("rays_speedup_vs_other", _against("occupancy"), Bounds(0.95, 1.05)),
    "side-by-side": ratio_judge("rays_speedup_vs_other", _against("expansion"), _MORE),
    "full-batches": _counted(lambda rows: numbers(rows, "batch_fill"), _expanded, Bounds(low=0.5)),
    "buffers": judge_buffers,
    "rare-stages": value_judge(partial(_share_of, stages=RARE), _plain("bounces"), Bounds(high=0.05)),
    "view-sooner": ratio_judge("view_speedup", _view, _MORE),
    "roulette": ratio_judge("quality_vs_other", _against("roulette"), _MORE),
    "panorama": ratio_judge("quality_vs_other", _against("environment", environment="mis"), _MORE),
    "light-grid": ratio_judge("quality_vs_other", _against("lights", lamps=256), _MORE),
    "opaque": ratio_judge("speedup_vs_other", _against("translucency"), Bounds(high=1.03)),
    "no-waiting": value_judge(partial(_share_of, stages=("other",)), _plain("bounces"), Bounds(high=0.01)),
    "culling-map": judge_culling_map,
    "culling-map-share": value_judge(
        lambda rows: numbers(rows, "culling_map_s") / numbers(rows, "visible_time_to_rmse_5_s"),
        lambda rows: _where(rows, priority=True, method=VISIBLE_FIRST.name), Bounds(high=0.05),
    ),
    "gpu": _no_gpu,
    "target-texels": ratio_judge("rays_speedup_vs_other", _emptiest(_plain("texels")), Bounds(low=1.15)),
    "target-bounces": ratio_judge("speedup_vs_other", _dark, Bounds(low=1.15)),
    "target-view": ratio_judge("view_speedup", _half_seen, Bounds(low=1.6)),
    "target-whole-map": ratio_judge("whole_map_cost", _view, Bounds(high=1.05)),
    "target-denoised": _counted(lambda rows: numbers(rows, "denoised_ratio"), _denoised, Bounds(high=1.0)),
    "target-seams": _counted(lambda rows: numbers(rows, "seam_step_ratio"), _denoised, Bounds(high=0.25)),
    "target-mitsuba": partial(
        judge_mitsuba, which=_against("mitsuba", threads=1), ratio="speedup_vs_best_other", least=1.0
    ),
    "target-mitsuba-error": partial(
        judge_mitsuba, which=_against("mitsuba", threads=1, robust_rays=False), ratio="quality_vs_other", least=2.0
    ),
}  # fmt: skip

CLAIMS = read_claims(Path(__file__).with_suffix(".toml"), {name: {"": judge} for name, judge in _JUDGES.items()})
