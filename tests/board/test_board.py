"""A sweep in one file, read back by strangers, and the page of several."""

import io
import json
import zipfile
from dataclasses import replace
from hashlib import sha256

import pytest

from atra.errors import InputError
from experiments.board.command import board_page, run_board
from experiments.board.pack import UNKNOWN, Pack, packed, read_pack, run_pack
from experiments.board.rows import BoardRow, board_rows
from experiments.commands.new_method import run_new_method
from experiments.documents.filling import digits
from experiments.drawing.style import TIMES
from experiments.results.intervals import with_intervals
from experiments.results.table import read_table
from tests.drawn import make_rows, method_row
from tests.folders import ROOT

pytestmark = pytest.mark.uncovered

METHODS = ROOT / "reports" / "reference" / "methods"

ROW = BoardRow("box", 12, "primary", f"8 {TIMES} 8", 1, "rasteriser", "rasteriser", True, 2.0, 1.9, 2.1, 0.001, 0.002,
               0, None, "ok", None)  # fmt: skip


@pytest.fixture(scope="module")
def content():
    """The stored sweep, packed."""
    return packed(METHODS)


def rewritten(content, **members):
    """The same archive with other members."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, members.get(name.partition(".")[0], old.read(name)))
    return buffer.getvalue()


def page_of(*rows, **machine):
    return board_page([Pack("toys", machine or {"cpu": "a cpu"}, ("then", "now"), rows, "abcd")])


def test_a_sweep_is_packed_into_the_same_bytes_and_read_back(tmp_path, content):
    path = tmp_path / "methods.atra"
    run_pack([str(METHODS), f"output={path}"])
    assert path.read_bytes() == content
    pack = read_pack(path)
    tables = [read_table(METHODS / f"{name}.parquet") for name in ("table", "processes")]
    assert (pack.name, pack.machine_name) == ("methods", tables[0]["cpu"].iloc[0])
    assert list(pack.rows) == board_rows(with_intervals(*tables))
    with zipfile.ZipFile(path) as archive:
        assert archive.read("table.parquet") == (METHODS / "table.parquet").read_bytes()


@pytest.mark.usefixtures("methods_as_before")
def test_a_sweep_of_a_method_of_ones_own_is_packed_with_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_new_method(["own"])
    table = make_rows(method_row("embreex"), method_row("aligned", 2)).replace({"method": {"embreex": "own"}})
    table.to_parquet(tmp_path / "table.parquet", index=False)
    with pytest.raises(InputError, match=r"unknown method 'own'.* give its method_file="):
        run_pack([str(tmp_path), "output=own.atra"])
    run_pack([str(tmp_path), "output=own.atra", "method_file=own.py"])
    assert [(row.name, row.is_ours) for row in read_pack(tmp_path / "own.atra").rows if "own" in row.name] == [
        ("own", False)
    ]


def test_a_machine_that_held_nothing_back_is_called_by_its_processor_alone():
    assert Pack("toys", {"cpu": "a cpu", "instruction_set": UNKNOWN}, ("", ""), (), "abcd").machine_name == "a cpu"
    assert Pack("toys", {"cpu": "a cpu", "instruction_set": "avx2"}, ("", ""), (), "").machine_name == "a cpu, avx2"


def test_the_ratio_is_over_the_widest_packets_and_the_best_split_is_shown():
    pixel = method_row("pixel")
    rows = board_rows(make_rows(
        pixel | {"packets_render_time_s": 0.01, "packets_8_render_time_s": 0.01, "packets_16_render_time_s": 0.03},
        method_row("aligned", 8, ratio=1.5), method_row("aligned", 16, ratio=2.5),
    ))  # fmt: skip
    (packets,) = [row for row in rows if row.method == "one ray per pixel"]
    assert (packets.ratio, packets.low, packets.high) == pytest.approx((6.0, 5.25, 6.75))  # 2.0 [1.75, 2.25] by 3
    (aligned,) = [row for row in rows if row.method == "aligned"]
    assert f"16 {TIMES}" in aligned.name


def test_the_best_split_is_chosen_by_one_half_of_the_processes_and_reported_by_the_other():
    rest = {f"speedup_vs_packets_rest{end}": value for end, value in (("", 1.2), ("_low", 1.1), ("_high", 1.3))}
    (row,) = board_rows(make_rows(
        method_row("aligned", 8, ratio=2.5, speedup_vs_packets_half=1.5),
        method_row("aligned", 16, ratio=1.5, speedup_vs_packets_half=2.5) | rest,
    ))  # fmt: skip
    assert f"16 {TIMES}" in row.name
    assert (row.ratio, row.low, row.high) == (1.2, 1.1, 1.3)


def test_the_stored_board_has_the_ratios_of_the_tables(tmp_path, content):
    path = tmp_path / "methods.atra"
    path.write_bytes(content)
    rows = [row for row in read_pack(path).rows if row.rays == "primary"]
    shown = {f"{digits(row.ratio)} [{digits(row.low)}, {digits(row.high)}]" for row in rows if row.ratio}
    page = (ROOT / "reports" / "reference" / "tables.md").read_text(encoding="utf-8")
    lines = page.partition("## Methods")[2].partition("pays from frame")[0].splitlines()
    cells = [line.split(" | ") for line in lines if line.startswith("| `")]
    ours = {cell.strip(" |") for line in cells for cell in line if "." in cell and "[" in cell}
    assert len(ours) == 12
    assert ours <= shown


def test_a_method_that_failed_is_a_row_with_its_reason():
    (row,) = board_rows(make_rows(method_row("aligned", status="failed", error="it crashed <b>")))
    assert (row.status, row.ratio) == ("failed", None)
    assert "failed: it crashed &lt;b&gt;" in page_of(row)


def test_nothing_in_a_strangers_file_reaches_the_page_as_markup():
    evil = '"><script>alert(1)</script>'
    page = page_of(replace(ROW, scene=evil, name=evil, warnings=evil), cpu=evil)
    assert "<script>alert" not in page
    assert page.count("<script>") == 1


@pytest.mark.parametrize(("member", "damaged", "reason"), [
    ("rows", b"[]", "does not have its digest"),
    ("atra", b"{}", "its format is not 1"),
    ("atra", b"not json", "cannot be read"),
    ("atra", b" " * (2 << 20), "larger than 1,048,576 bytes"),
])  # fmt: skip
def test_a_damaged_file_is_refused(tmp_path, content, member, damaged, reason):
    path = tmp_path / "methods.atra"
    path.write_bytes(rewritten(content, **{member: damaged}))
    with pytest.raises(InputError, match=reason):
        read_pack(path)


@pytest.mark.parametrize("change", [{"ratio": "2"}, {"wrong": True}, {"more": 1}, {"scene": None}, {"frame_s": 1e999}])
def test_rows_of_other_fields_and_types_are_refused(tmp_path, content, change):
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        rows, about = json.loads(archive.read("rows.json")), json.loads(archive.read("atra.json"))
    told = json.dumps([rows[0] | change]).encode()
    about["sha256"]["rows.json"] = sha256(told).hexdigest()
    path = tmp_path / "methods.atra"
    path.write_bytes(rewritten(content, rows=told, atra=json.dumps(about).encode()))
    with pytest.raises(InputError, match="row"):
        read_pack(path)


def test_what_is_no_archive_is_refused(tmp_path):
    (tmp_path / "x.atra").write_bytes(b"PK no")
    with pytest.raises(InputError, match="cannot be read as a packed sweep"):
        run_board([str(tmp_path / "x.atra")])
    with pytest.raises(InputError, match="holds no table"):
        run_pack([str(tmp_path)])


STORED = ("methods", "peers", "classification")
"""Tables below reports/reference that time rays beside packets, each of one machine."""


def test_the_stored_board_is_what_the_stored_tables_make(tmp_path):
    paths = [tmp_path / f"{name}.atra" for name in STORED]
    for path in paths:
        path.write_bytes(packed(ROOT / "reports" / "reference" / path.stem))
    page = board_page([read_pack(path) for path in paths])
    stored = (ROOT / "reports" / "board.html").read_text(encoding="utf-8")
    assert stored == page, "run: python run.py pack reports/reference/..., then python run.py board ..."
    assert all(f"<h3>{name}</h3>" in page for name in STORED)
    assert "http" not in page.replace("http-equiv", "")
