"""README and docs: the example runs as printed, and every link leads somewhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

from tests.meshes import cornell_box

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "reports" / "reference" / "README.md"]


def test_the_library_example_runs_as_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (example,) = re.findall(r"```python\n(import atra\n.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)
    mesh = cornell_box()
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices.tolist()]
    lines += ["f " + " ".join(str(corner + 1) for corner in face) for face in mesh.faces.tolist()]
    (tmp_path / "model.obj").write_text("\n".join(lines))
    monkeypatch.chdir(tmp_path)
    assert "width=1024, height=1024" in example
    smaller = example.replace("width=1024, height=1024", "width=256, height=32").replace("model.ply", "model.obj")
    exec(compile(smaller, "README.md", "exec"), {})
    assert re.fullmatch(r"\d+ of 8192 pixels equal, \d+ tied, \d+ edge, 0 wrong\n", capsys.readouterr().out)


def anchors(document: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", document.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_link_and_picture_is_there(document: Path) -> None:
    links = re.findall(r"\]\(([^)\s]+)\)", document.read_text(encoding="utf-8"))
    for link in links:
        if link.startswith(("http://", "https://")):
            continue
        name, _, anchor = link.partition("#")
        target = (document.parent / name).resolve() if name else document
        assert target.exists(), link
        if anchor:
            assert anchor in anchors(target), link


def test_every_picture_of_the_documents_is_shown_somewhere() -> None:
    shown = {
        link for document in DOCUMENTS for link in re.findall(r"images/([\w.]+)", document.read_text(encoding="utf-8"))
    }
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} == shown


def test_the_workflow_runs_the_readme_s_two_commands_on_the_oldest_python_and_says_that_it_never_ran() -> None:
    text = (ROOT / ".github" / "workflows" / "test.yml").read_text(encoding="utf-8")
    job = yaml.safe_load(text)["jobs"]["test"]
    runs = [step["run"].replace("$BIN", ".venv/bin") for step in job["steps"] if "command" in step.get("name", "")]
    commands = re.findall(r"^python3 -m venv .*$", (ROOT / "README.md").read_text(encoding="utf-8"), re.M)
    assert [run.replace("python -m venv", "python3 -m venv") for run in runs] == commands
    assert len(commands) == 2
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["requires-python"] == f">={job['strategy']['matrix']['python'][0]}"
    for told in (text, (ROOT / "docs" / "platforms.md").read_text(encoding="utf-8")):
        assert "has never been run" in " ".join(told.split())
