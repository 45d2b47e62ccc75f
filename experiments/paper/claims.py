"""The paper's claims, in our own words. Numbers the paper does not give are our reading and say so in `how`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd

from experiments.paper import resources, speed
from experiments.paper.evidence import Evidence
from experiments.paper.judging import SceneJudge, on_every_scene, on_paper_scene, on_paper_scenes, on_some_scene
from experiments.paper.readings import EVERY_HIT, NEAREST, READINGS, readings_of
from experiments.results.claims import Claim, Judge, JudgedClaim, judge_all

_SINGLE_RAYS = "Single rays, each process by its speed-up over rtcIntersect1 in the same rounds. "
_RULE = (
    "Holds on a scene when the whole 95 % interval lies above {limit}, fails when it lies below, and is undecided "
    "otherwise. Intervals are Student's, over processes, in logarithms. "
)
_DECIDED = _RULE.format(limit=1)
_REACHES = _RULE.format(limit="the paper's value")
_CHOSEN = "What is chosen as best is chosen on half of the processes and reported on the others. "
_OUR_READING = "Our reading: "
_NO_INTERVAL = "Bytes are counted once, so they carry no interval. "


def _alone(judge: Judge) -> dict[str, Judge]:
    """Nothing that the paper leaves open matters."""
    return {"": judge}


def _alike(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """The baseline does not matter, but whether the nearest hit is wanted or every one."""
    return {"": on_scenes(judge), EVERY_HIT.name: on_scenes(partial(judge, workload=EVERY_HIT.workload))}


def _each(on_scenes: Callable[[Any], Judge], judge: Callable[..., Any]) -> dict[str, Judge]:
    """Under each reading of the paper's baseline."""
    return {reading.name: on_scenes(partial(judge, reading=reading)) for reading in READINGS}


_ORDERING = (
    Claim(
        "one-axis-beats-both",
        "§4, Fig. 4",
        "Cut into the same number of cells, the image renders faster when only one axis is split than when both are.",
        "one axis faster",
        f"{_SINGLE_RAYS}Culling on. At 4, 8 and 16 cells: fastest split of one axis over fastest split of both, above "
        f"1 = one axis faster; value: geometric mean (each count). {_CHOSEN}{_DECIDED}Fails also when the whole "
        "interval at one count is below 1.",
        _alone(on_every_scene(speed.one_axis_beats_both)),
    ),
    Claim(
        "axes-differ-little",
        "§4, Fig. 4",
        "It matters little whether the splits are horizontal or vertical.",
        "little difference",
        f"{_SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16, above 1 = horizontal faster; value: "
        f"geometric mean (each N). {_OUR_READING}little = within a factor of {speed.LITTLE:g}. Holds "
        "on a scene when the mean's whole interval lies within it, fails when that of one N lies outside.",
        _alone(on_every_scene(speed.axes_differ_little)),
    ),
    Claim(
        "horizontal-slightly-better",
        "§4, Fig. 4",
        "Of the two axes, horizontal splits come out slightly ahead.",
        "horizontal slightly faster",
        f"{_SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16; value: geometric mean (each N). {_DECIDED}",
        _alone(on_every_scene(speed.horizontal_slightly_better)),
    ),
    Claim(
        "culling-accelerates",
        "§3.4",
        "Culling what a cell cannot see accelerates rendering further.",
        "faster with culling",
        f"{_SINGLE_RAYS}Culling on over off at every number of horizontal splits from 2 on that was measured of both; "
        f"value: geometric mean (each N). {_DECIDED}",
        _alike(on_every_scene, speed.culling_accelerates),
    ),
    Claim(
        "culling-off-slows-again",
        "§4, Fig. 5",
        "Without culling there is a best number of splits; more of them make rendering slower again.",
        "a minimum of time inside the range on every scene",
        f"{_SINGLE_RAYS}Culling off, 1 to 1,024 horizontal splits. Fastest split over the baseline, and over the "
        f"largest split. {_CHOSEN}{_DECIDED}Both must hold. The interval is the second one's.",
        _each(on_every_scene, speed.too_many_splits_slow_down),
    ),
    Claim(
        "culling-off-falls-below-start",
        "§4, Fig. 5",
        "Without culling, too many splits are on some scenes slower than no split at all.",
        "slower than at the start on some scenes",
        f"{_SINGLE_RAYS}Culling off. The baseline over the largest split. {_DECIDED}One scene is enough to hold; all "
        "four must fail for the claim to fail.",
        _each(on_some_scene, speed.too_many_splits_fall_below_start),
    ),
    Claim(
        "culling-off-few-splits-gain",
        "§4, Fig. 5",
        "Without culling, a few splits render faster than none on every scene.",
        "faster everywhere at first",
        f"{_SINGLE_RAYS}Culling off. Fastest of 2, 4 and 8 horizontal splits (our reading of a few) over the baseline. "
        f"{_CHOSEN}{_DECIDED}",
        _each(on_every_scene, speed.few_splits_gain),
    ),
    Claim(
        "culling-on-keeps-gaining",
        "§4, Fig. 5",
        "With culling, the more splits the faster, up to the 1,024 that were tried.",
        "time falls over the whole range",
        f"{_SINGLE_RAYS}Culling on, 1 to 1,024 horizontal splits. {_CHOSEN}Holds on a scene when 1,024 splits are "
        "faster than the baseline and no split is slower than one with fewer cells by more than a factor of "
        f"{speed.LARGEST_LOSS:g} (our reading), each by its whole interval; fails when either is wrong by its whole "
        "interval. Value and interval: 1,024 splits over the baseline.",
        _each(on_every_scene, speed.more_splits_faster),
    ),
    Claim(
        "nearest-alone-may-lose",
        "§5",
        "Where only the nearest hit is wanted, the method can be slower than tracing each ray by itself, which stops "
        "early.",
        "can be slower",
        "Single rays, culling on: rtcIntersect1 over the best of 1 to 1,024 horizontal splits; value: the reverse. "
        f"{_CHOSEN}{_DECIDED}One scene is enough to hold.",
        {NEAREST.name: on_some_scene(speed.nearest_alone_may_lose)},
    ),
)

BEST_SPEEDUPS = {"cornell_box": 7.50, "mitsuba": 2.94, "fireplace_room": 1.85, "sponza": 1.71}
"""What the paper reports of aligned single rays at the best split."""


def best_speedup_id(scene: str) -> str:
    """The id of the claim on the best speed-up of a scene."""
    return f"best-speedup-{scene}"


_SPEEDUPS = tuple(
    Claim(
        best_speedup_id(scene),
        "§4, Fig. 5",
        f"Best speed-up on {scene}, aligned single rays against single rays.",
        f"{value:.2f}",
        "Culling on, 1 to 1,024 horizontal splits, 1,024 x 1,024 pixels, the scene itself and no stand-in: the largest "
        f"ratio of the baseline to ours. {_CHOSEN}{_REACHES}",
        _each(partial(on_paper_scene, scene), speed.best_speedup_reaches(value)),
    )
    for scene, value in BEST_SPEEDUPS.items()
)

_BUILD = (
    "Culling on, copied geometry, horizontal splits: time of the BVH build, over that of the plain mesh in the same "
    "rounds. "
)
_LITTLE_BUILD = (
    f"{_BUILD}At every N up to {{most}} over that at one split; value: the largest, and plan and build together at "
    f"{{most}}. {_OUR_READING}little = at most {resources.LITTLE_EFFECT:g} times. Holds on a scene when every interval "
    "lies within, fails when one lies beyond. "
)
_MEMORY = "Culling on, copied geometry, horizontal splits, a process of its own each: embree_bytes over those at one "
_LITTLE_MEMORY = (
    f"{_MEMORY}split, at every N up to {{most}}; value: the largest. The growth of the process, rss_bytes - "
    f"rss_mesh_bytes, at one split and at {{most}} stands beside it and decides nothing. {_NO_INTERVAL}{_OUR_READING}"
    f"little = at most {resources.LITTLE_EFFECT:g} times. "
)


def _little_affected(
    what: str, figure: str, effect: str, how: str, judge: Callable[[int], SceneJudge]
) -> tuple[Claim, ...]:
    """A claim for each end of the paper's range."""
    ends = (
        (16, "any scene", on_every_scene, "16 is the lower end of the paper's range: every scene must hold."),
        (64, "some scenes", on_some_scene, "64 is the upper end of the paper's range: one scene is enough."),
    )
    return tuple(
        Claim(
            f"{what}-little-affected-to-{most}",
            f"§4, {figure}",
            f"With culling, up to {most} splits hardly {effect}, on {where}.",
            "little effect up to 16 to 64 splits",
            how.format(most=most) + why,
            _alone(on_scenes(judge(most))),
        )
        for most, where, on_scenes, why in ends
    )


def _instancing(culling: bool) -> Claim:
    setting = "with culling, the paper's own setting" if culling else "without culling, as instances must do"
    return Claim(
        f"instancing-lowers-memory{'' if culling else '-culling-off'}",
        "§4.4",
        f"Instancing the geometry instead of copying it ({setting}) would lower the memory.",
        "suggested, not measured",
        f"Instances, which cannot be culled, over copies with culling {'on' if culling else 'off'}, horizontal splits: "
        "embree_bytes, at every split from 2 on that was measured of both. Holds on a scene when below 1 at all of "
        f"them; value: at the most splits. {_NO_INTERVAL}The cost: frame time instanced over copied, widest packets, "
        "geometric mean over such splits; the interval is the cost's and has no part in the verdict.",
        _alone(on_every_scene(resources.instancing_lowers_memory(culling))),
    )


_RESOURCES = (
    *_little_affected("build", "Fig. 6", "lengthen the BVH build", _LITTLE_BUILD, resources.build_little_affected),
    *_little_affected("memory", "Fig. 7", "need more memory", _LITTLE_MEMORY, resources.memory_little_affected),
    Claim(
        "build-grows",
        "§4.3",
        "The BVH build takes longer the more splits there are.",
        "grows with the splits",
        f"{_BUILD}At the most splits over one; value: that, and plan and build together. {_DECIDED}",
        _alone(on_every_scene(resources.build_grows)),
    ),
    Claim(
        "overlap-lowers-quality",
        "§4.2",
        "The cells' copies overlap, which lowers the quality of the BVH.",
        "lower quality",
        "Culling on, copied geometry, horizontal splits: boxes that a random ray enters in the BVH that Embree's own "
        "builder makes of the same triangles (rtcBuildBVH, eight children a node), over the logarithm of the "
        "triangles, which is all that they would grow by if the copies lay apart. Value: at the most splits over one; "
        "holds on a scene when above 1. It is counted, so it carries no interval.",
        _alone(on_every_scene(resources.overlap_lowers_quality)),
    ),
    Claim(
        "memory-grows",
        "§4.4",
        "Memory grows with the number of splits.",
        "grows with the splits",
        f"{_MEMORY}split, at 1,024 splits. {_NO_INTERVAL}Holds on a scene when above 1.",
        _alone(on_every_scene(resources.memory_grows)),
    ),
    Claim(
        "image-without-error",
        "§4",
        "Aligned rays give the same image as one ray per pixel.",
        "no error",
        "Every aligned image that was compared with that of rtcIntersect1, each difference judged in float64: holds "
        "when pixels_wrong is 0 in all. Pixels that tie or lie at a triangle's edge are counted beside. A count has no "
        "interval.",
        _alone(on_every_scene(resources.image_without_error)),
    ),
    Claim(
        "cost-model",
        "§3.2",
        "Render time grows like log(N_p) N_r: rays times the logarithm of the triangles.",
        "time proportional to log(N_p) N_r",
        f"{_SINGLE_RAYS}Culling off, horizontal splits, N_r = pixels / cells, N_p = triangles_traced. Least squares of "
        "log(1 / speedup) over log(log(N_p) N_r), at least 5 points; the model expects exponent 1. The interval is "
        f"Student's. {_OUR_READING}holds when the whole interval lies within {speed.MODEL_EXPONENT[0]:g} to "
        f"{speed.MODEL_EXPONENT[1]:g} and R2 is at least {speed.MODEL_R_SQUARED:g}, fails when the whole interval lies "
        "outside, is undecided otherwise.",
        _alike(on_every_scene, speed.time_follows_cost_model),
    ),
    _instancing(culling=True),
    _instancing(culling=False),
    Claim(
        "larger-scenes-gain-less",
        "§4, Fig. 5",
        "The more triangles a scene has, the smaller its best speed-up.",
        "7.50 > 2.94 > 1.85 > 1.71",
        "Best speed-up of single rays over horizontal splits, culling on, 1,024 x 1,024 pixels, all four scenes "
        f"themselves. {_CHOSEN}Holds when each is above that of the next larger scene by the whole interval of their "
        "ratio, fails when it is below that of any larger one. The paper does not say so; its values do.",
        _each(on_paper_scenes, speed.larger_scenes_gain_less),
        inferred=True,
    ),
)

CLAIMS: tuple[Claim, ...] = (*_SPEEDUPS, *_ORDERING, *_RESOURCES)
"""All claims: the best speed-ups, figures 4 and 5, then figures 6 and 7 and the rest."""


def judge_claims(processes: pd.DataFrame | None) -> tuple[JudgedClaim, ...]:
    """What became of every claim, in the order of CLAIMS, under each of its readings of which the table has rows.

    processes: as `experiments.results.table.make_tables` gives them; None or an empty table leaves every claim not
    measured. A table of nothing but gathered hits is asked for no other claim.
    """
    under = {reading.name for reading in readings_of(processes)}
    if under != {EVERY_HIT.name}:
        under.add("")
    evidence = Evidence(processes)
    return tuple(one for one in judge_all(CLAIMS, evidence) if one.reading in under)
