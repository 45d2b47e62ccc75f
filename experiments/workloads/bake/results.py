"""What became of the claims on lightmaps: files beside the sweep's table."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments.results.claims import judge_claim, write_claims
from experiments.workloads.bake.claims import CLAIMS

CLAIMS_FILE = "bake_claims"


def write(folder: Path, records: Path, rows: pd.DataFrame) -> None:
    """Judge all claims by the rows of this workload."""
    write_claims(folder, [judged for claim in CLAIMS for judged in judge_claim(claim, rows)], CLAIMS_FILE)
