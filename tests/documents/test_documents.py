"""README and docs: numbers stand in the tables that are named, and every link leads somewhere."""

import re
import tomllib

import pytest
import yaml

from experiments.documents.filling import table_lines
from experiments.documents.writing import BLOCK, FUNCTIONS, TABLES, TEMPLATE, quotes, with_numbers
from tests.folders import ROOT

REFERENCE = ROOT / "reports" / "reference"
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted(REFERENCE.glob("*.md"))]
PAGES = ["README.md", *(path.relative_to(ROOT).as_posix() for path in DOCUMENTS if path.parent.name == "docs")]
MOST_WORDS = 12_000
MOST_QUOTED = 30
WITHOUT_NUMBERS = [page for page in PAGES if page != "docs/platforms.md"]
"""Pages that have no measured number but what they quote. Numbers in docs/platforms.md are versions."""

MEASURED = re.compile(r"\d[\d.,]*\s?(?:ms|[μ\u00b5]s|ns|KiB|MiB|GiB|%|times)(?!\w)")
NOT_MEASURED = {
    "README.md": {"21.6%"},  # what its example prints
    "docs/start.md": {"95 %", "35.1%"},  # what its example prints
    "docs/sweeps.md": {"95 %", "10 %", "5 %"},  # the canary's band; a busy core
    "docs/paper.md": {"95 %"},
    "docs/not_helpful.md": {"5 %"},  # the error that was asked for
    "docs/trust.md": {"95 %", "10 %", "128 MiB"},  # simulated by test_estimates; limits
}
"""Numbers with a unit that are settings, or that a test computes."""


def name_of(block):
    """The sweep whose table a block describes."""
    return re.search(r'^sweep = "(\w+)"', block)[1]


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def test_readme_and_documents_are_short_enough_to_be_read_and_quote_few_numbers():
    assert len(text_of("README.md").splitlines()) <= 120
    words = {page: len(text_of(page).split()) for page in PAGES}
    assert sum(words.values()) <= MOST_WORDS, words
    numbers = [number for _, _, of_quote in quotes() for number in of_quote.values()]
    assert sum(len(re.findall(r"\d[\d.,]*", number)) for number in numbers) <= MOST_QUOTED


@pytest.mark.parametrize("block", BLOCK.findall(TEMPLATE.read_text(encoding="utf-8")), ids=name_of)
def test_a_table_is_what_the_tables_command_writes(block):
    table = "\n".join(table_lines(tomllib.loads(block), FUNCTIONS))
    assert f"\n\n{table}\n" in text_of(TABLES), "run: python run.py tables"


def test_the_page_of_tables_is_the_template_with_a_table_in_each_place():
    places = BLOCK.sub("| a table\n", TEMPLATE.read_text(encoding="utf-8"))
    assert re.sub(r"(^\|.*\n)+", "| a table\n", text_of(TABLES), flags=re.M) == places


def test_quotes_are_what_the_tables_command_writes():
    for page, quote, numbers in quotes():
        text = text_of(page)
        assert with_numbers(text, quote, numbers) == text, "run: python run.py tables"


def test_every_table_that_is_kept_is_shown():
    kept = {path.parent.name for path in REFERENCE.glob("*/table.parquet")}
    assert kept == set(re.findall(r'^sweep = "(\w+)"$', TEMPLATE.read_text(encoding="utf-8"), re.M))


@pytest.mark.parametrize("page", WITHOUT_NUMBERS)
def test_a_page_has_no_measured_number_of_its_own(page):
    text = text_of(page)
    for _, quote, numbers in (found for found in quotes() if found[0] == page):
        text = re.sub(r"\s+".join(map(re.escape, quote.format(**numbers).split())), "", text)
    rows = [line for line in text.splitlines() if line.startswith("|")]
    assert [row for row in rows if re.search(r"\d\.\d", row)] == []
    words = " ".join(line for line in text.splitlines() if not line.startswith("|"))
    assert set(MEASURED.findall(words)) <= NOT_MEASURED.get(page, set())


def test_the_documents_name_every_sweep_and_no_other():
    there = {path.stem for path in (ROOT / "conf" / "sweep").glob("*.yaml")} - {"point"}
    text = "\n".join(document.read_text(encoding="utf-8") for document in DOCUMENTS)
    assert set(re.findall(r"sweep=(\w+)", text)) <= there
    listed, *_ = re.findall(r"\| sweep \|(.*?)\n\n", text_of("docs/sweeps.md"), re.S)
    first_cells = re.findall(r"^\| (`.*?) \|", listed, re.M)
    assert {name for cell in first_cells for name in re.findall(r"`(\w+)`", cell)} == there


def test_every_page_that_code_or_configuration_names_is_there():
    folders = ("atra", "conf", "examples", "experiments", "scenes", "tests", ".github")
    paths = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml"))
    named = {page for path in paths for page in re.findall(r"\bdocs/\w+\.md\b", path.read_text(encoding="utf-8"))}
    assert named
    assert [page for page in sorted(named) if not (ROOT / page).exists()] == []


ARCHITECTURE = text_of("docs/architecture.md")


def test_every_place_that_the_architecture_names_is_there():
    named = re.findall(r"`((?:atra|experiments|conf|scenes|tests|reports)/[\w/.]*)`", ARCHITECTURE)
    assert len(named) > 15
    assert [one for one in named if not (ROOT / one).exists()] == []


def test_the_architecture_draws_every_room_of_the_library_and_no_other():
    drawn = set(re.findall(r'\b\w+\["(\w+)', ARCHITECTURE))
    assert drawn == {path.parent.name for path in (ROOT / "atra").glob("*/__init__.py")}


def anchors(document):
    headings = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_link_and_picture_is_there_and_every_picture_is_shown():
    shown = set()
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        shown |= set(re.findall(r"images/([\w.]+)", text))
        for link in re.findall(r"\]\(((?!https?://)[^)\s]+)\)", text):
            name, _, anchor = link.partition("#")
            target = (document.parent / name).resolve() if name else document
            assert target.exists(), (document, link)
            assert not anchor or anchor in anchors(target), (document, link)
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} == shown


def test_the_workflow_runs_the_readme_s_two_commands_on_the_oldest_python_and_says_that_it_never_ran():
    text = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    job = yaml.safe_load(text)["jobs"]["test"]
    runs = [step["run"].replace("$BIN", ".venv/bin") for step in job["steps"] if "command" in step.get("name", "")]
    commands = re.findall(r"^python3 -m venv .*$", text_of("README.md"), re.M)
    assert [run.replace("python -m venv", "python3 -m venv") for run in runs] == commands
    assert len(commands) == 2
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == f">={job['strategy']['matrix']['python'][0]}"
    for told in (text, text_of("docs/platforms.md")):
        assert "has never been run" in " ".join(told.split())
