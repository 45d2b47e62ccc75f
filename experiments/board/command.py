"""`atra board *.atra`: one page of several machines and methods, which needs no network."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from atra.errors import InputError
from atra.files.paths import write_atomically
from experiments.board.pack import Pack, read_pack
from experiments.commands.program import COMMAND, split_options

USAGE = f"{COMMAND} board one.atra other.atra [output=board.html]"


def run_board(arguments: Sequence[str]) -> Path:
    """Write the page and say where it is. Raises InputError for no file, and for one that is no packed sweep."""
    options, names = split_options(arguments, ("output",))
    if not names:
        raise InputError(f"expected: {USAGE}")
    path = Path(options.get("output", "board.html"))
    write_atomically(path, board_page([read_pack(Path(name)) for name in names]).encode())
    print(f"written: {path}")
    return path


def board_page(packs: Sequence[Pack]) -> str:
    """The page. The fastest of a scene come first; a method that was not measured comes last, with the reason."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    environment.filters |= {"milliseconds": _milliseconds, "ratio": _ratio, "grouped": _grouped, "known": _known}
    lines = [(pack, row) for pack in packs for row in pack.rows]
    lines.sort(key=lambda line: (line[1].scene, line[1].rays, line[1].size, -(line[1].ratio or 0.0)))
    machines = list(dict.fromkeys(pack.machine_name for pack in packs))
    return environment.get_template("page.html").render(
        packs=packs, lines=lines, machines=machines, scenes=sorted({row.scene for _, row in lines}),
        rays=sorted({row.rays for _, row in lines}), methods=sorted({row.method for _, row in lines}),
        most=max((row.ratio or 0.0 for _, row in lines), default=1.0) or 1.0,
    )  # fmt: skip


def _known(value: float | None) -> str:
    return "" if value is None else repr(value)


def _grouped(value: int | None) -> str:
    return "" if value is None else f"{value:,}"


def _milliseconds(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds * 1e3:,.3g}" if seconds < 1.0 else f"{seconds * 1e3:,.0f}"


def _ratio(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}" if value >= 0.095 else f"{value:.3f}"
