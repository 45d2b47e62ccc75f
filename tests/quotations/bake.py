"""What docs/lightmaps.md quotes of sweep=bake, sweep=bake_denoise and sweep=bake_rays."""

from __future__ import annotations

from functools import partial

import pandas as pd

from experiments.results.claims import Claim, judge_claim
from experiments.workloads.bake import Against, Compaction
from experiments.workloads.bake.claims import CLAIMS
from experiments.workloads.bake_rays.claims import CLAIMS as PREDICTIONS
from tests.quotations.quotation import SCENES, Kept, Quoted, interval, of, table_row


def _row(kept: Kept, label: str, column: str, **values: object) -> str:
    """A line with the ratio of each scene and its interval; of several points of a scene, of the emptiest map."""
    cells = []
    for scene in SCENES:
        rows = of(kept.points, scene=scene, **values)
        rows = rows[rows[column].notna()].sort_values("map_occupancy", kind="stable")
        cells.append("not measured" if rows.empty else interval(rows.iloc[0], column))
    return table_row(label, *cells)


def means_of_a_bake(kept: Kept) -> Quoted:
    """Each means of a bake over a bake without it."""
    less = partial(_row, kept, against=Against.compaction.value)
    texels, bounces = Compaction.texels.value, Compaction.bounces.value
    return Quoted(
        rows=(
            less("lanes for lit texels alone: rays/s", "rays_speedup_vs_other", compaction=texels),
            less("lanes that go on alone: time", "speedup_vs_other", compaction=bounces, albedo="own"),
            less("lanes that go on alone, albedo 0.5: time", "speedup_vs_other", albedo="0.5", packets="1"),
            less("the same in the widest packets", "speedup_vs_other", albedo="0.5", packets="widest"),
            _row(kept, "the emptiest map over the fullest: rays/s", "rays_speedup_vs_other",
                 against=Against.occupancy.value, compaction=bounces),
            _row(kept, "16 samples side by side: rays/s", "rays_speedup_vs_other",
                 against=Against.expansion.value, expansion=16),
            _row(kept, "what the view shows, first: its time", "view_speedup", compaction=bounces),
            _row(kept, "the whole map then: time over that in rows", "whole_map_cost", compaction=bounces),
            _row(kept, "roulette: time to an error", "quality_vs_other", against=Against.roulette.value),
            _row(kept, "a panorama found both ways: time to an error", "quality_vs_other",
                 against=Against.environment.value, environment="mis"),
            _row(kept, "code for faces that let light on: time", "speedup_vs_other",
                 against=Against.translucency.value),
        )
    )  # fmt: skip


def _verdicts(claims: tuple[Claim, ...], table: pd.DataFrame) -> Quoted:
    """A row a claim that a sweep measures."""
    judged = [one for claim in claims for one in judge_claim(claim, table)]
    return Quoted(rows=tuple(table_row(one.text, one.value or "-", one.verdict) for one in judged))


def verdicts_on_lightmaps(kept: Kept) -> Quoted:
    return _verdicts(CLAIMS, kept.points)


def finished_maps(kept: Kept) -> Quoted:
    """Error denoised over raw of four times the samples, and what is left of the steps at seams."""
    seams = [of(kept.points, scene=scene)["seam_step_ratio"].dropna() for scene in SCENES]
    return Quoted(
        rows=(
            _row(kept, "denoised at 64 samples over raw at 256: error", "denoised_over_raw"),
            table_row("after stitching over before: step at seams",
                      *("not measured" if one.empty else f"{one.iloc[0]:.2f}" for one in seams)),
        )
    )  # fmt: skip


def verdicts_on_alignment(kept: Kept) -> Quoted:
    return _verdicts(PREDICTIONS, kept.points)
