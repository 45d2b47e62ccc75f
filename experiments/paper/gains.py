"""Best gains scene by scene: what the paper reports beside ours under both readings, and ours with packets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import pandas as pd

from experiments.paper.claims import BEST_SPEEDUPS
from experiments.paper.evidence import NotMeasuredError, SceneRows, collect_scenes
from experiments.paper.judging import paper_scene
from experiments.paper.readings import ALL_HITS, NEAREST, READINGS, BestGain, best_gain
from experiments.workloads.frame import FRAME


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
    says why. single: by reading, single rays over single rays. packets: packets of `packet_width` rays over packets,
    by reading, then over single rays that gather all hits; empty without packets.
    """

    paper_scene: str
    scene: str
    stand_in: bool
    triangles: int | None
    paper: float | None
    differs: str | None
    single: dict[str, Gain]
    packet_width: int
    packets: tuple[Gain, ...]


PACKETS_OVER = (
    "packets per pixel, nearest hit",
    "packets that gather all hits",
    "single rays that gather all hits",
)
"""What the gains of packets are over, in their order."""


def scene_gains(processes: pd.DataFrame | None) -> tuple[SceneGains, ...]:
    """Of each of the paper's scenes of which a frame was timed, or of its stand-in.

    processes: as `experiments.results.table.make_tables` gives them. Raises NotMeasuredError where its rows do not
    compare, and where there is not one gain to be had, each with its reason.
    """
    scenes = collect_scenes(processes)
    timed = {name: scene for name, scene in scenes.items() if any(row["workload"] == FRAME.name for row in scene.rows)}
    found = tuple(_of_scene(name, scene, scenes) for name, scene in timed.items())
    gains = [gain for one in found for gain in (*one.single.values(), *one.packets)]
    if all(gain.best is None for gain in gains):
        raise NotMeasuredError(
            next((gain.why for gain in gains if gain.why), "no frame of a scene of the paper was timed")
        )
    return found


def _of_scene(name: str, scene: SceneRows, scenes: dict[str, SceneRows]) -> SceneGains:
    paper: float | None
    try:
        paper_scene(scenes, name)
        paper, differs = BEST_SPEEDUPS[name], None
    except NotMeasuredError as error:
        paper, differs = None, str(error)
    width = scene.widest_packets
    packets: tuple[Gain, ...] = ()
    if width > 1:
        over = ((NEAREST, width), (ALL_HITS, width), (ALL_HITS, 1))
        packets = tuple(_gain(scene, reading, width, rays) for reading, rays in over)
    return SceneGains(
        paper_scene=name,
        scene=scene.scene,
        stand_in=scene.stand_in,
        triangles=next((row["triangles"] for row in scene.rows if row["triangles"] is not None), None),
        paper=paper,
        differs=differs,
        single={reading.name: _gain(scene, reading) for reading in READINGS},
        packet_width=width,
        packets=packets,
    )


def _gain(*asked: Any) -> Gain:
    try:
        found = best_gain(*asked)
    except NotMeasuredError as error:
        return Gain(None, str(error))
    return Gain(found, found.missing)
