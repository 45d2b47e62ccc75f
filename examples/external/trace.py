"""An external program for atra in Python, for machines without a compiler: every ray against every triangle.

atra method=program method.command='python examples/external/trace.py' scene=cornell_box width=64 height=64

It imports nothing of atra. The protocol is described in experiments/methods/outside/program.py.
"""

from __future__ import annotations

import sys
from time import perf_counter

import numpy as np

MISS = 0xFFFFFFFF
AT_ONCE = 4096
"""Rays traced at once, which bounds the memory."""


class Tracer:
    """A mesh and rays. mesh: corners (F, 3, 3). rays: (N, 8) origin, tnear, direction, tfar."""

    def __init__(self) -> None:
        self.corners = np.empty((0, 3, 3))
        self.rays = np.empty((0, 8), np.float32)

    def read_mesh(self, vertex_count: int, face_count: int, path: str) -> float:
        """Returns the seconds of building, without reading."""
        words = np.fromfile(path, "<u4", 3 * (vertex_count + face_count))
        start = perf_counter()
        vertices = words[: 3 * vertex_count].view("<f4").reshape(-1, 3).astype(np.float64)
        self.corners = vertices[words[3 * vertex_count :].reshape(-1, 3)]
        return perf_counter() - start

    def read_rays(self, count: int, path: str) -> None:
        self.rays = np.fromfile(path, "<f4", 8 * count).reshape(count, 8)

    def trace(self, path: str) -> float:
        """Returns the seconds of tracing, without writing."""
        start = perf_counter()
        t, face = np.full(len(self.rays), np.inf), np.full(len(self.rays), MISS, "<u4")
        for first in range(0, len(self.rays), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            t[part], face[part] = self.nearest(self.rays[part].astype(np.float64))
        taken_s = perf_counter() - start
        with open(path, "wb") as file:
            file.write(t.astype("<f4").tobytes() + face.tobytes())
        return taken_s

    def nearest(self, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """t and face of the nearest hit of each ray. The sign of a side is the same for both triangles that share
        it, to the last bit, so no ray slips between them."""
        origins, tnear, directions, tfar = rays[:, :3], rays[:, 3], rays[:, 4:7], rays[:, 7]
        nearest, face = tfar.copy(), np.full(len(rays), MISS, "<u4")
        for number, corners in enumerate(self.corners):
            a, b, c = corners[:, None] - origins
            sides = np.stack([volume(c, b, directions), volume(a, c, directions), volume(b, a, directions)])
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (a * normal).sum(1) / (directions * normal).sum(1)
            hit = ((sides >= 0).all(0) | (sides <= 0).all(0)) & (t > tnear) & (t < nearest)
            nearest[hit], face[hit] = t[hit], number
        return np.where(face == MISS, np.inf, nearest), face


def volume(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(a x b) . c of each row; exactly its negative for b and a."""
    x = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    y = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    z = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return x * c[:, 0] + y * c[:, 1] + z * c[:, 2]


def answer(tracer: Tracer, line: str) -> str:
    """The answer to a command, without the `ok` before it."""
    word, *rest = line.split(maxsplit=1)
    told = rest[0] if rest else ""
    if word == "atra-rays":
        return "trace.py 1"
    if word == "threads":
        return ""  # one is enough for any number
    if word == "mesh":
        vertices, faces, path = told.split(maxsplit=2)
        return repr(tracer.read_mesh(int(vertices), int(faces), path))
    if word == "rays":
        count, path = told.split(maxsplit=1)
        tracer.read_rays(int(count), path)
        return ""
    if word == "trace":
        return repr(tracer.trace(told))
    raise ValueError(f"unknown command {word}")


def main() -> None:
    tracer = Tracer()
    for line in sys.stdin:
        if line.strip() == "end":
            return
        try:
            print("ok", answer(tracer, line.strip()), flush=True)
        except (OSError, ValueError) as error:
            print("error", error, flush=True)


if __name__ == "__main__":
    main()
