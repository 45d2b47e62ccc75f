"""What pages quote of sweep=bake and of the other sweeps of lightmaps."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import pandas as pd

from experiments.results.claims import Claim, judge_claim
from experiments.workloads.bake import RARE, STAGES, Against
from experiments.workloads.bake.claims import CLAIMS
from experiments.workloads.bake_rays.claims import CLAIMS as PREDICTIONS
from tests.quotations.quotation import SCENES, Kept, Quoted, digits, interval, of, table_row

_OF_FINISHING = ("target-denoised", "target-seams")
_OF_BUFFERS = ("buffers",)
_OF_MITSUBA = ("target-mitsuba",)
_OF_VIEWS = ("culling-map", "culling-map-share")
"""Claims that a sweep of their own decides."""


Say = Callable[[pd.Series, str], str]
"""A row of a table and the name of a ratio -> the ratio as it is written."""


def _row(kept: Kept, label: str, column: str, say: Say = interval, **values: object) -> str:
    """A line with the ratio of each scene and its interval; of several points of a scene, of the emptiest map."""
    cells = []
    for scene in SCENES:
        rows = of(kept.points, scene=scene, **values)
        rows = rows[rows[column].notna()].sort_values("map_occupancy", kind="stable")
        cells.append("not measured" if rows.empty else say(rows.iloc[0], column))
    return table_row(label, *cells)


def _shares(kept: Kept, label: str, **values: object) -> str:
    """A line with what part of a round rare stages take."""
    cells = []
    for scene in SCENES:
        rows = of(kept.points, scene=scene, **values)
        rare, whole = (sum(rows[f"{stage}_s"].median() for stage in stages) for stages in (RARE, STAGES))
        cells.append("not measured" if rows.empty else f"{100 * rare / whole:.1f} %")
    return table_row(label, *cells)


def means_of_a_bake(kept: Kept) -> Quoted:
    """Each means of a bake over a bake without it; above 1 is a gain, but where a label says what is over what."""
    less = partial(_row, kept, against=Against.compaction.value)
    texels, bounces = "texels", "bounces"
    return Quoted(
        rows=(
            less("lanes for lit texels, near ones side by side: rays/s", "rays_speedup_vs_other", compaction=texels),
            less("lanes that go on alone: speed", "speedup_vs_other", compaction=bounces, albedo="own"),
            less("lanes that go on alone, albedo 0.5: speed", "speedup_vs_other", albedo="0.5", packets="1"),
            less("the same in the widest packets: speed", "speedup_vs_other", albedo="0.5", packets="widest"),
            _row(kept, "the emptiest map over the fullest: rays/s", "rays_speedup_vs_other",
                 against=Against.occupancy.value, compaction=bounces),
            _row(kept, "16 samples side by side: rays/s", "rays_speedup_vs_other",
                 against=Against.expansion.value, expansion=16),
            _shares(kept, "expansion and gathering of 16 samples side by side: of a round",
                    against=Against.expansion.value, expansion=16),
            _row(kept, "what the view shows, first: speed", "view_speedup", compaction=bounces),
            _row(kept, "the whole map, the view first over by place: time", "whole_map_cost", compaction=bounces),
            _row(kept, "roulette: speed to an error", "quality_vs_other", against=Against.roulette.value),
            _row(kept, "a panorama found both ways: speed to an error", "quality_vs_other",
                 against=Against.environment.value, environment="mis"),
            _row(kept, "a grid of 256 lights: speed to an error", "quality_vs_other",
                 against=Against.lights.value, lamps=256),
            _row(kept, "code for faces that let light on over code without: time", "speedup_vs_other",
                 against=Against.translucency.value),
        )
    )  # fmt: skip


def bakes_in_short(kept: Kept) -> Quoted:
    """What gains most in a bake, without intervals."""

    def row(label: str, column: str, **values: object) -> str:
        return _row(kept, label, column, lambda found, name: digits(found[name]), **values)

    return Quoted(
        rows=(
            row("texels that the view shows come first", "view_speedup", compaction="bounces"),
            row("lanes for lit texels alone", "rays_speedup_vs_other", against=Against.compaction.value,
                compaction="texels"),
            row("16 samples of a texel side by side", "rays_speedup_vs_other",
                against=Against.expansion.value, expansion=16),
            row("a panorama found by both kinds of rays", "quality_vs_other",
                against=Against.environment.value, environment="mis"),
            row("a grid that chooses among 256 lights", "quality_vs_other",
                against=Against.lights.value, lamps=256),
        )
    )  # fmt: skip


def finished_maps(kept: Kept) -> Quoted:
    """Error denoised over raw of four times the samples, and what is left of the steps at seams."""
    return Quoted(
        rows=(
            _same(kept, "denoised at 64 samples over raw at 256: error", "denoised_ratio"),
            _same(kept, "after stitching over before: step at seams", "seam_step_ratio"),
        )
    )


def _same(kept: Kept, text: str, column: str) -> str:
    """A row of what every process finds alike."""
    found = [of(kept.points, scene=scene)[column].dropna() for scene in SCENES]
    return table_row(text, *("not measured" if one.empty else f"{one.iloc[0]:.2f}" for one in found))


def paths_beside_mitsuba(kept: Kept) -> Quoted:
    """Paths a second over Mitsuba's. Not the time to an error: only ours aim at lamps from texels."""
    held = partial(_row, kept, against=Against.mitsuba.value)
    return Quoted(
        rows=tuple(
            held(f"{ours}: paths/s over {theirs}", column=column, packets=packets)
            for packets, ours in (("1", "rays one by one"), ("8", "in packets of 8, hierarchy of high quality"))
            for column, theirs in (("speedup_vs_other", "Mitsuba's"), ("speedup_vs_best_other", "its best"))
        )
    )


def paths_beside_mitsuba_before(kept: Kept) -> Quoted:
    """The same of an earlier version, on another machine."""
    return paths_beside_mitsuba(kept)


def bias_of_adaptive(kept: Kept) -> Quoted:
    """How far the mean light of adaptive maps is off, with its standard error, and what they leave out and save."""
    found = [of(kept.points, scene=scene, adaptive=True).iloc[0] for scene in SCENES]
    biases = (f"{100 * row['adaptive_bias']:+.2f} ± {100 * row['adaptive_bias_error']:.2f} %" for row in found)
    return Quoted(
        rows=(
            table_row("mean light, adaptive over full, less 1", *biases),
            table_row("samples left out", *(f"{100 * row['adaptive_left_out']:.1f} %" for row in found)),
            table_row("full over adaptive: time", *(digits(row["adaptive_speedup"]) for row in found)),
        )
    )


def _verdicts(kept: Kept, claims: Iterable[Claim]) -> Quoted:
    """A row a claim."""
    judged = [one for claim in claims for one in judge_claim(claim, kept.points)]
    return Quoted(rows=tuple(table_row(one.text, one.value or "-", one.verdict) for one in judged))


def _named(*names: str) -> Iterable[Claim]:
    return [claim for claim in CLAIMS if claim.id in names]


def verdicts_on_lightmaps(kept: Kept) -> Quoted:
    """On all claims that no other sweep decides."""
    others = (*_OF_FINISHING, *_OF_BUFFERS, *_OF_VIEWS, *_OF_MITSUBA)
    return _verdicts(kept, [claim for claim in CLAIMS if claim.id not in others])


def verdicts_on_finishing(kept: Kept) -> Quoted:
    return _verdicts(kept, _named(*_OF_FINISHING))


def verdicts_on_buffers(kept: Kept) -> Quoted:
    return _verdicts(kept, _named(*_OF_BUFFERS))


def verdicts_on_mitsuba(kept: Kept) -> Quoted:
    return _verdicts(kept, _named(*_OF_MITSUBA))


def verdicts_on_alignment(kept: Kept) -> Quoted:
    """On the predictions of what alignment gains."""
    return _verdicts(kept, PREDICTIONS)


def verdicts_on_views(kept: Kept) -> Quoted:
    return _verdicts(kept, _named(*_OF_VIEWS))
