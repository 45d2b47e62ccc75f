"""What single scenes say -> what becomes of a claim."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from experiments.paper.evidence import PAPER_SCENES, TIMED, Evidence, NotMeasuredError, SceneRows
from experiments.results.claims import Judge, Judgement
from experiments.results.verdicts import Outcome, on_cases
from experiments.workloads.reported import PAPER_SIZE

TOO_WIDE = "the interval is wider than the difference"


def on_scenes(judge: Callable[[Any], Any], on: str) -> Judge:
    """A judge of the evidence, from one of a scene. on: "every" scene or "some" scene, or its stand-in; the name of a
    scene, which is compared with the paper's number; or "together", all four at once, compared with each other. The
    latter two take no stand-in, and the paper's image size alone."""

    def judged(evidence: Evidence) -> Judgement:
        if on == "together":
            told: Judgement = judge({name: paper_scene(evidence.scenes, name) for name in PAPER_SCENES})
            return told
        if on in PAPER_SCENES:
            outcome = judge(paper_scene(evidence.scenes, on))
            interval = None if outcome.estimate is None else outcome.estimate.interval()
            return Judgement(outcome.verdict, outcome.value, interval, outcome.why)
        return _on_cases(evidence.scenes, judge, every=on == "every")

    return judged


def paper_scene(scenes: Mapping[str, SceneRows], name: str) -> SceneRows:
    """The scene itself, measured at the paper's image size. Raises NotMeasuredError for anything else."""
    if name not in scenes:
        raise NotMeasuredError(f"{name}: {_absent()}")
    scene = scenes[name]
    if scene.stand_in:
        raise NotMeasuredError(f"stand-ins only: {scene.scene} for {name}")
    for row in scene.rows:
        measured_time = row["workload"] in TIMED and row["status"] == "ok"
        if measured_time and (row["width"], row["height"]) != PAPER_SIZE:
            width, height = PAPER_SIZE
            raise NotMeasuredError(
                f"images of {row['width']} x {row['height']}, the paper's are {width:,} x {height:,}"
            )
    return scene


def _on_cases(scenes: Mapping[str, SceneRows], judge: Callable[[SceneRows], Outcome], every: bool) -> Judgement:
    cases: list[tuple[str, Outcome]] = []
    for name in PAPER_SCENES:
        scene = scenes.get(name)
        if scene is None:
            cases.append((name, Outcome(None, why=_absent())))
            continue
        try:
            outcome = judge(scene)
        except NotMeasuredError as error:
            outcome = Outcome(None, why=str(error))
        replaced = f"{scene.scene} for {scene.paper_scene}" if scene.stand_in else None
        cases.append((scene.scene, replace(outcome, stand_in=replaced)))
    return on_cases(cases, every)


def _absent() -> str:
    return "neither the scene nor its stand-in is in the table"
