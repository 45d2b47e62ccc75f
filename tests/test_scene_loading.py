"""Scenes by source and name: which are there, and which picture may be shown."""

import json

import pytest

from atra.errors import InputError
from experiments.harness.configuration import SceneSource
from experiments.harness.scene_loading import load_scene, scene_is_available
from scenes.manifest import picture_restriction, read_manifest
from scenes.stand_ins import STAND_INS, stand_in_for
from tests.folders import empty_cache


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A scene folder that ATRA_SCENES names, and an empty cache."""
    empty_cache(tmp_path / "home", monkeypatch)
    monkeypatch.setenv("ATRA_SCENES", str(tmp_path))
    (tmp_path / "cameras.json").write_text(json.dumps({"sponza": {"eye": [0, 0, 5], "target": [0, 0, 0]}}))
    return tmp_path


def test_a_scene_is_available_once_its_file_is_there_even_if_it_cannot_be_read(folder):
    assert not scene_is_available(SceneSource.directory, "sponza")
    (folder / "sponza.ply").write_text("no mesh")
    assert scene_is_available(SceneSource.directory, "sponza")
    with pytest.raises(InputError):
        load_scene(SceneSource.directory, "sponza", None)


def test_a_camera_file_may_leave_out_what_is_optional(folder):
    with_mesh(folder / "sponza.ply")
    _, fields = load_scene(SceneSource.directory, "sponza", None)
    assert fields == {"eye": (0, 0, 5), "target": (0, 0, 0), "up": (0.0, 1.0, 0.0), "fov_y_degrees": 60.0}


def with_mesh(path):
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )


def test_every_built_in_scene_is_available_and_no_other_name_is():
    for name in ("cornell_box", *STAND_INS):
        assert scene_is_available(SceneSource.procedural, name)
    assert not scene_is_available(SceneSource.procedural, "sponza")
    assert not scene_is_available(SceneSource.directory, None)
    assert scene_is_available(SceneSource.file, None)


def test_a_mistyped_scene_folder_is_an_error_and_not_a_missing_scene(monkeypatch):
    monkeypatch.setenv("ATRA_SCENES", "no/such/folder")
    with pytest.raises(InputError, match="not a folder"):
        scene_is_available(SceneSource.directory, "sponza")
    assert scene_is_available(SceneSource.procedural, "atrium")


def test_each_stand_in_is_found_by_the_scene_it_stands_for():
    assert {stand_in_for(made.stands_for): made for made in STAND_INS.values()} == STAND_INS
    assert stand_in_for("cornell_box") is None
    assert stand_in_for("atrium") is None


def test_only_pictures_of_mitsuba_are_withheld_and_the_reason_is_one_sentence():
    withheld = {name for name in (*read_manifest().scenes, *STAND_INS, "my_model") if picture_restriction(name)}
    assert withheld == {"mitsuba"}
    reason = picture_restriction("mitsuba")
    assert "Mitsuba Knob" in reason
    assert reason.count(".") == 1
    assert reason.endswith(".")
