"""What became of the claims on ray classification."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from experiments.results.claims import judge_claim, write_claims
from experiments.workloads.rays.claims import CLAIMS

CLAIMS_FILE = "classification_claims"


def write(folder: Path, records: Path, table: pd.DataFrame) -> None:
    """Write them as JSON and CSV. table: rows of this workload."""
    write_claims(folder, [judged for claim in CLAIMS for judged in judge_claim(claim, table)], CLAIMS_FILE)
