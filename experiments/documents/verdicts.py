"""Verdicts on all claims, recomputed from the processes that are kept of a sweep."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from experiments.documents.kept_rows import REFERENCE
from experiments.paper.claims import judge_claims
from experiments.results.claims import NOT_MEASURED, judge_all
from experiments.results.table import read_table, workload_rows
from experiments.workloads import WORKLOADS

PAPERS = ("paper", "gather")
"""Sweeps whose tables answer the paper's claims."""


def folders() -> list[Path]:
    """Those under reports/reference that keep processes."""
    return sorted(path.parent for path in REFERENCE.glob("*/processes.parquet"))


def recomputed(folder: Path) -> list[dict[str, Any]]:
    """The verdicts of a sweep: the paper's claims, or those of its workloads that were measured."""
    processes = read_table(folder / "processes.parquet")
    assert processes is not None
    if folder.name in PAPERS:
        return [asdict(claim) for claim in judge_claims(processes)]
    verdicts = []
    for workload in WORKLOADS:
        shown: Any = workload.part("shown")
        if hasattr(shown, "CLAIMS") and processes["workload"].eq(workload.name).any():
            judged = judge_all(shown.CLAIMS, workload_rows(processes, workload.name))
            verdicts += [asdict(claim) for claim in judged if claim.verdict != NOT_MEASURED]
    return verdicts


def as_text(verdicts: list[dict[str, Any]]) -> str:
    """As they are kept in claims.json."""
    return json.dumps(verdicts, indent=1, ensure_ascii=False) + "\n"
