"""The paper's claims: claims.toml says what they are, and what judges most; functions judge the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.paper import images, speed
from experiments.paper.evidence import Evidence
from experiments.paper.judging import on_scenes
from experiments.paper.ratios import KEYS, judge_ratios
from experiments.paper.readings import EVERY_HIT, UNDER, readings_of
from experiments.results.claims import Judge, JudgedClaim, judge_all
from experiments.results.queries import check_keys, query_judge, read_claims
from experiments.workloads.reported import BEST_SPEEDUPS


def best_speedup_id(scene: str) -> str:
    """The id of the claim on the best speed-up of a scene."""
    return f"best-speedup-{scene}"


_FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (
        speed.too_many_splits_slow_down, speed.more_splits_faster, speed.larger_scenes_gain_less,
        speed.time_follows_cost_model, images.image_without_error, images.any_divisor_works,
    )
}  # fmt: skip
"""What judges a claim that no query says, from a scene and a reading."""


def paper_judges(query: Mapping[str, Any] | str) -> Mapping[str, Judge]:
    """By reading, what judges a claim of claims.toml. Raises ValueError for a key that no judge has.

    query: as `ratios` says; function: its name instead. on: the scenes, see `on_scenes`; every where nothing is said.
    under: its readings, a name of `UNDER`.
    """
    if isinstance(query, str):
        return {"": query_judge(query)}
    check_keys("a judge", query, {*KEYS, "function", "on", "under"})
    judge = _FUNCTIONS[query["function"]] if "function" in query else partial(judge_ratios, query)
    readings = UNDER[query.get("under", "")]
    on = query.get("on", "every")
    return {name: on_scenes(partial(judge, reading=reading), on) for name, reading in readings.items()}


CLAIMS = read_claims(
    Path(__file__).with_suffix(".toml"), {}, paper_judges, best=BEST_SPEEDUPS, largest_loss=speed.LARGEST_LOSS,
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
