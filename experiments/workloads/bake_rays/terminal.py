"""What the terminal says of aligned rays of a bake."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from experiments.results.claims import judge_claim
from experiments.workloads.bake_rays.claims import CLAIMS


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """What became of each prediction. rows: those of this workload that were measured."""
    for claim in CLAIMS:
        for judged in judge_claim(claim, rows):
            told = ", ".join(filter(None, [judged.value, judged.why]))
            yield f"{claim.text} {judged.verdict}{f' ({told})' if told else ''}"
