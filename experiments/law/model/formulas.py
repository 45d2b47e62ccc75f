"""The law: time and preparation of a method as sums of counts times constants; `memory` has its bytes.

A constant is the time, or the bytes, of one thing that is counted. Methods that do the same work share a formula, not
its constants. Derivation: docs/model.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import log2

import numpy as np
from numpy.typing import NDArray

from experiments.law.model.choice import Choice
from experiments.law.model.copying import Copied
from experiments.law.model.looking import Look

Constants = Mapping[str, Sequence[float]]
"""Constants by family: nanoseconds of a frame, nanoseconds of preparation ("...|build"), bytes ("...|bytes")."""

NANO = 1e-9

WHOLE, SEEN = 0, 1

WANTS = {"frame": "nearest", "gather": "count"}
"""What a frame of each workload that is predicted asks for."""

IN_CACHE = 3e4
"""Boxes and triangles that a cache holds, some three megabytes."""


STEPS = 12
"""Weighted least squares of a fit."""


def above_and_below(boxes: NDArray[np.float64], cells: int) -> tuple[float, float]:
    """Boxes in the upper levels, which all cells share, and in those below. boxes: (LEVELS,)."""
    above = np.clip(log2(cells) - np.arange(len(boxes)), 0.0, 1.0)
    return float((above * boxes).sum()), float(((1.0 - above) * boxes).sum())


class Counts:
    """What a choice meets on a view, for a frame of all pixels.

    packets: groups of rays as wide as a packet over the whole image. shot: those of the reference cell, or all; row:
    those of a row of it. upper, lower: boxes that packets enter, in the levels that all cells share and in those below;
    tested, met: triangles. shape: of packets, in place of the choice's own.
    """

    def __init__(self, look: Look, choice: Choice, part: int, shape: tuple[int, int] | None = None) -> None:
        shape = shape or choice.packet_shape(look.width, look.height)
        kind = look.shape(shape)
        cell = look.width // choice.split[0], look.height // choice.split[1]
        row = -(-cell[0] // shape[0])
        inside = row * -(-cell[1] // shape[1])
        self.packets = float(inside * choice.cells)
        self.shot, self.row = float(inside), float(row)
        self.upper, self.lower = above_and_below(look.boxes[kind, part], choice.cells)
        self.tested, self.met = float(look.tested[kind, part]), float(look.met[kind, part])


def family(choice: Choice, want: str) -> str:
    """The name of the constants of a choice."""
    packets = {"pixel": True, "aligned": True, "bvh": True}.get(choice.method, False)
    name = f"{choice.method} {'packets' if choice.packet_width > 1 else 'single'}" if packets else choice.method
    return f"{name}|{'nearest' if want == 'nearest' else 'all'}"


def _ray_by_ray(look: Look, choice: Choice, part: int) -> list[float]:
    """For each packet: itself, boxes, triangles tested, triangles hit."""
    counts = Counts(look, choice, part)
    n = counts.packets
    return [n, n * (counts.upper + counts.lower), n * counts.tested, n * counts.met]


def _tiles(look: Look, choice: Choice, part: int) -> list[float]:
    """For each packet: itself, boxes in the levels above the cells' own roots and below, triangles hit; and for each
    cell and each copy: itself, as it is read once a frame. What is tested has no price of its own: its constant was 0.
    """
    counts = Counts(look, choice, SEEN)
    n = counts.packets
    copies = _copied(look, choice).copies
    return [n, n * counts.upper, n * counts.lower, n * counts.met, float(choice.cells), copies]


def _aligned(look: Look, choice: Choice, part: int) -> list[float]:
    """For each packet shot: itself and the shared boxes. For each packet of every cell: boxes of its own, triangles
    tested and hit. For each copy: itself, as it is read once a frame. Then triangles hit beyond the cache, and what
    packets meet that the second pass traces again."""
    along = SEEN if choice.method == "visible_first" else WHOLE
    counts, copied = Counts(look, choice, along), _copied(look, choice)
    n = counts.packets
    return [
        counts.shot * (1.0 + counts.upper), n * counts.lower, n * counts.tested, n * counts.met, copied.copies,
        n * counts.met * _beyond_cache(look, choice, along),
        n * copied.again * (counts.upper + counts.lower + counts.tested),
    ]  # fmt: skip


def _beyond_cache(look: Look, choice: Choice, along: int) -> float:
    """The share of what a row of packets meets, in all cells, that is out of the cache when the next row needs it.

    Rays side by side meet the same boxes, so a row meets no more than flat packets as wide as it.
    """
    shapes = choice.packet_shape(look.width, look.height), look.shapes[1]
    rows = [
        counts.row * (counts.lower + counts.tested)
        for counts in (Counts(look, choice, along, shape) for shape in shapes)
    ]
    met = min(_copied(look, choice).copies, choice.cells * min(rows))
    return max(0.0, 1.0 - IN_CACHE / met) if met > 0.0 else 0.0


def _instanced(look: Look, choice: Choice, part: int) -> list[float]:
    """For each packet of every cell: the instance, boxes from the mesh's root, triangles tested and hit."""
    counts = Counts(look, choice, WHOLE)
    n = counts.packets
    return [n, n * (counts.upper + counts.lower), n * counts.tested, n * counts.met]


def _raster(look: Look, choice: Choice, part: int) -> list[float]:
    """The frame of the look, in nanoseconds; the image; all hits."""
    pixels = float(look.width * look.height)
    return [look.raster_s / NANO, pixels, pixels * float(look.met[0, WHOLE]) * part]


_FORMULAS: dict[str, Callable[[Look, Choice, int], list[float]]] = {
    "raster": _raster,
    "pixel": _ray_by_ray,
    "bvh": _ray_by_ray,
    "classified": _ray_by_ray,
    "tiles": _tiles,
    "visible_first": _aligned,
    "aligned": _aligned,
    "instanced": _instanced,
}


def frame_terms(look: Look, choice: Choice, want: str) -> NDArray[np.float64]:
    """Counts of a frame, one for each constant of the family."""
    nearest = want == "nearest"
    if choice.method == "raster":
        return np.array(_raster(look, choice, 0 if nearest else 1))
    return np.array(_FORMULAS[choice.method](look, choice, SEEN if nearest else WHOLE))


def build_terms(look: Look, choice: Choice) -> NDArray[np.float64]:
    """Counts of plan and build: once, triangles, copies, cells."""
    return np.array([1.0, look.triangles, _copied(look, choice).copies, choice.cells])


def _copied(look: Look, choice: Choice) -> Copied:
    return look.copied(choice.method, choice.split, choice.culling)


def fit(
    terms: NDArray[np.float64], measured: NDArray[np.float64], known: NDArray[np.float64] | float = 0.0
) -> NDArray[np.float64]:
    """Constants, none below 0, with which sums of terms come nearest to what was measured, by relative errors.

    terms: (N, K), measured: (N,). known: (N,), what is part of it without a constant. Outliers count by their size, not
    its square: least squares, weighted again.
    """
    rows, wanted = terms / measured[:, None], 1.0 - known / measured
    scale = np.maximum(np.abs(rows).max(axis=0), 1e-300)
    rows = rows / scale
    weights, constants = np.ones(len(rows)), np.zeros(rows.shape[1])
    for _ in range(STEPS):
        constants = _least_squares(rows * weights[:, None], wanted * weights)
        weights = 1.0 / np.sqrt(np.maximum(np.abs(rows @ constants - wanted), 0.02))
    return constants / scale


def _least_squares(rows: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares over numbers of at least 0. Source: C. Lawson, R. Hanson, "Solving least squares problems", 1974,
    chapter 23."""
    square, target = rows.T @ rows, rows.T @ wanted
    square[np.diag_indices_from(square)] += 1e-9
    solution, free = np.zeros(len(target)), np.zeros(len(target), np.bool_)
    for _ in range(3 * len(target)):
        slope = np.where(free, 0.0, target - square @ solution)
        if slope.max(initial=0.0) <= 1e-9 * np.abs(target).max(initial=1.0):
            break
        free[slope.argmax()] = True
        while free.any():
            trial = np.zeros_like(solution)
            trial[free] = np.linalg.solve(square[np.ix_(free, free)], target[free])
            below = free & (trial <= 0.0)
            if not below.any():
                solution = trial
                break
            step = (solution[below] / (solution[below] - trial[below])).min()
            solution = solution + step * (trial - solution)
            free &= solution > 1e-12
    return solution
