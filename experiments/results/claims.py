"""Claims -> findings -> files."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

import pandas as pd

from experiments.results.statistics import NotMeasuredError

HOLDS, DOES_NOT_HOLD, UNDECIDED, NOT_MEASURED = VERDICTS = "holds", "does not hold", "undecided", "not measured"
"""undecided = measured in full, but not precisely enough to say."""

ONE_READING = "holds under one reading only"
"""Verdict where the readings of a claim disagree: under another it does not hold, is undecided or was not measured."""


@dataclass(frozen=True)
class Judgement:
    """verdict: one of `VERDICTS`. value, interval: ours, as text; "" and None where there is none.
    why: one line where the verdict is not `holds`. stand_ins: "atrium for sponza" for each stand-in that was judged.
    """

    verdict: str
    value: str = ""
    interval: str | None = None
    why: str | None = None
    stand_ins: tuple[str, ...] = ()


Judge = Callable[[Any], Judgement]
"""Evidence -> Judgement. The evidence is a table, None where there is none, or what a paper's claims make of it. Raises
NotMeasuredError."""


@dataclass(frozen=True)
class Claim:
    """One statement of a paper.

    section: where in the paper. text: in our own words. paper_value: what the paper reports.
    how: how our value and the verdict are computed from the table.
    judges: evidence -> Judgement, under each reading of what the paper leaves open, "" where it leaves nothing; they
    raise NotMeasuredError for rows, columns or scenes that are missing. inferred: the paper does not say it, but its
    values do.
    """

    id: str
    section: str
    text: str
    paper_value: str
    how: str
    judges: Mapping[str, Judge]
    inferred: bool = False


@dataclass(frozen=True)
class JudgedClaim:
    """A claim and what became of it under one reading: plain values, one row of `claims.csv`.

    reading: "" where there is but one. inferred: as of `Claim`. verdict: one of `VERDICTS`. value: ours, "" where there
    is none. interval: 95 % confidence. why: one line where it does not hold.
    """

    id: str
    section: str
    text: str
    paper_value: str
    how: str
    inferred: bool
    reading: str
    verdict: str
    value: str
    interval: str | None
    why: str | None


def judge_claim(claim: Claim, evidence: Any) -> tuple[JudgedClaim, ...]:
    """What the evidence says of `claim` under each reading; without rows, that it was not measured.

    Raises ValueError, with its name, for one that cannot be judged, such as for a column that no table has.
    """
    judged = []
    for reading, judge in claim.judges.items():
        try:
            judgement = judge(evidence)
        except NotMeasuredError as error:
            judgement = Judgement(NOT_MEASURED, why=str(error))
        except ValueError as error:
            raise ValueError(f"claim {claim.id} cannot be judged: {error}") from error
        stand_ins = f" (Judged on stand-ins: {', '.join(judgement.stand_ins)}.)" if judgement.stand_ins else ""
        told = (claim.id, claim.section, claim.text + stand_ins, claim.paper_value, claim.how, claim.inferred, reading)
        judged.append(JudgedClaim(*told, judgement.verdict, judgement.value, judgement.interval, judgement.why))
    return tuple(judged)


def judge_all(claims: Sequence[Claim], evidence: Any) -> list[JudgedClaim]:
    """What the evidence says of every claim, under each of its readings."""
    return [judged for claim in claims for judged in judge_claim(claim, evidence)]


def by_claim(judged: Sequence[JudgedClaim]) -> list[tuple[JudgedClaim, ...]]:
    """What became of each claim under all its readings."""
    return [tuple(readings) for _, readings in groupby(judged, key=lambda claim: claim.id)]


def verdict_on(readings: Sequence[JudgedClaim]) -> str:
    """One for all readings of a claim: one of `VERDICTS`, or ONE_READING."""
    verdicts = [judged.verdict for judged in readings]
    if HOLDS in verdicts:
        return HOLDS if set(verdicts) == {HOLDS} else ONE_READING
    # Readings that do not agree that it fails leave it open.
    return next(verdict for verdict in (NOT_MEASURED, UNDECIDED, DOES_NOT_HOLD) if verdict in verdicts)


def claim_files(findings: Sequence[JudgedClaim], name: str = "claims") -> dict[str, bytes]:
    """The contents of `<name>.json` and `<name>.csv`, by name; a missing interval or reason is null, in CSV empty."""
    rows = [asdict(finding) for finding in findings]
    table = pd.DataFrame(rows, columns=list(JudgedClaim.__dataclass_fields__))
    return {
        f"{name}.json": (json.dumps(rows, indent=1, ensure_ascii=False) + "\n").encode(),
        f"{name}.csv": table.to_csv(index=False).encode(),
    }
