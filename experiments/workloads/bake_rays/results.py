"""What became of the predictions: a file beside the sweep's table."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments.results.claims import judge_claim, write_claims
from experiments.workloads.bake_rays.claims import CLAIMS


def write(folder: Path, records: Path, rows: pd.DataFrame) -> None:
    """Judge all predictions by the rows of this workload."""
    write_claims(folder / "predictions", [judged for claim in CLAIMS for judged in judge_claim(claim, rows)])
