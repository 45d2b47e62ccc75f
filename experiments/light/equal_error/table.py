"""Measure the time to equal error of path tracers on scenes; writes a table and draws it.

    python -m experiments.studies equal_error reports/reference/equal_error threads=1

Needs the extra `peers` and LLVM's library (Debian: libllvm19; DRJIT_LIBLLVM_PATH names the file). Rows of the same
scene, threads and renderer are replaced.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from experiments.drawing.render import render
from experiments.harness.environment import read_environment
from experiments.light.equal_error.figure import errors_figure
from experiments.light.equal_error.measure import BEFORE, FAST, MITSUBA, measure
from scenes.lit.equal_error import SCENES

_KEY = ["scene", "threads", "renderer"]


def study(
    folder: str, *, scenes: Sequence[str] = tuple(SCENES), threads: int = 1,
    renderers: Sequence[str] = (FAST, BEFORE, *MITSUBA),
) -> None:  # fmt: skip
    """Measure these renderers beside ours, and write table and figure."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    path, machine = Path(folder, "table.parquet"), read_environment()
    same = {"processor": machine["cpu"], "cores": machine["logical_cores"], "commit": machine["git_commit"]}
    table = pd.read_parquet(path) if path.exists() else pd.DataFrame()
    for name in scenes:
        rows = [{**row, **same} for row in measure(name, threads, renderers)]
        table = pd.concat([table, pd.DataFrame(rows)]).drop_duplicates(_KEY, keep="last", ignore_index=True)
        table.to_parquet(path, index=False)
        print(pd.DataFrame(rows).round(4).drop(columns=list(same)).to_string(index=False), flush=True)
    Path(folder, "errors.png").write_bytes(render(errors_figure(table), "png"))
