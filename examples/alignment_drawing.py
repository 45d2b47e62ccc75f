"""Alignment in one drawing
========================

The paper's idea in four steps: cells, culling, shear, and the rays that are left (paper §3.1).

::

    python -m examples.alignment_drawing

A small scene seen from above: the eye looks up the page, a row of 16 pixels is cut into four cells. What each cell sees
is sheared by the cell's own map of `atra.Alignment`, so that four rays stand for sixteen. The hits drawn are those that
`AlignedTracer` found. Writes `alignment.png`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from math import atan, degrees
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

import atra

PIXELS, CELLS, HALF_WIDTH = 16, 4, 0.9  # half the image's width, at distance 1 from the eye
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7")
IMAGE_AT, FARTHEST = 2.6, 11.0  # distances from the eye to the image, and to the end of the drawing
STEPS = ("1. cut the image into cells", "2. cull: one cell's triangles", "3. shear them", "4. all cells: four rays")
EXAMPLE_CELL = 2  # the cell that the second and third step follow
_TURNS = np.linspace(0, 2 * np.pi, 48, endpoint=False)
SHAPES = (
    np.stack([-3.4 + 0.9 * np.cos(_TURNS), 5.15 + 0.9 * np.sin(_TURNS)], axis=1),
    np.array([(-3.6, 9.3), (1.9, 10.1), (1.9, 10.7), (-3.6, 9.9)]),
    np.array([(0.8, 5.7), (2.4, 5.9), (2.2, 7.1), (0.6, 6.9)]),
    np.array([(3.7, 7.3), (6.4, 7.5), (5.2, 8.9)]),
)
"""Outlines, (N, 2) each: how far to the right of the eye, how far before it."""


def camera() -> atra.Camera:
    """Sixteen square pixels side by side."""
    fov_y_degrees = 2 * degrees(atan(HALF_WIDTH / PIXELS))
    return atra.Camera((0, 0, 0), (0, 0, 1), (0, 1, 0), fov_y_degrees, width=PIXELS, height=1)


def mesh_of(outlines: tuple[NDArray[np.float64], ...], view: atra.Camera) -> atra.Mesh:
    """Every outline as a wall that stands upright before the camera."""
    walls = np.concatenate([np.stack([outline, np.roll(outline, -1, axis=0)], axis=1) for outline in outlines])
    (left, right), low, high = walls.transpose(1, 0, 2), np.full(len(walls), -2.0), np.full(len(walls), 2.0)
    corners = [(left, low), (right, low), (right, high), (left, high)]
    points = np.stack([np.stack([ends[:, 0], down, ends[:, 1]], axis=1) for ends, down in corners], axis=1)
    first = 4 * np.arange(len(walls))[:, None]
    faces = np.concatenate([first + (0, 1, 2), first + (0, 2, 3)])
    return atra.Mesh((points.reshape(-1, 3) @ view.axes).astype(np.float32), faces)


def trace(view: atra.Camera) -> tuple[atra.Alignment, NDArray[np.float64]]:
    """The alignment of the four cells, and the depth of the hit of each pixel (inf: none)."""
    mesh, split = mesh_of(SHAPES, view), (CELLS, 1)
    with (
        atra.AlignedTracer(mesh, view, split, packet_width=1, threads=1) as aligned,
        atra.PixelTracer(mesh, view, packet_width=1, threads=1) as single,
    ):
        hits, reference = aligned.trace(), single.trace()
    agreement = atra.compare(hits, reference)
    if agreement.pixels_wrong:
        raise atra.AtraError(f"the drawing would be wrong: {agreement}")
    return atra.Alignment.of_cells(view, atra.Split.of_image(split, view)), np.array(hits.depth[0], np.float64)


def clipped(outline: NDArray[np.float64], slope: float, side: int) -> NDArray[np.float64]:
    """What of an outline lies to the right (side = 1) or left (-1) of the line from the eye with x = slope z."""
    beside = side * (outline[:, 0] - slope * outline[:, 1])
    kept: list[NDArray[np.float64]] = []
    for here, there, point, following in zip(
        beside, np.roll(beside, -1), outline, np.roll(outline, -1, 0), strict=True
    ):
        if here >= 0:
            kept.append(point)
        if (here >= 0) != (there >= 0):
            kept.append(point + here / (here - there) * (following - point))
    return np.array(kept).reshape(-1, 2)


def pieces(cell: int) -> Iterator[NDArray[np.float64]]:
    """What culling leaves of each outline in a cell, cut to the cell."""
    left, right = (HALF_WIDTH * (2 * border / CELLS - 1) for border in (cell, cell + 1))
    for outline in SHAPES:
        piece = clipped(clipped(outline, left, 1), right, -1)
        if len(piece):
            yield piece


def sheared(alignment: atra.Alignment, cell: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) across and along the view -> the same, as `alignment` lays the cell onto the reference cell."""
    across, along = points.T
    return np.stack([across - alignment.shifts[0][cell] * along, along], axis=1)


def draw(alignment: atra.Alignment, depths: NDArray[np.float64]) -> Figure:
    """The four steps, one panel each: cells, one cell culled, its sheared copy, all copies with the reference rays."""
    figure = Figure(figsize=(13, 2.4))
    hit = np.isfinite(depths)
    slopes = HALF_WIDTH * (2 * (np.arange(PIXELS) + 0.5) / PIXELS - 1)
    points = np.stack([slopes, np.ones(PIXELS)], axis=1) * np.where(hit, depths, 0)[:, None]
    pixel, left = alignment.camera.pixel_pitch, alignment.corner_pixels[0]
    for number, title in enumerate(STEPS):
        axes = figure.add_axes((number / 4, 0, 1 / 4, 0.88))
        for cell, colour in enumerate(COLOURS):
            if number in (1, 2) and cell != EXAMPLE_CELL:
                continue
            own = slice(cell * PIXELS // CELLS, (cell + 1) * PIXELS // CELLS)
            if number < 3:
                draw_cell(axes, HALF_WIDTH * (2 * cell / CELLS - 1), colour)
            for piece in pieces(cell):
                if number < 3:
                    draw_piece(axes, piece, colour)
                if number > 1:
                    draw_piece(axes, sheared(alignment, cell, piece), colour)
            if number == 3:
                draw_hits(axes, sheared(alignment, cell, points[own][hit[own]]), colour)
        if number > 1:
            draw_cell(axes, left * pixel, "#444444")
        for ray in range(PIXELS // CELLS) if number == 3 else ():
            draw_ray(axes, (left + ray + 0.5) * pixel)
        axes.plot(0, 0, "o", color="black", markersize=7, zorder=4)
        axes.set(xlim=(-10.3, 10.3), ylim=(-0.7, 11.3), aspect="equal")
        axes.set_title(title, fontsize=14)
        axes.axis("off")
    return figure


def draw_cell(axes: Axes, left: float, colour: str) -> None:
    """A cell's wedge, `left` the slope of its left border, and its part of the image."""
    right = left + 2 * HALF_WIDTH / CELLS
    wedge = np.array([(0, 0), (left * FARTHEST, FARTHEST), (right * FARTHEST, FARTHEST)])
    axes.fill(*wedge.T, facecolor=colour, alpha=0.09, linewidth=0, zorder=0)
    image = np.array([left, right]) * IMAGE_AT
    axes.plot(image, [IMAGE_AT, IMAGE_AT], color=colour, linewidth=7, solid_capstyle="butt", zorder=3)


def draw_ray(axes: Axes, slope: float) -> None:
    axes.plot([0, slope * FARTHEST], [0, FARTHEST], color="#333333", linewidth=0.9, zorder=1)


def draw_piece(axes: Axes, piece: NDArray[np.float64], colour: str) -> None:
    axes.fill(*piece.T, facecolor=colour, alpha=0.4, linewidth=0, zorder=2)
    axes.fill(*piece.T, facecolor="none", edgecolor=colour, linewidth=1.5, zorder=2)


def draw_hits(axes: Axes, points: NDArray[np.float64], colour: str) -> None:
    axes.plot(*points.T, "o", color=colour, markeredgecolor="black", markersize=6.5, zorder=4)


def main(arguments: list[str] | None = None) -> tuple[atra.Alignment, NDArray[np.float64]]:
    made = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--out", type=Path, default=Path("results/examples"), help="folder for the picture")
    out = made.parse_args(arguments).out
    alignment, depths = trace(camera())
    out.mkdir(parents=True, exist_ok=True)
    draw(alignment, depths).savefig(out / "alignment.png", dpi=100, metadata={"Software": None})
    print(out / "alignment.png")
    return alignment, depths


if __name__ == "__main__":
    main()
