"""Write the numbers of reports/reference/tables.md, README and docs anew, from the tables that are kept.

`python run.py tables` judges every claim anew from the processes that are kept, by the one rule
(`experiments.results.verdicts`), writes claims.json, and the rows of the pages below their marks
(`<!-- rows: name -->`), and prints phrases that pages lack. `python run.py tables check=true` writes nothing, and fails
where anything differs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from atra.errors import InputError
from atra.files.paths import write_atomically
from experiments.documents import QUOTATIONS
from experiments.documents.quotation import ROOT, Quotation, with_rows
from experiments.documents.verdicts import as_text, folders, recomputed

USAGE = "python run.py tables [check=true]"


def run_tables(arguments: Sequence[str]) -> None:
    """Do it, and print what differed. Raises InputError for another argument, or where a check finds a difference."""
    if [one for one in arguments if one != "check=true"]:
        raise InputError(f"tables takes check=true alone, not {' '.join(arguments)}; usage: {USAGE}")
    is_check = bool(arguments)
    found = [*_claims(write=not is_check), *(said for one in QUOTATIONS for said in _page(one, write=not is_check))]
    print(*found or ["every number and every verdict is that of the tables"], sep="\n")
    if is_check and found:
        raise InputError(f"{len(found)} of the tables' numbers stand otherwise; run: python run.py tables")


def _claims(write: bool) -> Iterator[str]:
    for folder in folders():
        verdicts, path = recomputed(folder), folder / "claims.json"
        kept = path.read_text(encoding="utf-8") if path.exists() else ""
        if kept != (text := as_text(verdicts) if verdicts else ""):
            yield f"{path.relative_to(ROOT)}: other verdicts"
            if write:
                write_atomically(path, text.encode())


def _page(quotation: Quotation, write: bool) -> Iterator[str]:
    rows, phrases = quotation.rows_and_phrases()
    path = ROOT / quotation.page
    page = path.read_text(encoding="utf-8")
    if rows and page != (other := with_rows(page, quotation.name, rows)):
        yield f"{quotation.page}: rows of {quotation.name}"
        if write:
            write_atomically(path, other.encode())
    for phrase in phrases:
        if phrase not in " ".join(page.split()):
            yield f"{quotation.page}, from {quotation.sweep}, does not say: {phrase}"
