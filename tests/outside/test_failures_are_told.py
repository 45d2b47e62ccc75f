"""What a method from outside prints and raises reaches its author, and a wrong image is marked everywhere."""

import os
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import atra
import tests.command
from atra.errors import InputError
from experiments.drawing.style import TIMES
from experiments.harness.processes.launching import run_worker
from experiments.methods.outside.guarded import Guarded
from experiments.report.facts import compared_images, missing_points
from experiments.results.table import make_table
from experiments.workloads.frame_figures import methods_figure
from experiments.workloads.rounds import warm_up
from tests.command import run_here
from tests.drawn import make_rows, method_row, words
from tests.outside.test_misbehaving import GOOD
from tests.points import planned
from tests.report_samples import small_table
from tests.results.test_table import MEASURED

TOY = ("scene=cornell_box", "width=16", "height=16", "measure.rounds=3", "measure.warmup=1", "measure.processes=1")

FAILS = """
import atra
class Mine(atra.Method):
    def prepare(self, mesh, camera, pool):
        print(f"building {mesh.triangle_count} triangles")
        return Prepared()

class Prepared(atra.Prepared):
    def draw(self, offset, depth, prim_id):
        self.helper(0)

    def helper(self, divisor):
        return WHAT
"""
RAISES = FAILS.replace("WHAT", "1 / divisor")
REFUSED = FAILS.replace("WHAT", "'no image at all'")


def test_other_peoples_methods_warm_up_with_no_triangle_that_the_eye_sees_edge_on_and_none_twice():
    meshes = []

    class Nothing(atra.Prepared):
        pass

    class Careful(atra.Method):
        def prepare(self, mesh, camera, pool):
            meshes.append((mesh, camera))
            return Nothing()

    def make(point, mesh, view):
        return atra.Tracer(mesh, view, Guarded(Careful()), threads=1)

    warm_up(planned("program", "frame").point, [make], use=lambda tracer: None)
    ((mesh, camera),) = meshes
    a, b, c = mesh.vertices.astype(np.float64)[mesh.faces].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    assert np.abs(((np.array(camera.eye) - a) * normals).sum(-1)).min() > 0.1
    assert np.linalg.norm(normals, axis=-1).min() > 0.1
    assert len({tuple(sorted(face)) for face in mesh.faces.tolist()}) == mesh.triangle_count


def test_what_fails_in_the_warm_up_names_mesh_and_camera():
    point = planned("program", "frame").point

    def refuse(point, mesh, view):
        raise InputError("no")

    with pytest.raises(InputError) as caught:
        warm_up(point, [refuse])
    (note,) = caught.value.__notes__
    assert "while warming up" in note
    assert "faces [[0, 1, 2], [3, 2, 1]]" in note
    assert "Camera(eye=(0.0, 0.0, 2.0)" in note
    with pytest.raises(InputError) as of_ours:
        warm_up(planned("pixel", "frame").point, [refuse])
    assert not hasattr(of_ours.value, "__notes__")


@pytest.mark.parametrize(("text", "told", "code"), [
    (RAISES, "ZeroDivisionError: division by zero; while warming up", 1),
    (REFUSED, "draw left a depth of NaN at pixel (0, 0), expected inf for a miss; while warming up", 2),
])  # fmt: skip
def test_a_single_point_shows_what_the_method_printed_and_why_it_failed(tmp_path, monkeypatch, text, told, code):
    monkeypatch.setattr(tests.command, "measure_here", run_worker)
    (tmp_path / "mine.py").write_text(text, encoding="utf-8")
    done = run_here(tmp_path, "method_file=mine.py", *TOY)
    assert done.returncode == code
    assert told in done.stderr
    assert "building 2 triangles" in done.stderr
    assert ("in helper" in done.stderr) == (text is RAISES)


def test_a_sweep_shows_the_methods_own_lines_and_the_path_of_the_record(tmp_path):
    (tmp_path / "mine.py").write_text(RAISES, encoding="utf-8")
    done = run_here(tmp_path, "-m", "method_file=mine.py", "method=mine", *TOY)
    assert done.returncode == 1
    (path,) = (tmp_path / "results" / "records").glob("*.json")
    lines = [line.strip() for line in done.stderr.splitlines()]
    assert f"{tmp_path / 'mine.py'}:10 in draw: self.helper(0)" in lines
    assert f"{tmp_path / 'mine.py'}:13 in helper: return 1 / divisor" in lines
    assert f"record: {path.relative_to(tmp_path)}" in lines
    assert not any("guarded.py:" in line for line in lines)


METHOD = GOOD.replace("    def close", "        depth[WHERE] *= 2\n\n    def close")
SAME_AGAIN = GOOD.replace("self.inner.trace(offset)", "self.inner.trace()")
FILES = os.pathsep.join(["mistaken.py", "nearly.py"])
SHOWN = ("scene=cornell_box", "width=64", "height=64", "measure.rounds=3", "measure.warmup=1", "measure.processes=1")


@pytest.fixture
def files(tmp_path):
    """Two method files: in one all pixels are wrong, in the other one alone."""
    (tmp_path / "mistaken.py").write_text(METHOD.replace("WHERE", ":"), encoding="utf-8")
    (tmp_path / "nearly.py").write_text(METHOD.replace("WHERE", "32, 32"), encoding="utf-8")
    return tmp_path


def test_a_point_whose_image_is_wrong_says_so_and_ends_with_an_error(files):
    done = run_here(files, "method_file=mistaken.py", *SHOWN)
    assert done.returncode == 1
    assert "mistaken: wrong: 4,096 of 4,096 pixels wrong; " in done.stderr
    assert "the image is wrong: 4,096 of 4,096 pixels wrong" in done.stderr
    assert "4,096 of 4,096 pixels" in done.stdout


def test_a_method_that_returns_its_first_image_for_every_place_in_a_pixel_is_wrong(tmp_path):
    (tmp_path / "same_again.py").write_text(SAME_AGAIN, encoding="utf-8")
    done = run_here(tmp_path, "method_file=same_again.py", *SHOWN)
    assert done.returncode == 1
    assert "same_again: wrong: " in done.stderr


def test_a_few_wrong_pixels_are_told_and_are_no_failure(files):
    done = run_here(files, "method_file=nearly.py", *SHOWN)
    assert done.returncode == 0, done.stderr
    assert "pixels wrong            │ 1 " in done.stdout
    assert "wrong:" not in done.stderr


@pytest.mark.usefixtures("figures_unsaved")
def test_a_sweep_with_a_wrong_image_has_a_row_that_is_wrong_and_ends_with_an_error(files):
    done = run_here(files, "-m", f"method_file={FILES}", "method=mistaken,nearly", *SHOWN)
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
