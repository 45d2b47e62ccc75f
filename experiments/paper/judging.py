"""What single scenes say -> what becomes of a claim."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from experiments.paper.evidence import PAPER_SCENES, TIMED, Evidence, NotMeasuredError, SceneRows
from experiments.results.claims import Judge, Judgement
from experiments.results.verdicts import Outcome, on_cases
from experiments.workloads.reported import PAPER_SIZE

SceneJudge = Callable[[SceneRows], Outcome]


def on_every_scene(judge_scene: SceneJudge) -> Judge:
    """A claim about all four scenes, or their stand-ins."""
    return lambda evidence: _judged(evidence.scenes, judge_scene, every=True)


def on_some_scene(judge_scene: SceneJudge) -> Judge:
    """A claim that something happens on some scene, or its stand-in."""
    return lambda evidence: _judged(evidence.scenes, judge_scene, every=False)


def on_paper_scene(name: str, judge_scene: SceneJudge) -> Judge:
    """A claim that compares a number of scene `name` with the paper's: no stand-in, and the paper's image size."""

    def judge(evidence: Evidence) -> Judgement:
        outcome = judge_scene(paper_scene(evidence.scenes, name))
        interval = None if outcome.estimate is None else outcome.estimate.interval()
        return Judgement(outcome.verdict, outcome.value, interval, outcome.why)

    return judge


def on_paper_scenes(judge_scenes: Callable[[Mapping[str, SceneRows]], Judgement]) -> Judge:
    """A claim that compares all four scenes with each other: no stand-ins, and the paper's image size."""

    return lambda evidence: judge_scenes({name: paper_scene(evidence.scenes, name) for name in PAPER_SCENES})


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


def _judged(scenes: Mapping[str, SceneRows], judge_scene: SceneJudge, every: bool) -> Judgement:
    cases: list[tuple[str, Outcome]] = []
    for name in PAPER_SCENES:
        scene = scenes.get(name)
        if scene is None:
            cases.append((name, Outcome(None, why=_absent())))
            continue
        try:
            outcome = judge_scene(scene)
        except NotMeasuredError as error:
            outcome = Outcome(None, why=str(error))
        replaced = f"{scene.scene} for {scene.paper_scene}" if scene.stand_in else None
        cases.append((scene.scene, replace(outcome, stand_in=replaced)))
    return on_cases(cases, every)


def _absent() -> str:
    return "neither the scene nor its stand-in is in the table"
