"""A method that sees a wrong image is marked wherever its time could be read, and the command fails."""

import os
from dataclasses import replace

import pandas as pd
import pytest

from experiments.drawing.style import TIMES
from experiments.report.facts import compared_images, missing_points
from experiments.results.table import make_table
from experiments.workloads.frame_figures import methods_figure
from tests.command import run_here
from tests.drawn import make_rows, method_row, words
from tests.outside.test_misbehaving import GOOD
from tests.report_samples import small_table
from tests.results.test_table import MEASURED

METHOD = GOOD.replace("    def close", "        depth[WHERE] *= 2\n\n    def close")
SAME_AGAIN = GOOD.replace("self.inner.trace(offset)", "self.inner.trace()")
FILES = os.pathsep.join(["mistaken.py", "nearly.py"])
TOY = ("scene=cornell_box", "width=64", "height=64", "measure.rounds=3", "measure.warmup=1", "measure.processes=1")


@pytest.fixture
def files(tmp_path):
    """Two method files: in one all pixels are wrong, in the other one alone."""
    (tmp_path / "mistaken.py").write_text(METHOD.replace("WHERE", ":"), encoding="utf-8")
    (tmp_path / "nearly.py").write_text(METHOD.replace("WHERE", "32, 32"), encoding="utf-8")
    return tmp_path


def test_a_point_whose_image_is_wrong_says_so_and_ends_with_an_error(files):
    done = run_here(files, "method_file=mistaken.py", *TOY)
    assert done.returncode == 1
    assert "mistaken: wrong: 4,096 of 4,096 pixels wrong; " in done.stderr
    assert "the image is wrong: 4,096 of 4,096 pixels wrong" in done.stderr
    assert "4,096 of 4,096 pixels" in done.stdout


def test_a_method_that_returns_its_first_image_for_every_place_in_a_pixel_is_wrong(tmp_path):
    (tmp_path / "same_again.py").write_text(SAME_AGAIN, encoding="utf-8")
    done = run_here(tmp_path, "method_file=same_again.py", *TOY)
    assert done.returncode == 1
    assert "same_again: wrong: " in done.stderr


def test_a_few_wrong_pixels_are_told_and_are_no_failure(files):
    done = run_here(files, "method_file=nearly.py", *TOY)
    assert done.returncode == 0, done.stderr
    assert "pixels wrong            │ 1 " in done.stdout
    assert "wrong:" not in done.stderr


@pytest.mark.usefixtures("figures_unsaved")
def test_a_sweep_with_a_wrong_image_has_a_row_that_is_wrong_and_ends_with_an_error(files):
    done = run_here(files, "-m", f"method_file={FILES}", "method=mistaken,nearly", *TOY)
    (path,) = files.glob("results/*/table.parquet")
    table = pd.read_parquet(path).set_index("method")
    assert done.returncode == 1
    assert "processes that saw a wrong image: 1" in done.stderr
    assert "4,096 of 4,096 pixels wrong" in done.stdout
    assert table["status"].to_dict() == {"mistaken": "wrong", "nearly": "ok"}
    assert table["error"]["mistaken"] == "4,096 of 4,096 pixels wrong"


@pytest.mark.parametrize(("wrong", "status"), [(5, "ok"), (10_000, "ok"), (10_001, "wrong"), (1_000_000, "wrong")])
def test_more_than_a_hundredth_of_the_pixels_is_a_wrong_image(wrong, status):
    pixels = {"pixels_equal": 1_000_000 - wrong, "pixels_tied": 0, "pixels_edge": 0, "pixels_wrong": wrong}
    record = replace(MEASURED, results=MEASURED.results | pixels)
    row = make_table([record]).iloc[0]
    assert row["status"] == status
    assert row["render_time_s"] > 0


WRONG = {"status": "wrong", "error": "4,096 of 4,096 pixels wrong", "pixels_wrong": 4096}


def test_a_wrong_image_is_told_in_figures_and_no_bar():
    figure = methods_figure(make_rows(method_row("raster") | WRONG, method_row("aligned", 2)))
    (panel,) = figure.panels
    assert len([bar for bar in panel.bars if bar.value > 0]) == 1
    assert f"{TIMES} wrong image" in words(figure)


def test_the_page_lists_it_and_counts_its_pixels():
    table = small_table()
    before = compared_images(table)
    row = table.index[table["pixels_wrong"].notna() & table["status"].eq("ok")][0]
    was = int(table.loc[row, "pixels_wrong"])
    for name, value in WRONG.items():
        table.loc[row, name] = value
    assert compared_images(table).images == before.images
    assert compared_images(table).pixels_wrong == before.pixels_wrong - was + 4096
    assert "4,096 of 4,096 pixels wrong" in [one.reason for one in missing_points(table)]
