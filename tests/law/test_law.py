"""The table of the law: constants know nothing of the scene they are judged on, and choices are judged by hand."""

import numpy as np
import pandas as pd
import pytest

from experiments.documents.filling import REFERENCE
from experiments.law.fit import (
    add_tables,
    choices_of,
    errors_of,
    gather,
    leave_one_out,
)
from experiments.law.looks import choice_of, kept_looks, look_of, told_of
from experiments.law.model.choice import Choice
from experiments.law.model.formulas import frame_terms
from experiments.law.model.looking import look_at
from experiments.law.model.memory import array_bytes, byte_terms
from tests.command import run_here
from tests.meshes import cornell_box, cornell_camera


def row(scene, method, measured_s, predicted_s=1.0, **fields):
    return {
        "instruction_set": "avx2", "scene": scene, "view": "own", "want": "nearest", "method": method,
        "measured_time_s": measured_s, "predicted_time_s": predicted_s, **fields,
    }  # fmt: skip


def test_a_choice_is_judged_by_what_it_takes_over_the_fastest():
    rows = pd.DataFrame([
        row("a", "raster", 1.0, 2.0), row("a", "pixel", 1.5, 1.0), row("b", "raster", 1.0, 1.0),
        row("b", "pixel", 4.0, 3.0),
    ])  # fmt: skip
    found = choices_of(rows, "nearest")
    assert (found["views"], found["named"], found["raster"]) == (2, 0.5, 1.0)
    assert found["median"] == pytest.approx(0.25)
    assert choices_of(rows, "nearest", ("raster",))["named"] == 1.0
    assert errors_of(rows).tolist() == [1.0, pytest.approx(1 / 3), 0.0, 0.25]


def test_a_scene_has_no_part_in_the_constants_it_is_judged_by():
    terms = {"frame_terms": np.ones(1), "build_terms": np.ones(1), "bytes_terms": np.ones(1)}
    more = {**terms, "family": "pixel|nearest", "measured_build_s": 1.0, "measured_bytes": 1.0, "array_bytes": 0.0}
    rows = pd.DataFrame([row(scene, "pixel", time, **more) for scene, time in (("a", 1.0), ("a", 1.0), ("b", 3.0))])
    judged = leave_one_out(rows.drop(columns="predicted_time_s"))
    assert judged["predicted_time_s"].tolist() == pytest.approx([3.0, 3.0, 1.0], rel=1e-3)


def test_instances_and_culling_are_told_apart():
    common = {"split_x": 8, "split_y": 1, "packet_width": 8}
    assert choice_of({**common, "method": "aligned", "geometry": "copied", "culling": "True"}).culling
    assert not choice_of({**common, "method": "aligned", "geometry": "copied", "culling": "False"}).culling
    assert choice_of({**common, "method": "aligned", "geometry": "instanced", "culling": "False"}) == Choice(
        "instanced", (8, 1), 8, culling=False
    )


@pytest.mark.usefixtures("figures_unsaved")
def test_a_measured_sweep_becomes_rows_and_looks_that_are_fitted(tmp_path):
    given = ["scene=three_holes,needles", "width=32", "height=32", "measure.rounds=3", "method.packet_width=null"]
    aligned = ["method.split_x=4", "method.split_y=1", "method.culling=true", "method.geometry=copied"]
    done = run_here(tmp_path, "sweep=law", *given, "method=pixel,raster,aligned", *aligned)
    assert done.returncode == 0, done.stderr
    table, folder = pd.read_parquet(tmp_path / "results" / "law" / "table.parquet"), tmp_path / "law"
    add_tables(folder, [table])
    rows = gather(folder)
    assert rows.groupby("scene")["method"].unique().map(set).tolist() == [{"pixel", "raster", "aligned"}] * 2
    assert set(rows["want"]) == {"nearest", "count"}
    nearest = rows[rows["want"] == "nearest"]
    of_scenes = nearest[nearest["method"] != "raster"]  # whose tracer counts all that it keeps
    assert (of_scenes["measured_bytes"] > of_scenes["array_bytes"]).all()
    np.testing.assert_allclose(rows["over_packets"] * rows["time_s"], rows["packets_time_s"])
    judged = leave_one_out(rows)
    assert np.isfinite(judged[["predicted_time_s", "predicted_build_s"]]).all(axis=None)
    add_tables(folder, [table])
    assert len(kept_looks(folder / "looks.parquet")) == 2


def test_what_is_kept_of_a_look_says_as_much_as_the_look():
    look = look_at(cornell_box(), cornell_camera(64, 64))
    choices = [Choice("aligned", (8, 1)), Choice("visible_first", (8, 8)), Choice("tiles", (8, 8)), Choice("bvh")]
    kept = look_of(told_of(look, choices))
    for choice in choices:
        assert frame_terms(kept, choice, "nearest").tolist() == frame_terms(look, choice, "nearest").tolist()
        assert byte_terms(kept, choice).tolist() == byte_terms(look, choice).tolist()
        assert array_bytes(kept, choice) == array_bytes(look, choice)


def test_the_kept_predictions_follow_from_the_kept_measurements():
    table = pd.read_parquet(REFERENCE / "law" / "table.parquet")
    looks = kept_looks(REFERENCE / "law" / "looks.parquet")
    assert len(looks) == len(table.drop_duplicates(["instruction_set", "scene", "view"]))
    rows = gather(REFERENCE / "law")
    rows = rows[(rows["method"] == "pixel") & (rows["instruction_set"] == "avx2")]
    judged = leave_one_out(rows)
    for name in ("predicted_time_s", "predicted_bytes", "predicted_build_s"):
        assert judged[name].to_numpy() == pytest.approx(table.loc[judged.index, name].to_numpy(), rel=1e-6)
