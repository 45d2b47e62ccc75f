"""Rows that a function measures in fresh processes, and tables that such rows are added to."""

from __future__ import annotations

import inspect
import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pandas as pd

from experiments.harness.environment import read_environment

HERE = Path(__file__).resolve().parents[2]
"""The folder of this version."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Turn:
    """What one process is given: arguments of the function, columns that its rows have in common, the interpreter, the
    folder whose packages it imports (None = those that are installed), and variables of its environment."""

    arguments: Mapping[str, Any] = field(default_factory=dict)
    columns: Mapping[str, Any] = field(default_factory=dict)
    python: str = sys.executable
    folder: Path | None = HERE
    environment: Mapping[str, str] = field(default_factory=dict)


def in_processes(function: Callable[..., Sequence[Row]], n: int, *turns: Turn) -> pd.DataFrame:
    """The rows that a function returns, in `n` processes for each turn; the turns change their order every time.

    function: its text is run by the interpreter of a turn, which may have another version of this project, so it
    imports all that it uses itself. Its rows hold what JSON holds.
    Raises RuntimeError with the end of what a process says that fails.
    """
    machine, rows = read_environment(), list[Row]()
    same = {"processor": machine["cpu"], "cores": machine["logical_cores"], "commit": machine["git_commit"]}
    for process in range(n):
        for turn in turns[:: -1 if process % 2 else 1] or (Turn(),):
            told = _told(function, turn)
            rows += [{"process": process, **same, **turn.columns, **row} for row in told]
    return pd.DataFrame(rows)


def _told(function: Callable[..., Sequence[Row]], turn: Turn) -> list[Row]:
    call = f"print(json.dumps({function.__name__}(**json.loads(sys.argv[1]))))"
    text = (
        f"from __future__ import annotations\nimport json, sys\n{textwrap.dedent(inspect.getsource(function))}\n{call}"
    )
    path = {} if turn.folder is None else {"PYTHONPATH": str(turn.folder.resolve())}
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [turn.python, "-c", text, json.dumps(turn.arguments)], cwd=folder, capture_output=True, text=True,
            env={**os.environ, **path, "ATRA_QUIET": "1", **turn.environment},
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{function.__name__} failed in {turn.folder or turn.python}: {done.stderr[-2000:]}")
    return list(json.loads(done.stdout.splitlines()[-1]))


def add_rows(path: Path, rows: pd.DataFrame) -> pd.DataFrame:
    """Add rows to a table, .csv or .parquet, which is made if it is missing; returns all of it."""
    read, is_text = (pd.read_csv, True) if path.suffix == ".csv" else (pd.read_parquet, False)
    table = pd.concat([read(path), rows], ignore_index=True) if path.exists() else rows
    path.parent.mkdir(parents=True, exist_ok=True)
    if is_text:
        table.to_csv(path, index=False, lineterminator="\n")
    else:
        table.to_parquet(path, index=False)
    return table
