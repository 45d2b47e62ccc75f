"""Makes the board of the stored tables again: `python -m experiments.board`."""

from __future__ import annotations

import tempfile
from pathlib import Path

from atra.files.paths import write_atomically
from experiments.board.command import board_page
from experiments.board.pack import packed, read_pack

REPORTS = Path(__file__).resolve().parents[2] / "reports"

STORED = ("methods", "peers", "classification")
"""Tables below reports/reference that time rays beside packets, each of one machine."""


def stored_board() -> str:
    """The page of these tables."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder, f"{name}.atra") for name in STORED]
        for path in paths:
            path.write_bytes(packed(REPORTS / "reference" / path.stem))
        return board_page([read_pack(path) for path in paths])


if __name__ == "__main__":
    write_atomically(REPORTS / "board.html", stored_board().encode())
