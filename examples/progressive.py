"""Progressive anti-aliasing
=========================

Progressive anti-aliasing: 1, 4, 16, 64 samples a pixel of a still view, and what each method takes for them.

::

    python -m examples.progressive --scene atrium

Every frame's rays go through another point of their pixels; plan and BVH stay. Writes `progressive.png`, the picture
after 64 samples and an enlarged detail after 1, 4, 16 and 64, and prints each method's time including plan and build.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import atra
from examples import parts
from experiments.drawing.shading import shade

COUNTS = (1, 4, 16, 64)
"""Samples a pixel at which the picture is shown and the time told."""

_DETAIL = 6  # the detail is a sixth of the picture, enlarged as much


def methods(mesh: atra.Mesh, camera: atra.Camera, threads: int) -> dict[str, Callable[[], atra.Tracer]]:
    """How each method's tracer is made, by the name printed."""
    narrow, wide = parts.largest_split(camera.width, 256), parts.largest_split(camera.width, 128)
    return {
        "packets": lambda: atra.PixelTracer(mesh, camera, threads=threads),
        f"aligned {wide[0]} x 1": lambda: atra.AlignedTracer(mesh, camera, wide, threads=threads),
        f"visible-first {narrow[0]} x 1": lambda: atra.VisibleFirstTracer(mesh, camera, narrow, threads=threads),
    }


def accumulate(
    tracers: dict[str, atra.Tracer], seconds: dict[str, float]
) -> tuple[dict[int, NDArray[np.uint8]], dict[int, dict[str, float]]]:
    """Trace the samples with every tracer in turn and average the last one's pictures.

    seconds: what each method has taken so far; grows. Returns picture and seconds by method, by number of samples.
    """
    pictures, told, total = {}, {}, None
    latest: dict[str, atra.Hits] = {}
    for number, offset in enumerate(atra.sub_pixel_offsets(COUNTS[-1]), 1):
        for name, tracer in tracers.items():
            start = perf_counter()
            latest[name] = tracer.trace(tuple(offset), out=latest.get(name))
            seconds[name] += perf_counter() - start
        shaded = shade(latest[name]).astype(np.float64)
        total = shaded if total is None else total + shaded
        if number in COUNTS:
            pictures[number] = np.rint(total / number).astype(np.uint8)
            told[number] = dict(seconds)
            _check(latest)
    return pictures, told


def _check(latest: dict[str, atra.Hits]) -> None:
    """Every method must have traced the same frame."""
    reference, *others = latest.values()
    for hits in others:
        agreement = atra.compare(hits, reference)
        if agreement.pixels_wrong:
            raise atra.AtraError(f"the methods do not agree: {agreement}")


def picture_of(pictures: dict[int, NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """The last picture, and beside it a detail of its middle after each number of samples, two by two."""
    whole = pictures[COUNTS[-1]]
    height, width = (length // _DETAIL for length in whole.shape[:2])
    top, left = (whole.shape[0] - height) // 2, (whole.shape[1] - width) // 3
    factor = max(1, (whole.shape[0] - 4) // (2 * height))
    details = [
        pictures[count][top : top + height, left : left + width].repeat(factor, axis=0).repeat(factor, axis=1)
        for count in COUNTS
    ]
    rows = [parts.beside(details[:2]), parts.beside(details[2:])]
    gap = np.full((4, rows[0].shape[1], 3), 255, np.uint8)
    block = np.concatenate([rows[0], gap, rows[1]])
    height = min(len(block), len(whole))
    return parts.beside([whole[:height], block[:height]])


def main(arguments: list[str] | None = None) -> dict[int, dict[str, float]]:
    options: argparse.Namespace = parts.parser(__doc__, scene="atrium").parse_args(arguments)
    mesh, pose = parts.load(options.scene)
    camera = atra.Camera(**pose, width=options.width, height=options.height)
    makers = methods(mesh, camera, options.threads)
    with ExitStack() as stack:
        tracers = {name: stack.enter_context(make()) for name, make in makers.items()}
        for tracer in tracers.values():  # compile, and let the first build start the threads
            tracer.trace()
            tracer.build()
        seconds = {name: tracer.plan_time_s + tracer.build_time_s for name, tracer in tracers.items()}
        pictures, told = accumulate(tracers, dict(seconds))
    parts.save(options.out / "progressive.png", picture_of(pictures))
    print(
        f"{options.scene}, {mesh.triangle_count:,} triangles, {camera.width} x {camera.height}; "
        "ms, plan and build included"
    )
    print(f"{'samples a pixel':24}" + "".join(f"{count:>10}" for count in COUNTS))
    for name in tracers:
        print(f"{name:24}" + "".join(f"{told[count][name] * 1e3:10.0f}" for count in COUNTS))
    return told


if __name__ == "__main__":
    main()
