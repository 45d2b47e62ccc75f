"""`python run.py tables`: tables and quotes are written from stored points, and a check says what differs."""

import tomllib
from hashlib import sha256

import pandas as pd
import pytest

from atra.errors import InputError
from experiments.documents import filling, writing
from experiments.documents.filling import REFERENCE, Kept, cell_text, table_lines

POINTS = pd.DataFrame([
    {"point_id": f"{scene} {way}", "status": "ok", "scene": scene, "way": way, "gain": gain, "gain_low": gain / 2,
     "gain_high": 2 * gain}
    for scene, way, gain in (("box", "old", 1.0), ("box", "new", 4.0), ("hall", "old", 2.0))
])  # fmt: skip
PROCESSES = pd.DataFrame([
    row | {"gain": row["gain"] * by, "measured_at": f"2000-01-01T{time}+00:00"}
    for row in POINTS.to_dict("records")
    for by, time in ((0.5, "09:00"), (1.0, "10:00"), (2.0, "11:30"))
])  # fmt: skip
GAIN = {"sweep": "toys", "cell": "{gain}"}
TEMPLATE = """text

```toml
sweep = "toys"
corner = "scene"
each = ["scene"]
label = "`{scene}`"
columns = [
  {head = "old", where = {way = "old"}, cell = "{gain:interval}"},
  {head = "new", where = {way = "new"}, cell = "{gain / 2:.1f} times", empty = "not measured"},
]
```
"""
FILLED = """text

| scene | old | new |
|---|---:|---:|
| `box` | 1.00 [0.50, 2.00] | 2.0 times |
| `hall` | 2.00 [1.00, 4.00] | not measured |
"""
OF_OLDER_CODE = {
    REFERENCE / tomllib.loads(block)["sweep"]
    for block in writing.BLOCK.findall(writing.TEMPLATE.read_text(encoding="utf-8"))
    if "kept" in tomllib.loads(block)
}
QUOTES = """
[numbers]
gain = {sweep = "toys", cell = "{gain}"}

[[quotes]]
page = "page.md"
text = "It is {gain} times as fast"
where = {scene = "hall"}
"""


@pytest.fixture(autouse=True)
def toys(monkeypatch):
    kept = Kept(POINTS, PROCESSES)
    monkeypatch.setattr(filling, "kept_of", {"toys": kept}.__getitem__)


@pytest.mark.parametrize(("spec", "text"), [
    ({"where": {"scene": "hall"}}, "2.00"),
    ({"where": {"scene": "hall"}, "cell": "{gain:,.0f} of {scene}"}, "2 of hall"),
    ({"pick": "sum"}, "7.00"),
    ({"pick": "max", "where": {"scene": "box"}}, "4.00"),
    ({"pick": "lowest gain"}, "1.00"),
    ({"pick": "all", "cell": "{gain:span}, {gain:list}"}, "1.00 to 4.00, 1.00, 4.00, 2.00"),
    ({"where": {"point_id": "box new"}, "over": {"point_id": "box old"}, "cell": "{gain:quotient}"}, "4.00"),
    ({"where": {"point_id": "box new"}, "over": {"point_id": "box new"}, "cell": "{gain:ratio}"}, "1"),
    ({"pick": "all", "cell": "{measured_at:hours}"}, "2.5"),
])  # fmt: skip
def test_a_cell_says_what_its_points_have(spec, text):
    assert cell_text({**GAIN, **spec}) == text


def test_a_ratio_is_of_two_points_and_under_turns_it_round():
    spec = {**GAIN, "where": {"point_id": "box new"}, "over": {"point_id": "hall old"}}
    assert cell_text({**spec, "cell": "{gain:ratio}"}).startswith("2.00 [")
    assert cell_text({**spec, "cell": "{gain:under}"}).startswith("0.50 [")


def test_no_point_or_several_are_refused_with_what_was_asked():
    with pytest.raises(ValueError, match=r"toys has no point with \{'scene': 'attic'\}"):
        cell_text({**GAIN, "where": {"scene": "attic"}})
    with pytest.raises(ValueError, match=r"toys has 2 points with \{'scene': 'box'\}, expected one"):
        cell_text({**GAIN, "where": {"scene": "box"}})


@pytest.mark.parametrize("told", [{"wehre": {}}, {"columns": [{"head": "a", "cel": "b"}]}])
def test_a_key_that_nothing_reads_is_refused_by_name(told):
    with pytest.raises(ValueError, match=r"has \['(wehre|cel)'\], expected some of "):
        table_lines({"sweep": "toys", **told}, {})
    with pytest.raises(ValueError, match="rows of another length"):
        table_lines({"sweep": "toys", "function": "made", "head": ["a", "b"]}, {"made": lambda sweep: [["1"]]})


def test_rows_of_older_code_are_of_tables_that_are_as_they_were():
    """If a table is measured again, its rows are made again, by the commit that reports/reference/README.md names, and
    its SHA-256 goes into kept.sha256."""
    kept = [line.split() for line in (REFERENCE / "kept.sha256").read_text(encoding="utf-8").splitlines()]
    assert {digest: sha256((REFERENCE / place).read_bytes()).hexdigest() for digest, place in kept} == {
        digest: digest for digest, _ in kept
    }
    tables = {path.relative_to(REFERENCE).as_posix() for sweep in OF_OLDER_CODE for path in sweep.glob("*.parquet")}
    assert tables == {place for _, place in kept}


@pytest.fixture
def page(tmp_path, monkeypatch):
    files = {"template.md": TEMPLATE, "quotes.toml": QUOTES, "page.md": "It is\n1.00 times as\nfast.\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    places = {"ROOT": tmp_path, "TABLES": "tables.md", "TEMPLATE": tmp_path / "template.md"}
    for name, place in (places | {"QUOTES": tmp_path / "quotes.toml", "folders": list}).items():
        monkeypatch.setattr(writing, name, place)
    return tmp_path / "page.md"


def test_tables_are_written_whole_and_quotes_where_they_stand(page, capsys):
    writing.run_tables([])
    assert page.read_text(encoding="utf-8") == "It is\n2.00 times as\nfast.\n"
    assert (page.parent / "tables.md").read_text(encoding="utf-8") == FILLED
    assert capsys.readouterr().out.splitlines() == [
        "tables.md: other numbers or verdicts",
        "page.md: other numbers or verdicts",
    ]
    writing.run_tables(["check=true"])
    assert "every number" in capsys.readouterr().out


def test_a_check_writes_nothing_and_fails_where_a_number_differs(page):
    with pytest.raises(InputError, match=r"2 files differ from the stored tables; run: python run.py tables"):
        writing.run_tables(["check=true"])
    assert page.read_text(encoding="utf-8").startswith("It is\n1.00")
    assert not (page.parent / "tables.md").exists()


def test_a_quote_that_its_page_does_not_have_and_another_argument_are_refused(page):
    page.write_text("It is slower.\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"page.md: 0 times says 'It is \{gain\} times as fast', expected once"):
        writing.run_tables([])
    with pytest.raises(InputError, match="tables takes check=true alone, not check; usage"):
        writing.run_tables(["check"])
