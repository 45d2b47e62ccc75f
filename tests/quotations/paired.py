"""What reports/reference/tables.md says of `python -m experiments.paired`."""

from experiments.paired import ratios
from tests.quotations.quotation import SCENES, table_row


def this_and_before(kept):
    """How many times as fast this version is as the other one, by what was asked, on each scene with its interval."""
    found = ratios(kept.points).set_index(["instruction_set", "threads", "what", "scene"])["ratio"]
    for instruction_set, threads, what in dict.fromkeys(key[:3] for key in found.index):
        cells = [found.get((instruction_set, threads, what, scene), "") for scene in SCENES]
        yield table_row(f"{what.replace('_', ' ')}, {instruction_set}", threads, *cells)
