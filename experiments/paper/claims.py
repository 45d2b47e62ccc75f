"""The paper's claims: claims.toml says what they are, and what judges most; functions judge the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.paper import functions
from experiments.paper.evidence import ABSENT, PAPER_SCENES, Scene, collect_scenes, paper_scene
from experiments.paper.ratios import KEYS, judge_ratios
from experiments.paper.readings import EVERY_HIT, UNDER, readings_of
from experiments.results.claims import Judge, JudgedClaim, Judgement, judge_all
from experiments.results.queries import check_keys, query_judge, read_claims
from experiments.results.statistics import NotMeasuredError
from experiments.results.verdicts import Outcome, on_cases
from experiments.workloads.reported import BEST_SPEEDUPS

Evidence = Callable[[], dict[str, Scene]]
"""The scenes of a table, collected once for all claims. Raises NotMeasuredError."""


def paper_judges(query: Mapping[str, Any] | str) -> Mapping[str, Judge]:
    """By reading, what judges a claim of claims.toml. Raises ValueError for a key that no judge has.

    query: as `ratios` says; function: its name instead, of `functions`. on: the scenes, see `_on_scenes`; every where
    nothing is said. under: its readings, a name of `UNDER`.
    """
    if isinstance(query, str):
        return {"": query_judge(query)}
    check_keys("a judge", query, {*KEYS, "function", "on", "under"})
    judge = getattr(functions, query["function"]) if "function" in query else partial(judge_ratios, query)
    on, readings = query.get("on", "every"), UNDER[query.get("under", "")]
    return {name: _on_scenes(partial(judge, reading=reading), on) for name, reading in readings.items()}


def _on_scenes(judge: Callable[[Any], Any], on: str) -> Judge:
    """A judge of the evidence, from one of a scene. on: "every" scene or "some" scene, or its stand-in; the name of a
    scene, which is compared with the paper's number; or "together", all four at once, compared with each other. The
    latter two take no stand-in, and the paper's image size alone."""

    def judged(evidence: Evidence) -> Judgement:
        scenes = evidence()
        if on == "together":
            told: Judgement = judge({name: paper_scene(scenes, name) for name in PAPER_SCENES})
            return told
        if on in PAPER_SCENES:
            outcome = judge(paper_scene(scenes, on))
            interval = None if outcome.estimate is None else outcome.estimate.interval()
            return Judgement(outcome.verdict, outcome.value, interval, outcome.why)
        return on_cases([_case(judge, name, scenes.get(name)) for name in PAPER_SCENES], every=on == "every")

    return judged


def _case(judge: Callable[[Scene], Outcome], name: str, scene: Scene | None) -> tuple[str, Outcome]:
    if scene is None:
        return name, Outcome(None, why=ABSENT)
    try:
        outcome = judge(scene)
    except NotMeasuredError as error:
        outcome = Outcome(None, why=str(error))
    return scene.measured, replace(outcome, stand_in=f"{scene.measured} for {name}" if scene.stand_in else None)


CLAIMS = read_claims(
    Path(__file__).with_suffix(".toml"), {}, paper_judges, best=BEST_SPEEDUPS, largest_loss=functions.LARGEST_LOSS,
    exponent=functions.MODEL_EXPONENT, r_squared=functions.MODEL_R_SQUARED,
)  # fmt: skip


def judge_claims(processes: pd.DataFrame | None) -> tuple[JudgedClaim, ...]:
    """What became of every claim, in the order of CLAIMS, under each of its readings of which the table has rows.

    processes: as `experiments.results.table.make_tables` gives them; None or an empty table leaves every claim not
    measured. A table of nothing but gathered hits is asked for no other claim.
    """
    under = {reading.name for reading in readings_of(processes)}
    if under != {EVERY_HIT.name}:
        under.add("")
    judged = judge_all(CLAIMS, cache(partial(collect_scenes, processes)))
    return tuple(claim for claim in judged if claim.reading in under)
