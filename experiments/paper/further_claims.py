"""The paper's claims on build time, memory and the image, and its other sentences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from experiments.paper import resources, speed
from experiments.paper.judging import SceneJudge, on_every_scene, on_paper_scenes, on_some_scene
from experiments.paper.wording import (
    CHOSEN,
    DECIDED,
    NO_INTERVAL,
    OUR_READING,
    SINGLE_RAYS,
    alike,
    alone,
    each,
)
from experiments.results.claims import Claim, Judge, Judgement, NotMeasuredError

_BUILD = (
    "Culling on, copied geometry, horizontal splits: time of the BVH build, over that of the plain mesh in the same "
    "rounds. "
)
_LITTLE_BUILD = (
    f"{_BUILD}At every N up to {{most}} over that at one split; value: the largest, and plan and build together at "
    f"{{most}}. {OUR_READING}little = at most {resources.LITTLE_EFFECT:g} times. Holds on a scene when every interval "
    "lies within, fails when one lies beyond. "
)
_MEMORY = "Culling on, copied geometry, horizontal splits, a process of its own each: embree_bytes over those at one "
_LITTLE_MEMORY = (
    f"{_MEMORY}split, at every N up to {{most}}; value: the largest. The growth of the process, rss_bytes - "
    f"rss_mesh_bytes, at one split and at {{most}} stands beside it and decides nothing. {NO_INTERVAL}{OUR_READING}"
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
            alone(on_scenes(judge(most))),
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
        f"them; value: at the most splits. {NO_INTERVAL}The cost: frame time instanced over copied, widest packets, "
        "geometric mean over such splits; the interval is the cost's and has no part in the verdict.",
        alone(on_every_scene(resources.instancing_lowers_memory(culling))),
    )


RESOURCES: tuple[Claim, ...] = (
    *_little_affected("build", "Fig. 6", "lengthen the BVH build", _LITTLE_BUILD, resources.build_little_affected),
    *_little_affected("memory", "Fig. 7", "need more memory", _LITTLE_MEMORY, resources.memory_little_affected),
    Claim(
        "build-grows",
        "§4.3",
        "The BVH build takes longer the more splits there are.",
        "grows with the splits",
        f"{_BUILD}At the most splits over one; value: that, and plan and build together. {DECIDED}",
        alone(on_every_scene(resources.build_grows)),
    ),
    Claim(
        "overlap-lowers-quality",
        "§4.2",
        "The cells' copies overlap, which lowers the quality of the BVH.",
        "lower quality",
        "Culling off, copied geometry, horizontal splits: boxes that a random ray enters in the BVH that Embree's own "
        "builder makes of the same triangles (rtcBuildBVH, eight children a node), over the pixels that a ray serves. "
        "Value: at the most splits over one; holds on a scene when above 1. It is counted, so it carries no interval.",
        alone(on_every_scene(resources.overlap_lowers_quality)),
    ),
    Claim(
        "memory-grows",
        "§4.4",
        "Memory grows with the number of splits.",
        "grows with the splits",
        f"{_MEMORY}split, at 1,024 splits. {NO_INTERVAL}Holds on a scene when above 1.",
        alone(on_every_scene(resources.memory_grows)),
    ),
    Claim(
        "image-without-error",
        "§4",
        "Aligned rays give the same image as one ray per pixel.",
        "no error",
        "Every aligned image that was compared with that of rtcIntersect1, each difference judged in float64: holds "
        "when pixels_wrong is 0 in all. Pixels that tie or lie at a triangle's edge are counted beside. A count has no "
        "interval.",
        alone(on_every_scene(resources.image_without_error)),
    ),
    Claim(
        "cost-model",
        "§3.2",
        "Render time grows like log(N_p) N_r: rays times the logarithm of the triangles.",
        "time proportional to log(N_p) N_r",
        f"{SINGLE_RAYS}Culling off, horizontal splits, N_r = pixels / cells, N_p = triangles_traced. Least squares of "
        "log(1 / speedup) over log(log(N_p) N_r), at least 5 points; the model expects exponent 1. The interval is "
        f"Student's. {OUR_READING}holds when the whole interval lies within {speed.MODEL_EXPONENT.low:g} to "
        f"{speed.MODEL_EXPONENT.high:g} and R2 is at least {speed.MODEL_R_SQUARED:g}, fails when all of it lies "
        "outside, and is undecided otherwise.",
        alike(on_every_scene, speed.time_follows_cost_model),
    ),
    _instancing(culling=True),
    _instancing(culling=False),
    Claim(
        "larger-scenes-gain-less",
        "§4, Fig. 5",
        "The more triangles a scene has, the smaller its best speed-up.",
        "7.50 > 2.94 > 1.85 > 1.71",
        "Best speed-up of single rays over horizontal splits, culling on, 1,024 x 1,024 pixels, all four scenes "
        f"themselves. {CHOSEN}Holds when each is above that of the next larger scene by the whole interval of their "
        "ratio, fails when it is below that of any larger one. The paper does not say so; its values do.",
        each(on_paper_scenes, speed.larger_scenes_gain_less),
        inferred=True,
    ),
)


_UNMEASURED = "No table can judge it."


def _no_number(why: str) -> dict[str, Judge]:
    """The judge of a sentence that no table can judge."""

    def judge(evidence: Any) -> Judgement:
        raise NotMeasuredError(why)

    return {"": judge}


OTHERS: tuple[Claim, ...] = (
    Claim(
        "culling-saves-memory", "§3.4", "Culling keeps the copies from filling the memory.", "less memory",
        "Horizontal splits, copied geometry: embree_bytes with culling on over off, at every split from 2 on that was "
        f"measured of both. Holds on a scene when below 1 at all of them; value: at the most splits. {NO_INTERVAL}",
        alone(on_every_scene(resources.culling_saves_memory)),
    ),
    Claim(
        "any-divisor-works", "§3", "Any number of cells that divides the image can be used.", "any divisor",
        "Culling on, single rays: wrong pixels at each of the eleven divisors of 1,024, none of them at all of these.",
        alone(on_every_scene(resources.any_divisor_works)),
    ),
    Claim(
        "easy-to-implement", "§1", "The method is easy to implement with a given ray tracer.", "easy", _UNMEASURED,
        _no_number("how easy it is, no table says; ours is atra/alignment, beside a filter function of Embree"),
    ),
    Claim(
        "no-early-end", "§5", "A ray cannot end at its first hit.", "impossible", _UNMEASURED,
        _no_number("this follows from the method: a ray serves a pixel of every cell, and each may see a farther hit"),
    ),
    Claim(
        "stereo-and-frames", "§5", "Two eyes, or several frames, can share one set of rays.", "suggested, not measured",
        _UNMEASURED, _no_number("a proposal without a number; sweep=stereo and sweep=multiframe say what it brings"),
    ),
)  # fmt: skip
