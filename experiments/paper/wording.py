"""How the paper's claims are judged, in words that several share, and under which readings."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from experiments.paper.readings import EVERY_HIT, READINGS
from experiments.results.claims import Judge

SINGLE_RAYS = "Single rays, each process by its speed-up over rtcIntersect1 in the same rounds. "
RULE = (
    "Holds on a scene when the whole 95 % interval lies above {limit}, fails when it lies below, and is undecided "
    "otherwise. Intervals are Student's, over processes, in logarithms. "
)
DECIDED = RULE.format(limit=1)
REACHES = RULE.format(limit="the paper's value")
CHOSEN = "What is chosen as best is chosen on half of the processes and reported on the others. "
OUR_READING = "Our reading: "
NO_INTERVAL = "Bytes are counted once, so they carry no interval. "


def alone(judge: Judge) -> dict[str, Judge]:
    """Nothing that the paper leaves open matters."""
    return {"": judge}


def alike(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """The baseline does not matter, but whether the nearest hit is wanted or every one."""
    return {"": on_scenes(judge), EVERY_HIT.name: on_scenes(partial(judge, workload=EVERY_HIT.workload))}


def each(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """Under each reading of the paper's baseline."""
    return {reading.name: on_scenes(partial(judge, reading=reading)) for reading in READINGS}
