"""The conclusion: two sentences made of the verdicts and the best gains."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

from experiments.paper.claims import BEST_SPEEDUPS, best_speedup_id
from experiments.paper.gains import SceneGains
from experiments.paper.readings import READINGS, Reading
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

_SAID = {
    HOLDS: ("holds", "hold"),
    ONE_READING: ("holds under one reading of its baseline only", "hold under one reading of its baseline only"),
    DOES_NOT_HOLD: ("does not hold", "do not hold"),
    UNDECIDED: ("is undecided", "are undecided"),
    NOT_MEASURED: ("was not measured", "were not measured"),
}


def conclude(claims: Sequence[JudgedClaim], gains: Sequence[SceneGains], stand_ins: Collection[str] = ()) -> str:
    """What became of the paper's speed-ups, and of its other claims. What is only inferred from it is not counted.

    stand_ins: scenes of the paper that were replaced.
    """
    of_speed = {best_speedup_id(scene): scene for scene in BEST_SPEEDUPS}
    speed = [one for one in claims if one.id in of_speed]
    others = by_claim([one for one in claims if one.id not in of_speed and not one.inferred])
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
    verdicts = {one.id: one.verdict for one in speed if one.reading == reading.name}
    counted = Counter(verdicts.values())
    values = [
        found.gain.value
        for one in gains
        if verdicts.get(best_speedup_id(one.paper_scene), NOT_MEASURED) != NOT_MEASURED
        and (found := one.single[reading.name].best) is not None
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
    told = [f"{verdicts[one]} {_SAID[one][verdicts[one] != 1]}" for one in _SAID if verdicts[one]]
    on = f", judged on stand-ins for {_list(list(stand_ins))}," if stand_ins else ""
    return f"Of its {number} other claims{on} {_list(told)}."


def _list(parts: Sequence[str]) -> str:
    """ "one, two and three"."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
