"""The paper's claims, in our own words. Numbers the paper does not give are our reading and say so in `how`."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from experiments.paper import resources, speed
from experiments.paper.judging import SceneJudge, on_every_scene, on_paper_scene, on_paper_scenes, on_some_scene
from experiments.results.claims import Claim, JudgedClaim, judge_claim
from experiments.results.estimates import NOTICEABLE

_SINGLE_RAYS = "Single rays, each point by its speed-up over rtcIntersect1 in the same rounds. "
_RATIO = "Intervals of ratios of two points reach from low / high to high / low. "
_MEAN = f"{_RATIO}In a mean their distances to its ends add in quadrature, in logarithms. "
_OUR_READING = "Our reading: "
_CLEARLY = f"Holds on a scene when the whole interval is above 1, fails when it ends below {NOTICEABLE:g}."
_NO_INTERVAL = "Bytes are counted once, so they carry no interval. "

_ORDERING = (
    Claim(
        "one-axis-beats-both",
        "§4, Fig. 4",
        "Cut into the same number of cells, the image renders faster when only one axis is split than when both are.",
        "one axis faster",
        f"{_SINGLE_RAYS}Culling on. At 4, 8 and 16 cells: fastest split of one axis over fastest split of both, above "
        f"1 = one axis faster; value: geometric mean (each count). {_MEAN}{_CLEARLY} Fails also when the whole "
        "interval at one count is below 1.",
        on_every_scene(speed.one_axis_beats_both),
    ),
    Claim(
        "axes-differ-little",
        "§4, Fig. 4",
        "It matters little whether the splits are horizontal or vertical.",
        "little difference",
        f"{_SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16, above 1 = horizontal faster; value: "
        f"geometric mean (each N). {_MEAN}{_OUR_READING}little = within a factor of {speed.LITTLE:g}. Holds "
        "on a scene when the mean's whole interval lies within it, fails when that of one N lies outside.",
        on_every_scene(speed.axes_differ_little),
    ),
    Claim(
        "horizontal-slightly-better",
        "§4, Fig. 4",
        "Of the two axes, horizontal splits come out slightly ahead.",
        "horizontal slightly faster",
        f"{_SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16; value: geometric mean (each N). {_MEAN}"
        f"Holds on a scene when the mean's whole interval is above 1, fails when it ends below {speed.SLIGHTLY:g}.",
        on_every_scene(speed.horizontal_slightly_better),
    ),
    Claim(
        "culling-off-slows-again",
        "§4, Fig. 5",
        "Without culling there is a best number of splits; more of them make rendering slower again.",
        "a minimum of time inside the range on every scene",
        f"{_SINGLE_RAYS}Culling off, 1 to 1,024 horizontal splits. Fastest split over none, and over the slowest "
        f"beyond it. {_RATIO}Holds on a scene when both whole intervals are above 1, fails when one ends below "
        f"{NOTICEABLE:g} or the fastest has the most splits, with all 11 measured. The interval is the second one's.",
        on_every_scene(speed.too_many_splits_slow_down),
    ),
    Claim(
        "culling-off-falls-below-start",
        "§4, Fig. 5",
        "Without culling, too many splits are on some scenes slower than no split at all.",
        "slower than at the start on some scenes",
        f"{_SINGLE_RAYS}Culling off. No split over the slowest split beyond the fastest. {_RATIO}{_CLEARLY} One scene "
        "is enough to hold; all four must fail for the claim to fail.",
        on_some_scene(speed.too_many_splits_fall_below_start),
    ),
    Claim(
        "culling-off-few-splits-gain",
        "§4, Fig. 5",
        "Without culling, a few splits render faster than none on every scene.",
        "faster everywhere at first",
        f"{_SINGLE_RAYS}Culling off. Fastest of 2, 4 and 8 horizontal splits (our reading of a few) over none. "
        f"{_RATIO}{_CLEARLY}",
        on_every_scene(speed.few_splits_gain),
    ),
    Claim(
        "culling-on-keeps-gaining",
        "§4, Fig. 5",
        "With culling, the more splits the faster, up to the 1,024 that were tried.",
        "time falls over the whole range",
        f"{_SINGLE_RAYS}Culling on, 1 to 1,024 horizontal splits. Fails on a scene when any split is slower than one "
        "with fewer cells and their intervals do not overlap (that is the tolerance); holds when none is and 1,024 "
        f"splits over none has its whole interval above 1. Value and interval: 1,024 splits over none. {_RATIO}",
        on_every_scene(speed.more_splits_faster),
    ),
)

_BEST_SPEEDUPS = {"cornell_box": 7.50, "mitsuba": 2.94, "fireplace_room": 1.85, "sponza": 1.71}
_BEST = (
    "Culling on, 1 to 1,024 horizontal splits, 1,024 x 1,024 pixels, the scene itself and no stand-in: the largest "
    "{column}, which is the median over rounds of {baseline} / ours. Holds when the upper end of its interval reaches "
    "the paper's value; fails when it does not and all 11 splits were measured."
)


def _best_speedup(scene: str, value: float) -> tuple[Claim, ...]:
    kinds = (
        ("", "single rays against single rays, as in the paper", "", "speedup", "rtcIntersect1 per pixel"),
        (
            "packets-", "packets against the fastest packets (the paper's value: single rays)", " (single rays)",
            "speedup_vs_packets", "the fastest packets per pixel",
        ),
    )  # fmt: skip
    return tuple(
        Claim(
            f"best-speedup-{kind}{scene}",
            "§4, Fig. 5",
            f"Best speed-up on {scene}, aligned {against}.",
            f"{value:.2f}{note}",
            _BEST.format(column=column, baseline=baseline),
            on_paper_scene(scene, speed.best_speedup_reaches(value, column, packets=bool(kind))),
        )
        for kind, against, note, column, baseline in kinds
    )


_BUILD = (
    "Culling on, copied geometry, horizontal splits: BVH build time over that at one split, at every N up to {most}; "
    f"value: the largest, and plan and build together at {{most}}. {_RATIO}{_OUR_READING}little = at most "
    f"{resources.LITTLE_EFFECT:g} times. Holds on a scene when every interval lies within, fails when one lies beyond. "
)
_MEMORY = (
    "Culling on, copied geometry, horizontal splits, a process of its own for each: embree_bytes over those at one "
    "split, at every N up to {most}; value: the largest. The growth of the process, rss_bytes - rss_mesh_bytes, at one "
    f"split and at {{most}} stands beside it and decides nothing. {_NO_INTERVAL}{_OUR_READING}little = at most "
    f"{resources.LITTLE_EFFECT:g} times. "
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
            on_scenes(judge(most)),
        )
        for most, where, on_scenes, why in ends
    )


_RESOURCES = (
    *_little_affected("build", "Fig. 6", "lengthen the BVH build", _BUILD, resources.build_little_affected),
    *_little_affected("memory", "Fig. 7", "need more memory", _MEMORY, resources.memory_little_affected),
    Claim(
        "image-without-error",
        "§4",
        "Aligned rays give the same image as one ray per pixel.",
        "no error",
        "Every aligned image that was compared with that of rtcIntersect1, each difference judged in float64: holds "
        "when pixels_wrong is 0 in all. Pixels that tie or lie at a triangle's edge are counted beside. A count has no "
        "interval.",
        on_every_scene(resources.image_without_error),
    ),
    Claim(
        "cost-model",
        "§3.2",
        "Render time grows like log(N_p) N_r: rays times the logarithm of the triangles.",
        "time proportional to log(N_p) N_r",
        f"{_SINGLE_RAYS}Culling off, horizontal splits, N_r = pixels / cells, N_p = triangles_traced. Least squares of "
        "log(1 / speedup) over log(log(N_p) N_r), at least 5 points; the model expects exponent 1. The interval is "
        f"Student's. {_OUR_READING}fails when the whole interval lies outside {speed.MODEL_EXPONENT[0]:g} to "
        f"{speed.MODEL_EXPONENT[1]:g}, holds when it does not and R2 is at least "
        f"{speed.MODEL_R_SQUARED:g}, is undecided otherwise.",
        on_every_scene(speed.time_follows_cost_model),
    ),
    Claim(
        "instancing-lowers-memory",
        "§4.4",
        "Instancing the geometry instead of copying it would lower the memory.",
        "suggested, not measured",
        "Culling off for both, horizontal splits: embree_bytes instanced over copied, at every split from 2 on "
        "that was measured of both. Holds on a scene when it is below 1 at all of them; value: at the most splits. "
        f"{_NO_INTERVAL}The cost: frame time instanced over copied, widest packets, geometric mean over such splits; "
        "the interval is the cost's and has no part in the verdict.",
        on_every_scene(resources.instancing_lowers_memory),
    ),
    Claim(
        "larger-scenes-gain-less",
        "§4, Fig. 5",
        "The more triangles a scene has, the smaller its best speed-up.",
        "7.50 > 2.94 > 1.85 > 1.71",
        f"{_SINGLE_RAYS}Best speed-up over horizontal splits, culling on, 1,024 x 1,024 pixels, all four scenes "
        "themselves. Holds when each interval lies above that of the next larger scene, fails when it lies below that "
        "of any larger one.",
        on_paper_scenes(speed.larger_scenes_gain_less),
    ),
)

CLAIMS: tuple[Claim, ...] = (
    *_ORDERING,
    *(claim for scene, value in _BEST_SPEEDUPS.items() for claim in _best_speedup(scene, value)),
    *_RESOURCES,
)
"""All claims: figures 4 and 5, the best speed-ups, then figures 6 and 7 and the rest."""


def judge_claims(table: pd.DataFrame | None) -> tuple[JudgedClaim, ...]:
    """A finding for every claim, in the order of CLAIMS.

    table: as `experiments.results.table.make_table` gives it; None or an empty one leaves every claim not measured.
    """
    return tuple(judge_claim(claim, table) for claim in CLAIMS)
