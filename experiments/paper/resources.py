"""Claims on build time, memory and the image (the paper's figures 6 and 7, section 4.4), judged scene by scene."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from experiments.drawing.values import say_things
from experiments.methods.aligned import ALIGNED
from experiments.paper.evidence import (
    SPLITS,
    NotMeasuredError,
    Row,
    SceneRows,
    estimate,
    measured_at,
    measured_at_some,
    read_number,
)
from experiments.paper.judging import SceneJudge
from experiments.results.statistics import Estimate, geometric_mean
from experiments.results.verdicts import Bounds, Outcome, decide_greater
from experiments.workloads.build import BUILD
from experiments.workloads.frame import FRAME
from experiments.workloads.memory import MEMORY

_PLAN_AND_BUILD = "plan_and_build_over_plain"

LITTLE_EFFECT = 2.0
"""Largest multiple of build time or memory at one split that counts as a little effect. Our reading: the paper gives
no number; without culling, 16 splits would cost 16 times as much."""


def build_little_affected(most_splits: int) -> SceneJudge:
    """Whether the BVH build takes at most LITTLE_EFFECT times as long as at one split, for every split up to most."""

    def judge(scene: SceneRows) -> Outcome:
        ratios = {splits: _build(scene, splits).over(_build(scene, 1)) for splits in _up_to(most_splits)}
        with_plan = _build(scene, most_splits, _PLAN_AND_BUILD).over(_build(scene, 1, _PLAN_AND_BUILD)).value
        worst = max(ratios, key=lambda splits: ratios[splits].value)
        value = f"{ratios[worst].value:.2f} at {worst} splits; plan and build {with_plan:.2f} at {most_splits}"
        found = {splits: Bounds(high=LITTLE_EFFECT).decide(ratio) for splits, ratio in ratios.items()}
        if False in found.values():
            splits = next(splits for splits, state in found.items() if state is False)
            return Outcome(False, value, ratios[worst], f"{ratios[splits]} times as long at {splits} splits")
        if None in found.values():
            return Outcome(None, value, ratios[worst], f"the interval reaches beyond {LITTLE_EFFECT:g} times")
        return Outcome(True, value, ratios[worst])

    return judge


def build_grows(scene: SceneRows) -> Outcome:
    """Whether the BVH build takes longer at the most splits measured than at one."""
    most = next((splits for splits in reversed(SPLITS) if _is_measured(scene, splits)), 1)
    if most == 1:
        raise NotMeasuredError("build at no more than one split")
    ratio = _build(scene, most).over(_build(scene, 1))
    whole = _build(scene, most, _PLAN_AND_BUILD).over(_build(scene, 1, _PLAN_AND_BUILD)).value
    value = f"{ratio.value:.2f} at {most:,} splits; plan and build {whole:.2f}"
    holds = decide_greater(ratio)
    reasons = {True: None, False: f"{ratio} times as long", None: "the interval is wider than the difference"}
    return Outcome(holds, value, ratio, reasons[holds])


def overlap_lowers_quality(scene: SceneRows) -> Outcome:
    """Whether a pixel costs more boxes at the most splits than at one, culling off; a ray serves one of each cell."""
    found = {splits: boxes / splits for splits in SPLITS if (boxes := _boxes(scene, splits)) is not None}
    most = max(found, default=1)
    if most == 1 or 1 not in found:
        raise NotMeasuredError("boxes_entered without culling at no more than one split")
    ratio = found[most] / found[1]
    return Outcome(ratio > 1, f"{ratio:.2f} at {most:,} splits", None, None if ratio > 1 else f"{ratio:.2f} times")


def _boxes(scene: SceneRows, splits: int) -> float | None:
    with suppress(NotMeasuredError):
        for row in scene.processes(BUILD.name, (splits, 1), culling=False):
            if row["boxes_entered"]:
                return float(row["boxes_entered"])
    return None


def memory_grows(scene: SceneRows) -> Outcome:
    """Whether Embree holds more bytes at the most splits than at one, culling on."""
    ratio = _embree(_memory(scene, SPLITS[-1])) / _embree(_memory(scene, 1))
    value = f"{ratio:.2f} at {SPLITS[-1]:,} splits"
    return Outcome(ratio > 1, value, None, None if ratio > 1 else f"{ratio:.2f} times the bytes")


def memory_little_affected(most_splits: int) -> SceneJudge:
    """Whether Embree holds at most LITTLE_EFFECT times its bytes at one split, for every split up to most.

    The growth of the process is told beside it and decides nothing: on a small scene it is a few pages, and the pages
    a process happens to reuse decide it.
    """

    def judge(scene: SceneRows) -> Outcome:
        start = _memory(scene, 1)
        embree = {splits: _embree(_memory(scene, splits)) / _embree(start) for splits in _up_to(most_splits)}
        worst = max(embree, key=lambda splits: embree[splits])
        process = f"process {_growth(start)} to {_growth(_memory(scene, most_splits))} at {most_splits}"
        value = f"{embree[worst]:.2f} at {worst} splits; {process}"
        return _counted(
            value,
            [f"{ratio:.2f} times at {splits} splits" for splits, ratio in embree.items() if ratio > LITTLE_EFFECT],
        )

    return judge


def culling_saves_memory(scene: SceneRows) -> Outcome:
    """Embree's bytes of frames with culling over those without, at every split from 2 on measured of both."""

    def on_over_off(splits: int) -> float:
        on, off = (_embree(scene.row(FRAME.name, (splits, 1), culling=c, packet_width=1)) for c in (True, False))
        return on / off

    ratios = measured_at_some(SPLITS[1:], on_over_off)
    most = max(ratios)
    more = [f"{ratio:.2f} times the bytes at {splits} splits" for splits, ratio in ratios.items() if ratio >= 1]
    return _counted(f"{ratios[most]:.2g} at {most:,} splits", more)


def any_divisor_works(scene: SceneRows) -> Outcome:
    """Wrong pixels at every number of horizontal splits that divides an image of 1,024 pixels, culling on."""
    worst = {
        splits: max(scene.processes(FRAME.name, (splits, 1), culling=True, packet_width=1), key=_wrong)
        for splits in SPLITS
    }
    bad = [
        f"{say_things(_wrong(row), 'pixel')} wrong at {say_things(splits, 'split')}{_of_them_holes([row])}"
        for splits, row in worst.items()
        if _wrong(row)
    ]
    return _counted(f"{sum(map(_wrong, worst.values()))} wrong at 1 to {SPLITS[-1]:,} splits", bad)


def _wrong(row: Row) -> int:
    return int(read_number(row, "pixels_wrong"))


def instancing_lowers_memory(culling: bool) -> SceneJudge:
    """Embree's bytes with instances, which cannot cull, over those with copies, at every split measured of both.

    culling: of the copies.
    """

    def judge(scene: SceneRows) -> Outcome:
        def of_bytes(splits: int) -> float:
            instanced = _embree(_memory(scene, splits, culling=False, geometry="instanced"))
            return instanced / _embree(_memory(scene, splits, culling=culling))

        def of_speed(splits: int) -> Estimate:
            instanced = _speed(scene, splits, culling=False, geometry="instanced")
            return _speed(scene, splits, culling=culling).over(instanced)

        bytes_ratios, (speed_ratios, _) = measured_at_some(SPLITS[1:], of_bytes), measured_at(SPLITS[1:], of_speed)
        most = max(bytes_ratios)
        cost = geometric_mean(list(speed_ratios.values())) if speed_ratios else None
        price = "frame time not measured" if cost is None else f"frame time x {cost.value:.2f}, mean over splits"
        value = f"bytes x {bytes_ratios[most]:.3g} at {most:,} splits, {price}"
        more = [f"bytes x {ratio:.3g} at {splits:,} splits" for splits, ratio in bytes_ratios.items() if ratio >= 1]
        return Outcome(not more, value, cost, more[0] if more else None)

    return judge


def image_without_error(scene: SceneRows) -> Outcome:
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


def _counted(value: str, against: list[str]) -> Outcome:
    """What is counted holds where nothing speaks against it; the first that does is told."""
    return Outcome(not against, value, None, against[0] if against else None)


def _is_measured(scene: SceneRows, splits: int) -> bool:
    return bool(measured_at([splits], lambda one: _build(scene, one))[0])


def _up_to(most_splits: int) -> list[int]:
    return [splits for splits in SPLITS if 1 < splits <= most_splits]


def _build(scene: SceneRows, splits: int, column: str = "build_over_plain") -> Estimate:
    """Over the build of the plain mesh in the same rounds."""
    return estimate(scene.sample(scene.processes(BUILD.name, (splits, 1), culling=True), column))


def _speed(scene: SceneRows, splits: int, **options: Any) -> Estimate:
    return estimate(scene.speedups((splits, 1), packet_width=scene.widest_packets(FRAME.name), **options))


def _memory(scene: SceneRows, splits: int, *, culling: bool = True, geometry: str = "copied") -> Row:
    return scene.row(MEMORY.name, (splits, 1), culling=culling, geometry=geometry)


def _embree(row: Row) -> float:
    count = read_number(row, "embree_bytes")
    if count <= 0:
        raise NotMeasuredError(f"embree_bytes is {count:,.0f} at {row['split_x']:,} x {row['split_y']:,}")
    return count


def _growth(row: Row) -> str:
    """What the process grew by from the loaded mesh to the built BVH, or that it was not measured."""
    try:
        growth = read_number(row, "rss_bytes") - read_number(row, "rss_mesh_bytes")
    except NotMeasuredError:
        return "not measured"
    return f"{growth / 2**20:+,.1f} MiB"
