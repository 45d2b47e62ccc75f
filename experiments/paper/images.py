"""Claims on the image, judged scene by scene."""

from __future__ import annotations

from collections.abc import Sequence

from experiments.drawing.values import say_things
from experiments.methods.aligned import ALIGNED
from experiments.paper.evidence import SPLITS, NotMeasuredError, Row, SceneRows, read_number
from experiments.paper.readings import Reading
from experiments.results.verdicts import Outcome


def any_divisor_works(scene: SceneRows, reading: Reading) -> Outcome:
    """Wrong pixels at every number of horizontal splits that divides an image of 1,024 pixels, culling on."""
    worst = {
        splits: max(scene.processes(reading.workload, (splits, 1), culling=True, packet_width=1), key=_wrong)
        for splits in SPLITS
    }
    bad = [
        f"{say_things(_wrong(row), 'pixel')} wrong at {say_things(splits, 'split')}{_of_them_holes([row])}"
        for splits, row in worst.items()
        if _wrong(row)
    ]
    value = f"{sum(map(_wrong, worst.values()))} wrong at 1 to {SPLITS[-1]:,} splits"
    return Outcome(not bad, value, None, bad[0] if bad else None)


def _wrong(row: Row) -> int:
    return int(read_number(row, "pixels_wrong"))


def image_without_error(scene: SceneRows, reading: Reading) -> Outcome:
    """Wrong pixels over all aligned images of the scene that were compared with the per-pixel image."""
    images = [row for row in scene.rows if row["method"] == ALIGNED.name and row["pixels_wrong"] is not None]
    if not images:
        raise NotMeasuredError("no image was compared")
    wrong, edge, tied = (sum(int(row[f"pixels_{kind}"] or 0) for row in images) for kind in ("wrong", "edge", "tied"))
    value = f"{wrong:,} wrong, {edge:,} at an edge, {tied:,} tied in {len(images):,} images"
    depths = [(row["depth_error_max"], row["baseline_depth_error_max"]) for row in images if row["depth_error_max"]]
    if depths:
        own, single = (max(errors) for errors in zip(*depths, strict=True))
        value += f"; depths off by up to {own:.1e}, of single rays {single:.1e}"
    if wrong == 0:
        return Outcome(True, value)
    wrong_in = sum(row["pixels_wrong"] > 0 for row in images)
    told = f"{wrong:,} wrong pixels in {wrong_in:,} of {len(images):,} images"
    return Outcome(False, value, None, told + _of_them_holes(images))


def _of_them_holes(images: Sequence[Row]) -> str:
    """How many wrong pixels are rays that slip through between two triangles; "" where none is."""
    own, single = (sum(int(row[name] or 0) for row in images) for name in ("pixels_hole", "baseline_pixels_hole"))
    said = [f"{count:,} of {rays}" for count, rays in ((own, "aligned rays"), (single, "rtcIntersect1")) if count]
    return f" (holes between triangles: {', '.join(said)})" if said else ""
