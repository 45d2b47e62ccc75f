"""Calibration: how fast this machine is at what each family of constants counts.

    python -m experiments.law.model.calibrating

`sweep.skip_slower` predicts with the constants that this keeps, or else with those of the processor that the law was
fitted on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from statistics import median
from time import perf_counter, thread_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Count
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from experiments.law.model.choice import Choice, candidates
from experiments.law.model.constants import Machine, instruction_set, keep
from experiments.law.model.defaults import DEFAULTS
from experiments.law.model.forecasting import forecast
from experiments.law.model.formulas import Constants, family
from experiments.law.model.looking import look_at
from experiments.law.model.making import tracer_of

SIZE = 256
"""Pixels along the side of the images that are timed."""

FRAMES = 5
"""Frames timed of each choice; the fastest counts."""

LONGEST_S = 100.0
"""Seconds after which no further choice is timed."""


def calibrate(say: Callable[[str], None] = lambda line: None) -> Constants:
    """Constants of this machine: the defaults of its instruction set, those of each family times the median of measured
    over predicted, on three meshes, nearest hit and all hits. One thread, below two minutes.

    say: is told what is timed.
    """
    defaults = Machine(DEFAULTS[instruction_set()], False)
    ratios: dict[str, list[float]] = {}
    begin = perf_counter()
    for name, mesh in _meshes():
        camera = Camera((0.0, 0.6, 2.2), (0.0, 0.0, 0.0), width=SIZE, height=SIZE)
        look = look_at(mesh, camera)
        for want in ("nearest", "count"):
            for choice in candidates(camera, want):
                if perf_counter() - begin > LONGEST_S:
                    break
                say(f"{name}: {choice}, {want}")
                expected = forecast(look, choice, want, defaults)
                build_s, frame_s = _timed(mesh, camera, choice, want)
                ratios.setdefault(family(choice, want), []).append(frame_s / expected.frame_time_s)
                if want == "nearest":
                    ratios.setdefault(f"{choice.method}|build", []).append(build_s / max(expected.build_s, 1e-9))
    factors = {name: median(found) for name, found in ratios.items()}
    return {name: [factors.get(name, 1.0) * one for one in values] for name, values in defaults.constants.items()}


def _timed(mesh: Mesh, camera: Camera, choice: Choice, want: str) -> tuple[float, float]:
    """Seconds of plan and build, and of a frame."""
    out: Any = None
    with tracer_of(choice, mesh, camera, threads=1, ties="any") as tracer:
        tracer.build()  # again, as the first loads kernels
        frames_s = []
        for _ in range(FRAMES + 1):
            start = thread_time()
            out = tracer.trace(out=out) if want == "nearest" else tracer.gather(Count(), out=out)  # type: ignore[attr-defined]
            frames_s.append(thread_time() - start)
        return tracer.plan_time_s + tracer.build_time_s, max(min(frames_s[1:]), 1e-9)


def _meshes() -> Iterator[tuple[str, Mesh]]:
    """A few large triangles, many small ones, and a rough ground."""
    random = np.random.default_rng(7)

    def soup(count: int, size: float) -> Mesh:
        corners = random.uniform(-0.7, 0.7, (count, 1, 3)) + size * random.normal(size=(count, 3, 3))
        return Mesh(corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3))

    yield "large triangles", soup(300, 0.2)
    yield "small triangles", soup(30_000, 0.02)
    yield "ground", _ground(150, random)


def _ground(side: int, random: np.random.Generator) -> Mesh:
    line = np.linspace(-1.0, 1.0, side + 1)
    x, z = np.meshgrid(line, line)
    heights: NDArray[np.float64] = 0.1 * np.sin(5 * x) * np.cos(4 * z) + 0.004 * random.normal(size=x.shape)
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    faces = np.stack([corner, corner + side + 1, corner + 1, corner + 1, corner + side + 1, corner + side + 2], axis=1)
    vertices = np.stack([x, heights - 0.3, z], axis=-1).reshape(-1, 3)
    return Mesh(vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.uint32))


if __name__ == "__main__":
    found = calibrate(lambda line: print(line, file=sys.stderr))
    print(f"constants of this machine are in {keep(found)}")
