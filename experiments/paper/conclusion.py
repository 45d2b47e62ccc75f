"""Best gains scene by scene, the paper's beside ours under each reading; and the conclusion in two sentences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from experiments.paper.claims import best_speedup_id
from experiments.paper.evidence import TIMED, NotMeasuredError, SceneRows, collect_scenes
from experiments.paper.judging import paper_scene
from experiments.paper.readings import PACKETS_OVER, READINGS, BestGain, Reading, best_gain, readings_of
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
from experiments.results.verdicts import decide_greater
from experiments.workloads.reported import BEST_SPEEDUPS


@dataclass(frozen=True)
class Gain:
    """best: None where there is none. why: why there is none, or why there may be a better one; None where all was
    measured."""

    best: BestGain | None
    why: str | None


@dataclass(frozen=True)
class SceneGains:
    """Best gains of one scene over horizontal splits, culling on.

    paper: the paper's best speed-up of single rays; None where ours are not to be held against it, and then `differs`
    says why. single: by reading, single rays over single rays. packets: packets of `packet_width` rays, by what they
    are over (`PACKETS_OVER`); empty without packets.
    """

    paper_scene: str
    scene: str
    stand_in: bool
    triangles: int | None
    paper: float | None
    differs: str | None
    single: dict[str, Gain]
    packet_width: int
    packets: dict[str, Gain]


def scene_gains(processes: pd.DataFrame | None) -> tuple[SceneGains, ...]:
    """The gains of each of the paper's scenes, or of its stand-in, whose frames or all hits were timed.

    processes: as `experiments.results.table.make_tables` gives them. Raises NotMeasuredError where its rows do not
    compare, and where there is not one gain to be had, each with its reason.
    """
    scenes = collect_scenes(processes)
    timed = {name: scene for name, scene in scenes.items() if any(row["workload"] in TIMED for row in scene.rows)}
    readings = readings_of(processes)
    by_scene = tuple(_of_scene(name, scene, scenes, readings) for name, scene in timed.items())
    gains = [gain for of_scene in by_scene for gain in (*of_scene.single.values(), *of_scene.packets.values())]
    if all(gain.best is None for gain in gains):
        raise NotMeasuredError(
            next((gain.why for gain in gains if gain.why), "no frame of a scene of the paper was timed")
        )
    return by_scene


def _of_scene(name: str, scene: SceneRows, scenes: dict[str, SceneRows], readings: tuple[Reading, ...]) -> SceneGains:
    paper: float | None
    try:
        paper_scene(scenes, name)
        paper, differs = BEST_SPEEDUPS[name], None
    except NotMeasuredError as error:
        paper, differs = None, str(error)
    workloads = {reading.workload for reading in readings}
    width = max(scene.widest_packets(workload) for workload in workloads)
    packets = {
        words: _gain(scene, reading, width, 1 if over_single else width)
        for words, reading, over_single in PACKETS_OVER
        if width > 1 and reading.workload in workloads
    }
    return SceneGains(
        paper_scene=name,
        scene=scene.scene,
        stand_in=scene.stand_in,
        triangles=next((row["triangles"] for row in scene.rows if row["triangles"] is not None), None),
        paper=paper,
        differs=differs,
        single={reading.name: _gain(scene, reading) for reading in readings},
        packet_width=width,
        packets=packets,
    )


def _gain(*asked: Any) -> Gain:
    try:
        gain = best_gain(*asked)
    except NotMeasuredError as error:
        return Gain(None, str(error))
    return Gain(gain, gain.missing)


_STANDS = {True: "ahead", None: "level", False: "behind"}


def where_packets_stand(gains: Sequence[SceneGains]) -> list[str]:
    """A sentence for each kind of ray packets: the scenes where aligned packets are ahead of them, level with
    them or behind them, by the one rule of verdict."""
    told = []
    for words in (words for words, reading, _ in PACKETS_OVER if not reading.gathers):
        decided: dict[bool | None, list[str]] = {ahead: [] for ahead in _STANDS}
        for of_scene in gains:
            if words in of_scene.packets and (best := of_scene.packets[words].best) is not None:
                decided[decide_greater(best.gain)].append(of_scene.scene)
        said = "; ".join(f"{_STANDS[ahead]} on {_list(names)}" for ahead, names in decided.items() if names)
        if said:
            told.append(f"Aligned packets beside {words}: {said}.")
    return told


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
    of_speed = {best_speedup_id(scene): scene for scene in BEST_SPEEDUPS}
    speed = [claim for claim in claims if claim.id in of_speed]
    others = by_claim([claim for claim in claims if claim.id not in of_speed and not claim.inferred])
    verdicts = Counter(verdict_on(readings) for readings in others)
    return f"{_say_speed(speed, gains)} {_say_others(verdicts, stand_ins)}"


def _say_speed(speed: Sequence[JudgedClaim], gains: Sequence[SceneGains]) -> str:
    reached = [told for reading in READINGS if (told := _say_reading(reading, speed, gains))]
    if not reached:
        return "No speed-up was measured that is to be held against the paper's."
    low, high = min(BEST_SPEEDUPS.values()), max(BEST_SPEEDUPS.values())
    return f"The paper's best speed-ups, {low:.2f} to {high:.2f}, are reached {', and '.join(reached)}."


def _say_reading(reading: Reading, speed: Sequence[JudgedClaim], gains: Sequence[SceneGains]) -> str:
    """ "" where no scene was judged."""
    verdicts = {claim.id: claim.verdict for claim in speed if claim.reading == reading.name}
    counted = Counter(verdicts.values())
    values = [
        best.gain.value
        for of_scene in gains
        if verdicts.get(best_speedup_id(of_scene.paper_scene), NOT_MEASURED) != NOT_MEASURED
        and (best := of_scene.single[reading.name].best) is not None
    ]
    if not values:
        return ""
    low, high = (f"{value:.2f}" for value in (min(values), max(values)))
    open_ones = [f"; {verdict} on {counted[verdict]}" for verdict in (UNDECIDED, NOT_MEASURED) if counted[verdict]]
    return (
        f"on {counted[HOLDS] or 'none'} of {len(BEST_SPEEDUPS)} scenes over {reading.rays} "
        f"({low if low == high else f'{low} to {high}'} here{''.join(open_ones)})"
    )


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
