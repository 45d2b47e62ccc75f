"""Scenes by source and name: which are there, and which picture may be shown."""

import json

import pytest

from atra.errors import InputError
from scenes.built_in import BUILT_IN, make_scene, stand_in_for
from scenes.loading import SceneSource, load_scene, scene_is_available
from scenes.manifest import picture_restriction, read_manifest
from tests.folders import empty_cache


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A scene folder that ATRA_SCENES names, and an empty cache."""
    empty_cache(tmp_path / "home", monkeypatch)
    monkeypatch.setenv("ATRA_SCENES", str(tmp_path))
    (tmp_path / "cameras.json").write_text(
        json.dumps({name: {"eye": [0, 0, 5], "target": [0, 0, 0]} for name in ("sponza", "mitsuba")})
    )
    return tmp_path


def test_a_scene_is_available_once_its_file_is_there_even_if_it_cannot_be_read(folder):
    assert not scene_is_available(SceneSource.directory, "sponza")
    (folder / "sponza.ply").write_text("no mesh")
    assert scene_is_available(SceneSource.directory, "sponza")
    with pytest.raises(InputError):
        load_scene(SceneSource.directory, "sponza", None)


def test_every_source_gives_a_scene_with_a_whole_camera_and_what_is_known_of_it(folder):
    for name in ("sponza", "mitsuba"):
        with_mesh(folder / f"{name}.ply")
    sponza = load_scene(SceneSource.directory, "sponza", None)
    assert (sponza.name, sponza.mesh.name, sponza.stands_for, sponza.picture_restriction) == (
        "sponza",
        "sponza",
        None,
        None,
    )
    assert sponza.camera == {"eye": (0, 0, 5), "target": (0, 0, 0), "up": (0.0, 1.0, 0.0), "fov_y_degrees": 60.0}
    assert "Mitsuba Knob" in load_scene(SceneSource.directory, "mitsuba", None).picture_restriction
    own = load_scene(SceneSource.file, None, str(folder / "mitsuba.ply"))  # the user's, who is to judge it
    assert (own.mesh.triangle_count, set(own.camera), own.picture_restriction) == (1, set(sponza.camera), None)
    assert own.mesh_sha256 == sponza.mesh_sha256
    box = load_scene(SceneSource.procedural, "cornell_box", None)
    assert (box.name, set(box.camera), box.stands_for) == ("cornell_box", set(sponza.camera), None)
    assert box.mesh_sha256 != sponza.mesh_sha256
    assert make_scene("material_ball").stands_for == "mitsuba"


def with_mesh(path):
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )


def test_every_built_in_scene_is_available_and_no_other_name_is():
    for name in BUILT_IN:
        assert scene_is_available(SceneSource.procedural, name)
    assert not scene_is_available(SceneSource.procedural, "sponza")
    assert not scene_is_available(SceneSource.directory, None)
    assert scene_is_available(SceneSource.file, None)


def test_each_stand_in_is_found_by_the_scene_it_stands_for():
    names = {"mitsuba": "material_ball", "fireplace_room": "living_room", "sponza": "atrium"}
    assert {name: stand_in_for(name) for name in names} == names
    assert {stand_in_for(name) for name in ("cornell_box", "atrium", None)} == {None}


def test_only_pictures_of_mitsuba_are_withheld_and_the_reason_is_one_sentence():
    withheld = {name for name in (*read_manifest().scenes, *BUILT_IN, "my_model") if picture_restriction(name)}
    assert withheld == {"mitsuba"}
    reason = picture_restriction("mitsuba")
    assert "Mitsuba Knob" in reason
    assert reason.count(".") == 1
    assert reason.endswith(".")
