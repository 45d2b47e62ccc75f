"""The paper's claims: claims.toml says what they are, and what judges most; functions judge the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.paper import images, speed
from experiments.paper.evidence import Evidence
from experiments.paper.judging import on_every_scene, on_paper_scene, on_paper_scenes, on_some_scene
from experiments.paper.ratios import paper_judges
from experiments.paper.readings import EVERY_HIT, NEAREST, READINGS, readings_of
from experiments.results.claims import Judge, JudgedClaim, judge_all
from experiments.results.queries import read_claims
from experiments.workloads.reported import BEST_SPEEDUPS


def best_speedup_id(scene: str) -> str:
    """The id of the claim on the best speed-up of a scene."""
    return f"best-speedup-{scene}"


def _alike(judge: Callable[..., Any]) -> dict[str, Judge]:
    """The baseline does not matter, but whether the nearest hit is wanted or every one."""
    return {
        "": on_every_scene(judge),
        EVERY_HIT.name: on_every_scene(partial(judge, workload=EVERY_HIT.workload)),
    }


def _each(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """Under each reading of the paper's baseline."""
    return {reading.name: on_scenes(partial(judge, reading=reading)) for reading in READINGS}


_JUDGES: Mapping[str, Mapping[str, Judge]] = {
    **{
        best_speedup_id(scene): _each(partial(on_paper_scene, scene), speed.best_speedup_reaches(value))
        for scene, value in BEST_SPEEDUPS.items()
    },
    "culling-off-slows-again": _each(on_every_scene, speed.too_many_splits_slow_down),
    "culling-off-falls-below-start": _each(on_some_scene, speed.too_many_splits_fall_below_start),
    "culling-off-few-splits-gain": _each(on_every_scene, speed.few_splits_gain),
    "culling-on-keeps-gaining": _each(on_every_scene, speed.more_splits_faster),
    "nearest-alone-may-lose": {NEAREST.name: on_some_scene(speed.nearest_alone_may_lose)},
    "image-without-error": {"": on_every_scene(images.image_without_error)},
    "cost-model": _alike(speed.time_follows_cost_model),
    "larger-scenes-gain-less": _each(on_paper_scenes, speed.larger_scenes_gain_less),
    "any-divisor-works": {"": on_every_scene(images.any_divisor_works)},
}

CLAIMS = read_claims(
    Path(__file__).with_suffix(".toml"), _JUDGES, paper_judges, best=BEST_SPEEDUPS, largest_loss=speed.LARGEST_LOSS,
    exponent=speed.MODEL_EXPONENT, r_squared=speed.MODEL_R_SQUARED,
)  # fmt: skip


def judge_claims(processes: pd.DataFrame | None) -> tuple[JudgedClaim, ...]:
    """What became of every claim, in the order of CLAIMS, under each of its readings of which the table has rows.

    processes: as `experiments.results.table.make_tables` gives them; None or an empty table leaves every claim not
    measured. A table of nothing but gathered hits is asked for no other claim.
    """
    under = {reading.name for reading in readings_of(processes)}
    if under != {EVERY_HIT.name}:
        under.add("")
    evidence = Evidence(processes)
    return tuple(claim for claim in judge_all(CLAIMS, evidence) if claim.reading in under)
