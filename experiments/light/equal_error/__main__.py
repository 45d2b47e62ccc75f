"""Measure the time to equal error of path tracers on scenes; writes a table and draws it.

    python -m experiments.light.equal_error reports/reference/equal_error --threads 1

Needs the extra `peers` and LLVM's library (Debian: libllvm19; DRJIT_LIBLLVM_PATH names the file). Rows of the same
scene, threads and renderer are replaced.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd

from experiments.drawing.render import render
from experiments.harness.environment import read_environment
from experiments.light.equal_error.figure import errors_figure
from experiments.light.equal_error.measure import BEFORE, FAST, MITSUBA, measure
from scenes.lit.equal_error import SCENES

_KEY = ["scene", "threads", "renderer"]


def main() -> None:
    """Measure what the arguments say, and write table and figure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scene", action="append", choices=list(SCENES))
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--renderer", action="append", choices=[FAST, BEFORE, *MITSUBA])
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    path, machine = given.folder / "table.parquet", read_environment()
    same = {"processor": machine.cpu, "cores": machine.logical_cores, "commit": machine.git_commit}
    table = pd.read_parquet(path) if path.exists() else pd.DataFrame()
    for name in given.scene or SCENES:
        rows = [{**row, **same} for row in measure(name, given.threads, given.renderer or [FAST, BEFORE, *MITSUBA])]
        table = pd.concat([table, pd.DataFrame(rows)]).drop_duplicates(_KEY, keep="last", ignore_index=True)
        table.to_parquet(path, index=False)
        print(pd.DataFrame(rows).round(4).drop(columns=list(same)).to_string(index=False), flush=True)
    (given.folder / "errors.png").write_bytes(render(errors_figure(table), "png"))


if __name__ == "__main__":
    main()
