"""Rows of every page written below their marks, and phrases printed."""

from tests.quotations import QUOTATIONS
from tests.quotations.quotation import ROOT, with_rows

for quotation in QUOTATIONS:
    if not (quotation.folder / "table.parquet").exists():
        print(f"\n{quotation.page}: no table of sweep={quotation.sweep} is kept, so {quotation.name} stays as it is")
        continue
    rows, phrases = quotation.rows_and_phrases()
    path = ROOT / quotation.page
    page = path.read_text(encoding="utf-8")
    if rows:
        path.write_text(with_rows(page, quotation.name, rows), encoding="utf-8")
    if missing := [phrase for phrase in phrases if phrase not in " ".join(page.split())]:
        print(f"\n{quotation.page}, from sweep={quotation.sweep}, does not say:", *missing, sep="\n")
