"""`atra pack results/methods`: one file of a sweep, with its table, its machine, and digests of all in it.

The file is a zip archive: `atra.json` says what it holds, `rows.json` what a board shows, and the tables are those of
the sweep's folder. Packing the same folder again gives the same bytes.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import pandas as pd

import atra
from atra.errors import InputError, RecordError, printable
from atra.files.paths import write_atomically
from experiments.board.rows import BoardRow, board_rows, plain_rows, read_row
from experiments.commands.program import COMMAND, split_options
from experiments.drawing.values import column
from experiments.harness.environment import STABLE_FIELDS
from experiments.harness.records import load_record
from experiments.methods import use_method_file
from experiments.results.intervals import with_intervals
from experiments.results.table import read_table

FORMAT = 1
"""Version of the file's layout."""

_ABOUT, _ROWS = "atra.json", "rows.json"
_TABLES = ("table.parquet", "processes.parquet")
_LARGEST_BYTES = {_ABOUT: 1 << 20, _ROWS: 1 << 25, **dict.fromkeys(_TABLES, 1 << 28)}
"""What a member may unpack to."""

UNKNOWN = "unknown"
"""What a field of the machine is that has no value; of the instruction set: all that the machine has were used."""

_DATE = (1980, 1, 1, 0, 0, 0)
USAGE = f"{COMMAND} pack results/methods [output=methods.atra] [method_file=mine.py]"


@dataclass(frozen=True)
class Pack:
    """A packed sweep. name: of the sweep. machine: its stable fields by name. measured_at: when, first and last.
    digest: of what the file says of itself, digests of its members included."""

    name: str
    machine: Mapping[str, Any]
    measured_at: tuple[str, str]
    rows: tuple[BoardRow, ...]
    digest: str

    @property
    def machine_name(self) -> str:
        """Processor and instruction set."""
        told = [str(self.machine.get("cpu") or "unknown processor")]
        chosen = self.machine.get("instruction_set")
        return ", ".join([*told, *([str(chosen)] if chosen and chosen != UNKNOWN else [])])


def run_pack(arguments: Sequence[str]) -> Path:
    """Write the file and say where it is. Raises InputError for a folder without a sweep's table, and for a table with
    a method of a file that is not given."""
    options, folders = split_options(arguments, ("output", "method_file"))
    if len(folders) != 1:
        raise InputError(f"expected: {USAGE}")
    for file in filter(None, options.get("method_file", "").split(os.pathsep)):
        use_method_file(file)
    folder = Path(folders[0])
    path = Path(options.get("output", f"{folder.resolve().name}.atra"))
    write_atomically(path, packed(folder))
    print(f"written: {path}, {path.stat().st_size:,} bytes")
    print(f"next: {COMMAND} board {path}")
    return path


def packed(folder: Path) -> bytes:
    """The content of the file for a sweep's folder. Raises InputError where that has no table."""
    table = read_table(folder / "table.parquet")
    if table is None:
        raise InputError(f"{folder} holds no table.parquet; expected: {USAGE}")
    processes = read_table(folder / "processes.parquet")
    whole = table if processes is None else with_intervals(table, processes)
    members = {_ROWS: json.dumps(plain_rows(board_rows(whole)), allow_nan=False).encode()}
    members |= {name: (folder / name).read_bytes() for name in _TABLES if (folder / name).exists()}
    times = column(table, "measured_at").dropna()
    about = {
        "format": FORMAT,
        "atra_version": atra.__version__,
        "name": folder.resolve().name,
        "machine": _machine(folder, table),
        "measured_at": [min(times, default=""), max(times, default="")],
        "sha256": {name: sha256(content).hexdigest() for name, content in members.items()},
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in {_ABOUT: json.dumps(about, indent=1).encode(), **members}.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _machine(folder: Path, table: pd.DataFrame) -> dict[str, Any]:
    """Stable fields of the machine from a record of the sweep; where the records are gone, what the table tells."""
    for name in table["point_id"].dropna():
        try:
            record = load_record(folder.resolve().parent / "records", str(name))
        except RecordError:
            continue
        if record is not None:
            return {field: record.environment.get(field) for field in STABLE_FIELDS}
    return {"cpu": next(iter(column(table, "cpu").dropna()), None)}


def read_pack(path: Path) -> Pack:
    """A packed sweep, perhaps a stranger's: bounded, and nothing in it is run. Raises InputError for a file that is
    none, is damaged or is of another version."""
    try:
        content = path.read_bytes()
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            text = _member(archive, _ABOUT)
            about = json.loads(text)
            if not isinstance(about, dict) or about.get("format") != FORMAT:
                raise InputError(f"its format is not {FORMAT}")
            told = _member(archive, _ROWS)
            if about["sha256"][_ROWS] != sha256(told).hexdigest():
                raise InputError(f"{_ROWS} does not have its digest")
            rows = tuple(read_row(row) for row in json.loads(told))
        machine = {printable(str(name))[:100]: _short(value) for name, value in dict(about["machine"]).items()}
        first, last = (printable(str(time))[:40] for time in about["measured_at"])
        name = printable(str(about["name"]))[:100]
    except (OSError, ValueError, KeyError, TypeError, RecursionError, zipfile.BadZipFile, NotImplementedError) as error:
        raise InputError(f"{path} cannot be read as a packed sweep: {error}") from None
    return Pack(name, machine, (first, last), rows, sha256(text).hexdigest()[:16])


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    with archive.open(name) as file:
        content = file.read(_LARGEST_BYTES[name] + 1)
    if len(content) > _LARGEST_BYTES[name]:
        raise InputError(f"{name} is larger than {_LARGEST_BYTES[name]:,} bytes")
    return content


def _short(value: Any) -> str:
    told = ", ".join(map(str, value)) if isinstance(value, list) else UNKNOWN if value is None else str(value)
    return printable(told)[:300]
