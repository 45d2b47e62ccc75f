"""What reports/reference/tables.md says of `python -m experiments.studies paired`."""

from experiments.studies.paired import ratios
from tests.quotations.quotation import SCENES, digits, table_row


def this_and_before(kept):
    """How many times as fast this version is as the other one, by what was asked, on each scene with its interval."""
    found = ratios(kept.points).set_index(["instruction_set", "threads", "what", "scene"])["ratio"]
    known = [key for key in found.index if key[3] in SCENES]
    for instruction_set, threads, what in dict.fromkeys(key[:3] for key in known):
        cells = [found.get((instruction_set, threads, what, scene), "") for scene in SCENES]
        yield table_row(f"{what.replace('_', ' ')}, {instruction_set}", threads, *cells)


def small_triangles_before(kept):
    """A scene made by code a row: triangles, images and packets as in `this_and_before`, and how many times as fast
    as packets an image is now."""
    table = kept.points
    found = ratios(table).set_index(["scene", "what"])["ratio"]
    for scene, rows in table[~table["scene"].isin(SCENES)].groupby("scene"):
        mine = rows[rows["version"] == "this"].groupby("what")["median_ms"].median()
        cells = (found[scene, what] for what in ("image", "packets"))
        yield table_row(f"`{scene}`", f"{rows['triangles'].iloc[0]:,}", *cells, digits(mine["packets"] / mine["image"]))
