"""Claims -> findings -> files."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from atra.files import write_atomically

HOLDS, DOES_NOT_HOLD, UNDECIDED, NOT_MEASURED = VERDICTS = "holds", "does not hold", "undecided", "not measured"
"""undecided = measured in full, but not precisely enough to say."""


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


Judge = Callable[[pd.DataFrame | None], Judgement]


@dataclass(frozen=True)
class Claim:
    """One statement of the paper.

    section: where in the paper. text: in our own words. paper_value: what the paper reports.
    how: how our value and the verdict are computed from the table.
    judge: table -> Judgement; raises nothing for rows, columns or scenes that are missing.
    """

    id: str
    section: str
    text: str
    paper_value: str
    how: str
    judge: Judge


@dataclass(frozen=True)
class JudgedClaim:
    """A claim and what became of it: plain values, one row of `claims.csv`.

    verdict: one of `VERDICTS`. value: ours, "" where there is none. interval: 95 % confidence. why: one line
    where it does not hold.
    """

    id: str
    section: str
    text: str
    paper_value: str
    how: str
    verdict: str
    value: str
    interval: str | None
    why: str | None


def judge_claim(claim: Claim, table: pd.DataFrame | None) -> JudgedClaim:
    """What the table says of `claim`; without rows, that it was not measured."""
    found = claim.judge(table)
    stand_ins = f" (Judged on stand-ins: {', '.join(found.stand_ins)}.)" if found.stand_ins else ""
    told = (claim.id, claim.section, claim.text + stand_ins, claim.paper_value, claim.how)
    return JudgedClaim(*told, found.verdict, found.value, found.interval, found.why)


def write_claims(folder: Path, findings: Sequence[JudgedClaim]) -> None:
    """Write `claims.json` and `claims.csv` into `folder`; a missing interval or reason is null, in CSV empty."""
    rows = [asdict(finding) for finding in findings]
    write_atomically(folder / "claims.json", (json.dumps(rows, indent=1, ensure_ascii=False) + "\n").encode())
    names = list(JudgedClaim.__dataclass_fields__)
    write_atomically(folder / "claims.csv", pd.DataFrame(rows, columns=names).to_csv(index=False).encode())
