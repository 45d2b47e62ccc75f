"""Rows of tables.md that code of older commits made of the stored tables."""

from __future__ import annotations

import csv
from hashlib import sha256
from pathlib import Path

REFERENCE = Path(__file__).resolve().parents[2] / "reports" / "reference"
KEPT_OF = REFERENCE / "kept.sha256"
"""The tables that the rows were made of: SHA-256 and place of each, a line a table."""


def kept_rows(sweep: str, name: str) -> list[list[str]]:
    """Rows that code of an older commit made of a sweep's tables. Raises ValueError where a table is another by now."""
    known = {place: digest for digest, place in map(str.split, KEPT_OF.read_text(encoding="utf-8").splitlines())}
    for path in sorted((REFERENCE / sweep).glob("*.parquet")):
        if known.get(f"{sweep}/{path.name}") != sha256(path.read_bytes()).hexdigest():
            raise ValueError(
                f"{sweep}/{path.name} is not the table that {sweep}/{name}.csv was made of; make the rows anew by the "
                f"commit that reports/reference/README.md names, and then write the table's SHA-256 into {KEPT_OF.name}"
            )
    with (REFERENCE / sweep / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file))
