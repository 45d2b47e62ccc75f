"""Best gains scene by scene: what the paper reports beside ours under each reading, and ours with packets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from experiments.paper.claims import BEST_SPEEDUPS
from experiments.paper.evidence import TIMED, NotMeasuredError, SceneRows, collect_scenes
from experiments.paper.judging import paper_scene
from experiments.paper.readings import PACKETS_OVER, BestGain, Reading, best_gain, readings_of


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
    """Of each of the paper's scenes of which a frame or all hits were timed, or of its stand-in.

    processes: as `experiments.results.table.make_tables` gives them. Raises NotMeasuredError where its rows do not
    compare, and where there is not one gain to be had, each with its reason.
    """
    scenes = collect_scenes(processes)
    timed = {name: scene for name, scene in scenes.items() if any(row["workload"] in TIMED for row in scene.rows)}
    readings = readings_of(processes)
    found = tuple(_of_scene(name, scene, scenes, readings) for name, scene in timed.items())
    gains = [gain for one in found for gain in (*one.single.values(), *one.packets.values())]
    if all(gain.best is None for gain in gains):
        raise NotMeasuredError(
            next((gain.why for gain in gains if gain.why), "no frame of a scene of the paper was timed")
        )
    return found


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
        found = best_gain(*asked)
    except NotMeasuredError as error:
        return Gain(None, str(error))
    return Gain(found, found.missing)
