"""What single scenes say -> what becomes of a claim."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from experiments.paper.evidence import PAPER_SCENES, PAPER_SIZE, TIMED, Evidence, NotMeasuredError, SceneRows
from experiments.results.claims import DOES_NOT_HOLD, HOLDS, NOT_MEASURED, UNDECIDED, Judge, Judgement
from experiments.results.statistics import Estimate, Interval


@dataclass(frozen=True)
class Outcome:
    """What one scene says: holds None = the measurement leaves it open, or there is none and then no value either.
    why: for every outcome that is not True."""

    holds: bool | None
    value: str = ""
    estimate: Estimate | Interval | None = None
    why: str | None = None

    @property
    def verdict(self) -> str:
        """One of `VERDICTS`."""
        if self.holds is None:
            return UNDECIDED if self.value else NOT_MEASURED
        return HOLDS if self.holds else DOES_NOT_HOLD


SceneJudge = Callable[[SceneRows], Outcome]


def on_every_scene(judge_scene: SceneJudge) -> Judge:
    """A claim about all four scenes, or their stand-ins: holds when it holds on every one, fails when it fails on one,
    and is otherwise undecided, or not measured on some."""
    return lambda evidence: _combine(_outcomes(evidence.scenes, judge_scene), every=True)


def on_some_scene(judge_scene: SceneJudge) -> Judge:
    """A claim that something happens on some scene: holds when it does on one, fails when it does on none of the four
    (or their stand-ins), and is otherwise undecided, or not measured on some."""
    return lambda evidence: _combine(_outcomes(evidence.scenes, judge_scene), every=False)


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


def _outcomes(scenes: Mapping[str, SceneRows], judge_scene: SceneJudge) -> list[tuple[str, SceneRows | None, Outcome]]:
    outcomes: list[tuple[str, SceneRows | None, Outcome]] = []
    for name in PAPER_SCENES:
        scene = scenes.get(name)
        if scene is None:
            outcomes.append((name, scene, Outcome(None, why=_absent())))
            continue
        try:
            outcome = judge_scene(scene)
        except NotMeasuredError as error:
            outcome = Outcome(None, why=str(error))
        outcomes.append((scene.scene, scene, outcome))
    return outcomes


def _combine(outcomes: Sequence[tuple[str, SceneRows | None, Outcome]], every: bool) -> Judgement:
    verdicts = [outcome.verdict for _, _, outcome in outcomes]
    # One scene settles the claim, or else one leaves it open, in this order; or all agree.
    settling = (DOES_NOT_HOLD, NOT_MEASURED, UNDECIDED) if every else (HOLDS, NOT_MEASURED, UNDECIDED)
    verdict = next((one for one in settling if one in verdicts), verdicts[0])
    values, intervals, stand_ins = [], [], []
    scenes_by_reason: dict[str, list[str]] = {}
    for name, scene, outcome in outcomes:
        values.append(f"{name}: {outcome.value or '-'} ({outcome.verdict})")
        if outcome.estimate is not None:
            intervals.append(f"{name} {outcome.estimate.interval()}")
        # A claim that fails is explained by what fails; what else is missing does not matter any more.
        relevant = verdict != DOES_NOT_HOLD or outcome.verdict == DOES_NOT_HOLD
        if outcome.why is not None and outcome.verdict != HOLDS and relevant:
            scenes_by_reason.setdefault(outcome.why, []).append(name)
        if scene is not None and scene.stand_in and outcome.value:
            stand_ins.append(f"{scene.scene} for {scene.paper_scene}")
    reasons = "; ".join(f"{', '.join(names)}: {why}" for why, names in scenes_by_reason.items())
    return Judgement(
        verdict,
        "; ".join(values) if any(outcome.value for _, _, outcome in outcomes) else "",
        "; ".join(intervals) or None,
        None if verdict == HOLDS else reasons,
        tuple(stand_ins),
    )


def _absent() -> str:
    return "neither the scene nor its stand-in is in the table"
