"""Has a change made frames slower? Paired ratios on built-in scenes, held against a stored baseline.

    python -m benchmarks.regression            # compare with benchmarks/baseline.json; exit code 1 if one is slower
    python -m benchmarks.regression --store    # make the present code the baseline

A ratio is the time of rtcIntersect1 per pixel over that of a method in the same round, so that a slow moment of the
machine hits both; it depends on the kind of processor, which is why a baseline of another kind is refused.
"""

from __future__ import annotations

import argparse
import json
import sys
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from atra import AlignedTracer, Camera, PixelTracer, TiledTracer, Tracer, VisibleFirstTracer
from atra.files import write_atomically
from experiments.harness.configuration import SceneSource
from experiments.harness.environment import read_environment
from experiments.harness.rounds import measure_rounds
from experiments.harness.scene_loading import load_scene
from experiments.results.table import median_interval

BASELINE_FILE = Path(__file__).with_name("baseline.json")
SCENES = ("cornell_box", "material_ball", "living_room", "atrium")
SIZE_PIXELS = 512

NOISE = 0.15
"""Runs of one and the same code were up to 12 % apart, all rounds of a process alike: where memory lies, perhaps."""


@dataclass(frozen=True)
class Ratio:
    """Median over rounds of rtcIntersect1's time over a method's, and the 95 % confidence interval of that median."""

    median: float
    low: float
    high: float


def measure_ratios(scene: str, rounds: int) -> dict[str, Ratio]:
    """Ratios of every method of ours on one built-in scene, one thread, by the method's name."""
    mesh, camera_fields = load_scene(SceneSource.procedural, scene, None)
    camera = Camera(**camera_fields, width=SIZE_PIXELS, height=SIZE_PIXELS)
    tracers: dict[str, Tracer] = {
        "rtcIntersect1": PixelTracer(mesh, camera, packet_width=1, threads=1),
        "packets": PixelTracer(mesh, camera, threads=1),
        "aligned, single rays": AlignedTracer(mesh, camera, (64, 1), packet_width=1, threads=1),
        "aligned": AlignedTracer(mesh, camera, (64, 1), threads=1),
        "visible_first": VisibleFirstTracer(mesh, camera, (64, 1), threads=1),
        "tiles": TiledTracer(mesh, camera, (16, 16), threads=1),
    }
    with ExitStack() as stack:
        frames = {}
        for name, tracer in tracers.items():
            stack.enter_context(tracer)
            image = tracer.trace()
            frames[name] = lambda tracer=tracer, image=image: tracer.trace(out=image)
        timed = measure_rounds(frames, rounds=rounds, warmup=1)
    samples = {name: np.asarray(values) for name, values in timed.samples.items()}
    single = samples.pop("rtcIntersect1")
    return {
        name: Ratio(float(np.median(single / own)), *median_interval(single / own)) for name, own in samples.items()
    }


def verdict(now: Ratio, before: Ratio) -> str:
    """What changed: a move beyond the noise between processes, with confidence intervals apart."""
    moved = now.median / before.median
    if now.high < before.low and moved < 1 - NOISE:
        return "slower"
    return "faster" if now.low > before.high and moved > 1 + NOISE else "no difference shown"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--store", action="store_true", help="make the present code the baseline")
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    cpu = read_environment().cpu
    stored: dict[str, Any] = (
        json.loads(BASELINE_FILE.read_text(encoding="utf-8")) if BASELINE_FILE.exists() else {"cpu": None}
    )
    if not arguments.store and stored["cpu"] != cpu:
        had = f"it is of {stored['cpu']}, this is {cpu}" if stored["cpu"] else "there is none"
        print(f"no baseline to compare with ({had}); make one with --store", file=sys.stderr)
        return 2
    ratios = {scene: measure_ratios(scene, arguments.rounds) for scene in SCENES}
    if arguments.store:
        plain = {scene: {name: asdict(ratio) for name, ratio in of.items()} for scene, of in ratios.items()}
        write_atomically(BASELINE_FILE, (json.dumps({"cpu": cpu, "ratios": plain}, indent=1) + "\n").encode())
        print(f"stored {BASELINE_FILE.name}")
        return 0
    table = Table("scene", "method", "rtcIntersect1 / method", "baseline", "moved by", "")
    slower = 0
    for scene, of_scene in ratios.items():
        for name, now in of_scene.items():
            before = Ratio(**stored["ratios"][scene][name])
            told = verdict(now, before)
            slower += told == "slower"
            shown = [f"{one.median:.2f} [{one.low:.2f}, {one.high:.2f}]" for one in (now, before)]
            table.add_row(scene, name, *shown, f"{now.median / before.median - 1:+.1%}", told)
    Console(width=120).print(table)
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
