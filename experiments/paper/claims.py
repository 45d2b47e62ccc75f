"""The paper's claims, in our own words. Numbers the paper does not give are our reading and say so in `how`."""

from __future__ import annotations

from functools import partial

import pandas as pd

from experiments.paper import speed
from experiments.paper.evidence import Evidence
from experiments.paper.further_claims import OTHERS, RESOURCES
from experiments.paper.judging import on_every_scene, on_paper_scene, on_some_scene
from experiments.paper.readings import EVERY_HIT, NEAREST, readings_of
from experiments.paper.wording import (
    CHOSEN,
    DECIDED,
    OUR_READING,
    REACHES,
    SINGLE_RAYS,
    alike,
    alone,
    each,
)
from experiments.results.claims import Claim, JudgedClaim, judge_all

_ORDERING = (
    Claim(
        "one-axis-beats-both",
        "§4, Fig. 4",
        "The image renders faster when only one axis is split than when both are.",
        "one axis faster",
        f"{SINGLE_RAYS}Culling on. The fastest of N x 1 and 1 x N over the fastest of N x M, N and M from 2 to 16. "
        f"{CHOSEN}{DECIDED}",
        alone(on_every_scene(speed.one_axis_beats_both)),
    ),
    Claim(
        "one-axis-beats-both-of-as-many-cells",
        "§4, Fig. 4",
        "Cut into the same number of cells, the image renders faster when only one axis is split than when both are.",
        "one axis faster",
        f"{SINGLE_RAYS}Culling on. At 4, 8 and 16 cells: fastest split of one axis over fastest split of both, above "
        f"1 = one axis faster; value: geometric mean (each count). {CHOSEN}{DECIDED}Fails also when the whole "
        "interval at one count is below 1. The paper does not compare as many cells.",
        alone(on_every_scene(speed.one_axis_beats_both_of_as_many_cells)),
        inferred=True,
    ),
    Claim(
        "axes-differ-little",
        "§4, Fig. 4",
        "It matters little whether the splits are horizontal or vertical.",
        "little difference",
        f"{SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16, above 1 = horizontal faster; value: "
        f"geometric mean (each N). {OUR_READING}little = within a factor of {speed.LITTLE:g}. Holds "
        "on a scene when the mean's whole interval lies within it, fails when that of one N lies outside.",
        alone(on_every_scene(speed.axes_differ_little)),
    ),
    Claim(
        "horizontal-slightly-better",
        "§4, Fig. 4",
        "Of the two axes, horizontal splits come out slightly ahead.",
        "horizontal slightly faster",
        f"{SINGLE_RAYS}Culling on. N x 1 over 1 x N for N = 2, 4, 8, 16; value: geometric mean (each N). {DECIDED}",
        alone(on_every_scene(speed.horizontal_slightly_better)),
    ),
    Claim(
        "culling-accelerates",
        "§3.4",
        "Culling what a cell cannot see accelerates rendering further.",
        "faster with culling",
        f"{SINGLE_RAYS}Culling on over off at every number of horizontal splits from 2 on that was measured of both; "
        f"value: geometric mean (each N). {DECIDED}",
        alike(on_every_scene, speed.culling_accelerates),
    ),
    Claim(
        "culling-off-slows-again",
        "§4, Fig. 5",
        "Without culling there is a best number of splits; more of them make rendering slower again.",
        "a minimum of time inside the range on every scene",
        f"{SINGLE_RAYS}Culling off, 1 to 1,024 horizontal splits. Fastest split over the baseline, and over the "
        f"largest split. {CHOSEN}{DECIDED}Both must hold. The interval is the second one's.",
        each(on_every_scene, speed.too_many_splits_slow_down),
    ),
    Claim(
        "culling-off-falls-below-start",
        "§4, Fig. 5",
        "Without culling, too many splits are on some scenes slower than no split at all.",
        "slower than at the start on some scenes",
        f"{SINGLE_RAYS}Culling off. The baseline over the largest split. {DECIDED}One scene is enough to hold; all "
        "four must fail for the claim to fail.",
        each(on_some_scene, speed.too_many_splits_fall_below_start),
    ),
    Claim(
        "culling-off-few-splits-gain",
        "§4, Fig. 5",
        "Without culling, a few splits render faster than none on every scene.",
        "faster everywhere at first",
        f"{SINGLE_RAYS}Culling off. Fastest of 2, 4 and 8 horizontal splits (our reading of a few) over the baseline. "
        f"{CHOSEN}{DECIDED}",
        each(on_every_scene, speed.few_splits_gain),
    ),
    Claim(
        "culling-on-keeps-gaining",
        "§4, Fig. 5",
        "With culling, the more splits the faster, up to the 1,024 that were tried.",
        "time falls over the whole range",
        f"{SINGLE_RAYS}Culling on, 1 to 1,024 horizontal splits. {CHOSEN}Holds on a scene when 1,024 splits are "
        "faster than the baseline and no split is slower than one with fewer cells by more than a factor of "
        f"{speed.LARGEST_LOSS:g} (our reading), each by its whole interval; fails when either is wrong by its whole "
        "interval. Value and interval: 1,024 splits over the baseline.",
        each(on_every_scene, speed.more_splits_faster),
    ),
    Claim(
        "nearest-alone-may-lose",
        "§5",
        "Where only the nearest hit is wanted, the method can be slower than tracing each ray by itself, which stops "
        "early.",
        "can be slower",
        "Single rays, culling on: rtcIntersect1 over the best of 1 to 1,024 horizontal splits; value: the reverse. "
        f"{CHOSEN}{DECIDED}One scene is enough to hold.",
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
        f"ratio of the baseline to ours. {CHOSEN}{REACHES}",
        each(partial(on_paper_scene, scene), speed.best_speedup_reaches(value)),
    )
    for scene, value in BEST_SPEEDUPS.items()
)

CLAIMS: tuple[Claim, ...] = (*_SPEEDUPS, *_ORDERING, *RESOURCES, *OTHERS)
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
