"""Claims judged anew, rows of every page written below their marks, and phrases printed that a page lacks."""

import sys

from tests.quotations import QUOTATIONS
from tests.quotations.quotation import ROOT, with_rows
from tests.quotations.verdicts import as_text, folders, recomputed

check = "--check" in sys.argv[1:]
differing = []
for folder in folders():
    verdicts, path = recomputed(folder), folder / "claims.json"
    kept = path.read_text(encoding="utf-8") if path.exists() else ""
    if kept != (as_text(verdicts) if verdicts else ""):
        differing.append(f"{path.relative_to(ROOT)}: other verdicts")
        if not check:
            path.write_text(as_text(verdicts), encoding="utf-8")
for quotation in QUOTATIONS:
    if not (quotation.folder / "table.parquet").exists():
        print(f"\n{quotation.page}: no table of sweep={quotation.sweep} is kept, so {quotation.name} stays as it is")
        continue
    rows, phrases = quotation.rows_and_phrases()
    path = ROOT / quotation.page
    page = path.read_text(encoding="utf-8")
    if rows and page != with_rows(page, quotation.name, rows):
        differing.append(f"{quotation.page}: rows of {quotation.name}")
        if not check:
            path.write_text(with_rows(page, quotation.name, rows), encoding="utf-8")
    if missing := [phrase for phrase in phrases if phrase not in " ".join(page.split())]:
        differing.append(f"{quotation.page}: phrases of {quotation.name}")
        print(f"\n{quotation.page}, from sweep={quotation.sweep}, does not say:", *missing, sep="\n")
print(*differing or ["every number and every verdict is that of the tables"], sep="\n")
sys.exit(bool(check and differing))
