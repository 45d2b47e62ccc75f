"""This version against another, measured in turns."""

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from experiments.studies.paired import ratios

CLONE = Path(__file__).resolve().parents[2]


def _rows(other_ms, this_ms, digests=("a", "a")):
    same = {"instruction_set": "native", "threads": 1, "what": "image", "scene": "box"}
    return pd.DataFrame([
        {**same, "version": version, "process": process, "median_ms": ms, "least_ms": 0.5 * ms, "digest": digest}
        for version, times, digest in (("other", other_ms, digests[0]), ("this", this_ms, digests[1]))
        for process, ms in enumerate(times)
    ])  # fmt: skip


def test_a_ratio_is_the_mean_of_the_ratios_of_processes_that_took_turns():
    # The machine was twice as slow in the second turn, for both.
    found = ratios(_rows([2.0, 4.0, 2.0], [1.0, 2.0, 1.0]))
    assert found["ratio"].tolist() == ["2.000 [2.000, 2.000]"]
    assert found["ratio_of_least"].tolist() == [2.0]


def test_an_interval_comes_from_the_spread_of_the_processes():
    # Logarithms -1, 0, 1 in units of log 2: standard error 1 / sqrt(3), Student's 4.303 with two degrees of freedom.
    found = ratios(_rows([0.5, 1.0, 2.0], [1.0, 1.0, 1.0]))["ratio"].item()
    half = 2 ** (4.302653 / 3**0.5)
    assert found == f"1.000 [{1 / half:.3f}, {half:.3f}]"


def test_different_images_are_said():
    assert ratios(_rows([1.0] * 3, [1.0] * 3, ("a", "b")))["same"].tolist() == ["no"]
    assert ratios(_rows([1.0] * 3, [1.0] * 3))["same"].tolist() == ["yes"]


def test_a_version_without_its_rival_has_no_ratio():
    rows = _rows([1.0] * 3, [1.0] * 3)
    assert ratios(rows[rows["version"] == "this"]).empty


@pytest.mark.slow
def test_a_clone_beside_itself_draws_the_same_images(tmp_path):
    other = tmp_path / "other"
    (other / ".venv" / "bin").mkdir(parents=True)
    (other / ".venv" / "bin" / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (other / ".venv" / "bin" / "python").chmod(0o755)
    (other / "atra").symlink_to(CLONE / "atra")
    table = tmp_path / "table.parquet"
    command = [sys.executable, "-m", "experiments.studies", "paired", str(other), str(table), "processes=3"]
    chosen = ["scenes=cornell_box,", "source=procedural", "asked=image,packets", "size=64", "count=2"]
    told = subprocess.run([*command, *chosen], cwd=CLONE, capture_output=True, text=True, check=True)
    rows = pd.read_parquet(table)
    assert len(rows) == 2 * 2 * 3
    assert set(rows["what"]) == {"image", "packets"}
    assert rows.groupby("what")["digest"].nunique().tolist() == [1, 1]
    assert told.stdout.count("yes") == 2
