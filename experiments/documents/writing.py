"""Write reports/reference/tables.md whole, and the few numbers that README and documents quote, from stored tables.

`python run.py tables` judges every claim again from the stored processes by the one rule
(`experiments.results.verdicts`) and writes claims.json. Then it fills template.md, whose blocks of TOML describe
tables, and the quotes of quotes.toml. `python run.py tables check=true` writes nothing, and fails where anything
differs.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from atra.errors import InputError
from atra.files.paths import write_atomically
from experiments.documents.filling import REFERENCE, ROOT, TIMES, cell_text, kept_of, table_lines, united
from experiments.methods import find_method
from experiments.paper.claims import judge_claims
from experiments.paper.conclusion import scene_gains
from experiments.results.claims import NOT_MEASURED, judge_all
from experiments.results.table import read_table, workload_rows
from experiments.workloads import WORKLOADS
from experiments.workloads.frame.shown import best_baselines

Rows = Iterable[Iterable[Any]]

USAGE = "python run.py tables [check=true]"
TABLES = "reports/reference/tables.md"
TEMPLATE = Path(__file__).with_name("template.md")
QUOTES = Path(__file__).with_name("quotes.toml")
PAPERS = ("paper", "gather")
"""Sweeps whose tables answer the paper's claims."""

BLOCK = re.compile(r"^```toml\n(.*?)^```\n", re.M | re.S)
_NAME = re.compile(r"\\\{(\w+)\\\}")
_NUMBER = r"(\d[\d.,]*(?:\s+to\s+\d[\d.,]*)?)"


def run_tables(arguments: Sequence[str]) -> None:
    """Do it, and print what differed. Raises InputError for another argument, or where a check finds a difference."""
    if unknown := [argument for argument in arguments if argument != "check=true"]:
        raise InputError(f"tables takes check=true alone, not {' '.join(unknown)}; usage: {USAGE}")
    is_check = bool(arguments)
    changed = []
    for path, text in (*_claims(), *pages()):
        if text != (path.read_text(encoding="utf-8") if path.exists() else ""):
            changed.append(f"{path.relative_to(ROOT).as_posix()}: other numbers or verdicts")
            if not is_check:
                write_atomically(path, text.encode())
    print(*changed or ["every number and every verdict is that of the tables"], sep="\n")
    if is_check and changed:
        raise InputError(f"{len(changed)} files differ from the stored tables; run: python run.py tables")


def _claims() -> Iterator[tuple[Path, str]]:
    for folder in folders():
        verdicts = recomputed(folder)
        yield folder / "claims.json", json.dumps(verdicts, indent=1, ensure_ascii=False) + "\n" if verdicts else ""


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


def pages() -> Iterator[tuple[Path, str]]:
    """Each file with numbers, and what it should contain."""
    yield ROOT / TABLES, filled(TEMPLATE.read_text(encoding="utf-8"))
    texts: dict[str, str] = {}
    for page, quote, numbers in quotes():
        texts.setdefault(page, (ROOT / page).read_text(encoding="utf-8"))
        try:
            texts[page] = with_numbers(texts[page], quote, numbers)
        except ValueError as error:
            raise InputError(f"{page}: {error}") from error
    yield from ((ROOT / page, text) for page, text in texts.items())


def filled(template: str) -> str:
    """The template with a table in place of each block. Raises ValueError for what no stored table has."""
    return BLOCK.sub(lambda block: "\n".join(table_lines(tomllib.loads(block[1]), FUNCTIONS)) + "\n", template)


def quotes() -> Iterator[tuple[str, str, dict[str, str]]]:
    """Each page that quotes, the text of the quote, and its numbers by name."""
    told = tomllib.loads(QUOTES.read_text(encoding="utf-8"))
    for quote in told["quotes"]:
        where = {"where": quote.get("where", {})}
        names = re.findall(r"\{(\w+)\}", quote["text"])
        numbers = {name: cell_text(united(told["numbers"][name], where)) for name in names}
        yield quote["page"], quote["text"], numbers


def with_numbers(page: str, quote: str, numbers: dict[str, str]) -> str:
    """The page with these numbers in the quote, wherever lines break. Raises ValueError where it is not there once."""
    pattern = r"\s+".join(_NAME.sub(lambda _: _NUMBER, re.escape(word)) for word in quote.split())
    matches = list(re.finditer(pattern, page))
    if len(matches) != 1:
        raise ValueError(f"{len(matches)} times says {quote!r}, expected once")
    names = re.findall(r"\{(\w+)\}", quote)
    for place in range(len(names), 0, -1):  # from the last, so that earlier places stay
        start, end = matches[0].span(place)
        page = page[:start] + numbers[names[place - 1]] + page[end:]
    return page


# Rows of tables that no description in TOML says: a function takes a sweep, and gives the cells of each row.


def best_packets(sweep: str) -> Rows:
    for best in best_baselines(kept_of(sweep).processes):
        words = "more than noise" if best.is_faster else "no more than noise"
        margin = "too few processes" if best.margin is None else f"{best.margin}"
        yield f"`{best.scene}`", best.tried, best.name, margin, words


def best_gains(sweep: str) -> Rows:
    """The paper's gain, those of single rays under each reading of its baseline, and that of packets over packets."""

    def gain_and_split(gain: Any) -> str:
        return "none" if isinstance(gain, str) else f"{gain.estimate} ({gain.splits:,} {TIMES} 1)"

    for of_scene in scene_gains(kept_of(sweep).processes):
        packets = gain_and_split(next(iter(of_scene.packets.values()))) if of_scene.packets else "none"
        paper = "" if of_scene.paper is None else f"{of_scene.paper:.2f}"
        yield f"`{of_scene.scene.measured}`", paper, *map(gain_and_split, of_scene.single.values()), packets


_SUMMED = "^(pixels|images$|rays_|method_|baseline_wrong|sampled_)"


def images_judged(sweep: str) -> Rows:
    """A kind of image a row, then a scene: who is wrong how often, and the largest errors of depths."""

    def kind_of(row: Any) -> str:
        label = find_method(row["method"]).label
        if pd.isna(row["culling"]) or pd.isna(row["geometry"]):
            return f"{label} of {row['packet_width']}" if row["method"] == "pixel" else label
        if row["geometry"] == "instanced":
            return f"{label}, instanced"
        return f"{label}, culling {'on' if row['culling'] else 'off'}"

    points = kept_of(sweep).points
    pixels = points.filter(regex="^pixels_").sum(axis=1)
    points = points.assign(kind=[kind_of(row) for _, row in points.iterrows()], pixels=pixels)
    sums = dict.fromkeys(points.filter(regex=_SUMMED), "sum")
    largest = dict.fromkeys(("depth_error_max", "baseline_depth_error_max"), "max")
    for by in ("kind", "scene"):
        for label, row in points.groupby(by, sort=False).agg(sums | largest).iterrows():
            yield (
                label if by == "kind" else f"`{label}`", int(row["images"]), f"{row['pixels'] / 1e6:.1f} M",
                *(f"{int(row[name]):,}" for name in ("pixels_wrong", "pixels_tied", "pixels_edge")),
                f"{int(row['method_wrong']):,} : {int(row['baseline_wrong']):,}",
                f"{int(row['sampled_method_wrong'])} : {int(row['sampled_baseline_wrong'])}",
                f"{row['depth_error_max']:.1e}", f"{row['baseline_depth_error_max']:.1e}",
            )  # fmt: skip


FUNCTIONS: dict[str, Callable[[str], Rows]] = {
    made.__name__: made for made in (best_packets, best_gains, images_judged)
}
