"""Best gains scene by scene, the paper's beside ours under each reading; and the conclusion in two sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from experiments.paper.evidence import TIMED, Scene, collect_scenes, paper_scene
from experiments.paper.readings import PACKETS_OVER, READINGS, Gain, Reading, best_gain, readings_of
from experiments.results.claims import (
    DOES_NOT_HOLD,
    HOLDS,
    NOT_MEASURED,
    ONE_READING,
    UNDECIDED,
    JudgedClaim,
    by_claim,
    verdict_on,
)
from experiments.results.statistics import NotMeasuredError
from experiments.workloads.reported import BEST_SPEEDUPS


@dataclass(frozen=True)
class SceneGains:
    """Best gains of one scene over horizontal splits, culling on; in place of a gain stands why there is none.

    paper: the paper's best speed-up of single rays; None where ours are not to be held against it, and then `differs`
    says why. single: by reading, single rays over single rays. packets: packets of `packet_width` rays, by what they
    are over (`PACKETS_OVER`); empty without packets.
    """

    scene: Scene
    triangles: int | None
    paper: float | None
    differs: str | None
    single: dict[str, Gain | str]
    packet_width: int
    packets: dict[str, Gain | str]


def scene_gains(processes: pd.DataFrame | None) -> tuple[SceneGains, ...]:
    """The gains of each of the paper's scenes, or of its stand-in, whose frames or all hits were timed.

    processes: as `experiments.results.table.make_tables` gives them. Raises NotMeasuredError where its rows do not
    compare, and where there is not one gain to be had, each with its reason.
    """
    scenes, readings = collect_scenes(processes), readings_of(processes)
    by_scene = [
        _of_scene(scene, scenes, readings) for scene in scenes.values() if scene.rows["workload"].isin(TIMED).any()
    ]
    gains = [gain for of_scene in by_scene for gain in (*of_scene.single.values(), *of_scene.packets.values())]
    if not any(isinstance(gain, Gain) for gain in gains):
        raise NotMeasuredError(gains[0] if gains else "no frame of a scene of the paper was timed")
    return tuple(by_scene)


def _of_scene(scene: Scene, scenes: dict[str, Scene], readings: tuple[Reading, ...]) -> SceneGains:
    differs = None
    try:
        paper_scene(scenes, scene.name)
    except NotMeasuredError as error:
        differs = str(error)
    workloads = {reading.workload for reading in readings}
    width = max(map(scene.widest_packets, workloads))
    packets = {
        words: _gain(scene, reading, width, 1 if over_single else width)
        for words, reading, over_single in PACKETS_OVER
        if width > 1 and reading.workload in workloads
    }
    triangles, paper = scene.rows["triangles"].dropna(), BEST_SPEEDUPS[scene.name] if differs is None else None
    single = {reading.name: _gain(scene, reading) for reading in readings}
    return SceneGains(scene, next(iter(triangles), None), paper, differs, single, width, packets)


def _gain(*asked: Any) -> Gain | str:
    try:
        return best_gain(*asked)
    except NotMeasuredError as error:
        return str(error)


_SAID = {
    HOLDS: ("holds", "hold"),
    ONE_READING: ("holds under one reading of its baseline only", "hold under one reading of its baseline only"),
    DOES_NOT_HOLD: ("does not hold", "do not hold"),
    UNDECIDED: ("is undecided", "are undecided"),
    NOT_MEASURED: ("was not measured", "were not measured"),
}


def conclude(claims: Sequence[JudgedClaim], gains: Sequence[SceneGains], stand_ins: Collection[str] = ()) -> str:
    """Which of the paper's speed-ups and other claims were reproduced. Claims that are only inferred do not count.

    stand_ins: scenes of the paper that were replaced.
    """
    of_speed = {f"best-speedup-{scene}": scene for scene in BEST_SPEEDUPS}
    speed = [(of_speed[claim.id], claim) for claim in claims if claim.id in of_speed]
    reached = [told for reading in READINGS if (told := _say_reading(reading, speed, gains))]
    low, high = min(BEST_SPEEDUPS.values()), max(BEST_SPEEDUPS.values())
    said = f"The paper's best speed-ups, {low:.2f} to {high:.2f}, are reached {', and '.join(reached)}."
    if not reached:
        said = "No speed-up was measured that is to be held against the paper's."
    others = by_claim([claim for claim in claims if claim.id not in of_speed and not claim.inferred])
    return f"{said} {_say_others(Counter(map(verdict_on, others)), stand_ins)}"


def _say_reading(
    reading: Reading, speed: Sequence[tuple[str, JudgedClaim]], gains: Sequence[SceneGains]
) -> str:  # fmt: skip
    """ "" where no scene was judged."""
    verdicts = {scene: claim.verdict for scene, claim in speed if claim.reading == reading.name}
    judged = [
        gain.estimate.value
        for of_scene in gains
        if verdicts.get(of_scene.scene.name, NOT_MEASURED) != NOT_MEASURED
        and isinstance(gain := of_scene.single[reading.name], Gain)
    ]
    if not judged:
        return ""
    counted = Counter(verdicts.values())
    values = " to ".join(dict.fromkeys(f"{value:.2f}" for value in (min(judged), max(judged))))
    left_open = [f"; {verdict} on {counted[verdict]}" for verdict in (UNDECIDED, NOT_MEASURED) if counted[verdict]]
    number = f"on {counted[HOLDS] or 'none'} of {len(BEST_SPEEDUPS)} scenes over {reading.rays}"
    return f"{number} ({values} here{''.join(left_open)})"


def _say_others(verdicts: Counter[str], stand_ins: Collection[str]) -> str:
    number = verdicts.total()
    if verdicts[NOT_MEASURED] == number:
        return "None of its other claims was measured."
    told = [f"{verdicts[verdict]} {_SAID[verdict][verdicts[verdict] != 1]}" for verdict in _SAID if verdicts[verdict]]
    on = f", judged on stand-ins for {_list(list(stand_ins))}," if stand_ins else ""
    return f"Of its {number} other claims{on} {_list(told)}."


def _list(parts: Sequence[str]) -> str:
    """ "one, two and three"."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
