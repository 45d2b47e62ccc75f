"""The paper's claims: what judges each; claims.toml says what they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.paper import resources, speed
from experiments.paper.evidence import Evidence
from experiments.paper.judging import on_every_scene, on_paper_scene, on_paper_scenes, on_some_scene
from experiments.paper.readings import EVERY_HIT, NEAREST, READINGS, readings_of
from experiments.results.claims import Judge, JudgedClaim, judge_all
from experiments.results.queries import read_claims
from experiments.workloads.reported import BEST_SPEEDUPS


def best_speedup_id(scene: str) -> str:
    """The id of the claim on the best speed-up of a scene."""
    return f"best-speedup-{scene}"


def _alone(judge: Judge) -> dict[str, Judge]:
    """Nothing that the paper leaves open matters."""
    return {"": judge}


def _alike(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """The baseline does not matter, but whether the nearest hit is wanted or every one."""
    return {"": on_scenes(judge), EVERY_HIT.name: on_scenes(partial(judge, workload=EVERY_HIT.workload))}


def _each(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """Under each reading of the paper's baseline."""
    return {reading.name: on_scenes(partial(judge, reading=reading)) for reading in READINGS}


_JUDGES: Mapping[str, Mapping[str, Judge]] = {
    **{
        best_speedup_id(scene): _each(partial(on_paper_scene, scene), speed.best_speedup_reaches(value))
        for scene, value in BEST_SPEEDUPS.items()
    },
    "one-axis-beats-both": _alone(on_every_scene(speed.one_axis_beats_both)),
    "one-axis-beats-both-of-as-many-cells": _alone(on_every_scene(speed.one_axis_beats_both_of_as_many_cells)),
    "axes-differ-little": _alone(on_every_scene(speed.axes_differ_little)),
    "horizontal-slightly-better": _alone(on_every_scene(speed.horizontal_slightly_better)),
    "culling-accelerates": _alike(on_every_scene, speed.culling_accelerates),
    "culling-off-slows-again": _each(on_every_scene, speed.too_many_splits_slow_down),
    "culling-off-falls-below-start": _each(on_some_scene, speed.too_many_splits_fall_below_start),
    "culling-off-few-splits-gain": _each(on_every_scene, speed.few_splits_gain),
    "culling-on-keeps-gaining": _each(on_every_scene, speed.more_splits_faster),
    "nearest-alone-may-lose": {NEAREST.name: on_some_scene(speed.nearest_alone_may_lose)},
    "build-little-affected-to-16": _alone(on_every_scene(resources.build_little_affected(16))),
    "build-little-affected-to-64": _alone(on_some_scene(resources.build_little_affected(64))),
    "memory-little-affected-to-16": _alone(on_every_scene(resources.memory_little_affected(16))),
    "memory-little-affected-to-64": _alone(on_some_scene(resources.memory_little_affected(64))),
    "build-grows": _alone(on_every_scene(resources.build_grows)),
    "overlap-lowers-quality": _alone(on_every_scene(resources.overlap_lowers_quality)),
    "memory-grows": _alone(on_every_scene(resources.memory_grows)),
    "image-without-error": _alone(on_every_scene(resources.image_without_error)),
    "cost-model": _alike(on_every_scene, speed.time_follows_cost_model),
    "instancing-lowers-memory": _alone(on_every_scene(resources.instancing_lowers_memory(culling=True))),
    "instancing-lowers-memory-culling-off": _alone(on_every_scene(resources.instancing_lowers_memory(culling=False))),
    "larger-scenes-gain-less": _each(on_paper_scenes, speed.larger_scenes_gain_less),
    "culling-saves-memory": _alone(on_every_scene(resources.culling_saves_memory)),
    "any-divisor-works": _alone(on_every_scene(resources.any_divisor_works)),
}

CLAIMS = read_claims(
    Path(__file__).with_suffix(".toml"), _JUDGES,
    best=BEST_SPEEDUPS, little=speed.LITTLE, largest_loss=speed.LARGEST_LOSS, little_effect=resources.LITTLE_EFFECT,
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
    return tuple(one for one in judge_all(CLAIMS, evidence) if one.reading in under)
