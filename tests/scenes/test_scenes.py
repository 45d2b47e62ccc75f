"""Scenes by source and name, scenes from a folder, and the view of a mesh that has none."""

import json
import os
import subprocess
import sys
import tempfile

import numpy as np
import pytest

from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from scenes.built_in import BUILT_IN, make_scene, stand_in_for
from scenes.cornell_box import cornell_box
from scenes.directory import default_cache, default_camera_fields, find_scene_folder, load_scene_from_directory
from scenes.loading import SceneSource, load_scene, scene_is_available
from scenes.manifest import picture_restriction, read_manifest
from scenes.scene import Scene
from tests.folders import ROOT, empty_cache

PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
CAMERA = {"eye": [0, 0, 5], "target": [0, 0, 0]}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "cameras.json").write_text(json.dumps({"tri": CAMERA, "absent": CAMERA}))
    (tmp_path / "tri.ply").write_text(PLY)
    return tmp_path


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache of fetched scenes, wherever this system keeps caches, and no ATRA_SCENES."""
    made = empty_cache(tmp_path / "home", monkeypatch)
    made.mkdir(parents=True)
    return made


def test_a_folder_gives_the_mesh_under_its_name_and_fields_a_camera_takes_in_any_order(folder):
    given = {"up": [0, 0, 1], "target": [0, 0, 0], "fov_y_degrees": 30, "eye": [0, 5, 0]}
    (folder / "cameras.json").write_text(json.dumps({"tri": given}))
    scene = load_scene_from_directory("tri", folder)
    assert (scene.mesh.name, scene.mesh.triangle_count) == ("tri", 1)
    assert scene.camera == {"eye": (0, 5, 0), "target": (0, 0, 0), "up": (0, 0, 1), "fov_y_degrees": 30}


def test_the_folder_comes_from_the_environment_relative_to_the_working_directory_or_home(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    monkeypatch.setenv("HOME", str(folder.parent))
    monkeypatch.setenv("USERPROFILE", str(folder.parent))
    for value in (str(folder), folder.name, f"~/{folder.name}"):
        monkeypatch.setenv("ATRA_SCENES", value)
        assert load_scene_from_directory("tri").mesh.triangle_count == 1


@pytest.mark.parametrize(("system", "variables", "expected"), [
    ("linux", {}, "home/.cache"),
    ("linux", {"XDG_CACHE_HOME": "mine"}, "mine"),
    ("darwin", {"XDG_CACHE_HOME": "mine"}, "home/Library/Caches"),
    ("win32", {"LOCALAPPDATA": "mine"}, "mine"),
    ("win32", {}, "home/AppData/Local"),
])  # fmt: skip
def test_the_cache_is_where_each_system_keeps_caches(tmp_path, monkeypatch, system, variables, expected):
    for name in ("HOME", "USERPROFILE"):
        monkeypatch.setenv(name, str(tmp_path / "home"))
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", "ATRA_SCENES"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, str(tmp_path / value))
    monkeypatch.setattr(sys, "platform", system)
    assert default_cache() == tmp_path / expected / "atra" / "scenes"
    for name in ("HOME", "USERPROFILE", *variables):  # as for a user whom the system does not know, in a container
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    assert default_cache().is_relative_to(tempfile.gettempdir())
    assert find_scene_folder("tri") is None


@pytest.mark.parametrize("value", [None, ""])
def test_a_scene_that_is_nowhere_is_refused_with_every_way_out(cache, monkeypatch, value):
    if value is not None:
        monkeypatch.setenv("ATRA_SCENES", value)
    with pytest.raises(InputError) as refused:
        load_scene_from_directory("sponza")
    message = str(refused.value)
    assert f"ATRA_SCENES is not set, and the cache {cache} holds no .ply file" in message
    assert "set ATRA_SCENES to the folder that holds sponza.ply and cameras.json" in message
    assert "python run.py fetch scene=sponza (needs the extra: pip install 'atra[fetch]')" in message
    assert "stand-in scene=atrium" in message
    assert "\n" not in message
    with pytest.raises(InputError, match="ATRA_SCENES is not set") as nobody_has_it:
        load_scene_from_directory("dragon")
    assert not {"fetch", "stand-in"} & set(str(nobody_has_it.value).split())


def test_a_scene_that_neither_folder_has_is_refused_with_what_both_have(folder, cache, monkeypatch):
    monkeypatch.setenv("ATRA_SCENES", str(folder))
    (cache / "other.ply").write_text(PLY)
    with pytest.raises(InputError, match=r"holds tri\.ply, and the cache .* holds other\.ply") as refused:
        load_scene_from_directory("fireplace_room")
    assert f"ATRA_SCENES is {folder}," in str(refused.value)
    assert "scene=living_room" in str(refused.value)


def test_the_users_folder_comes_before_the_cache_and_the_cache_fills_its_gaps(folder, cache, monkeypatch):
    far = {"eye": [0, 0, 9], "target": [0, 0, 0]}
    (cache / "cameras.json").write_text(json.dumps({"tri": far, "other": far}))
    for name in ("tri", "other"):
        (cache / f"{name}.ply").write_text(PLY)
    assert load_scene_from_directory("tri").camera["eye"] == (0, 0, 9)
    monkeypatch.setenv("ATRA_SCENES", str(folder))
    assert load_scene_from_directory("tri").camera["eye"] == (0, 0, 5)
    assert load_scene_from_directory("other").camera["eye"] == (0, 0, 9)
    assert find_scene_folder("tri") == folder
    assert find_scene_folder("other") == cache
    assert find_scene_folder("absent") is None  # a camera without a mesh is no scene


def test_a_folder_that_is_none_is_refused_with_its_name_and_what_a_folder_lacks_with_what_it_has(folder, monkeypatch):
    for name, place, message in (
        ("tri", folder / "tri.ply", r"tri\.ply', which is not a folder"),
        ("dragon", folder, "'dragon'; it has absent, tri"),
        ("absent", folder, r"absent\.ply .* holds tri\.ply"),
    ):
        with pytest.raises(InputError, match=message):
            load_scene_from_directory(name, place)
    monkeypatch.setenv("ATRA_SCENES", "no/such/folder")
    for look in (load_scene_from_directory, find_scene_folder):
        with pytest.raises(InputError, match="ATRA_SCENES is 'no/such/folder', which is not a folder"):
            look("tri")


@pytest.mark.parametrize(("content", "message"), [
    (b"{", "cannot be read as JSON"),
    (b"\xff\xfe", "cannot be read as JSON"),
    (b"[1]", "holds a list"),
    (b'{"tri": 3}', "is 3, expected an object"),
    (b'{"tri": {"eye": [0, 0, 1]}}', "has the fields eye; expected eye and target"),
    (b'{"tri": {"eye": [0, 0, 1], "target": [0, 0, 0], "fov": 3}}', "has the fields eye, fov, target"),
    (None, r"cameras\.json does not exist"),
])  # fmt: skip
def test_missing_or_broken_cameras_are_refused_naming_the_file(folder, content, message):
    path = folder / "cameras.json"
    path.unlink() if content is None else path.write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_scene_from_directory("tri", folder)
    assert content is None or str(path) in str(caught.value)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_in_place_of_the_cameras_is_refused_instead_of_waited_for(folder):
    (folder / "cameras.json").unlink()
    os.mkfifo(folder / "cameras.json")
    read = "import sys; from scenes.directory import load_scene_from_directory as load; load('tri', sys.argv[1])"
    done = subprocess.run(
        [sys.executable, "-c", read, str(folder)],
        cwd=ROOT, capture_output=True, text=True, timeout=45,
    )  # fmt: skip
    assert "cameras.json is no regular file" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(("field", "value"), [
    ("eye", "abc"),
    ("eye", [0, 1]),
    ("target", [0, 1, None]),
    ("up", [0, 1, float("nan")]),
    ("up", {"x": 0, "y": 1, "z": 0}),
    ("fov_y_degrees", [45]),
    ("fov_y_degrees", 10**400),
    ("target", [0, 0, 5]),  # where the eye is
])  # fmt: skip
def test_a_camera_field_that_is_no_number_or_vector_is_refused_naming_it(field, value, folder):
    cameras = {"tri": {"eye": [0, 0, 5], "target": [0, 0, 0], field: value}}
    (folder / "cameras.json").write_text(json.dumps(cameras))
    with pytest.raises(InputError, match=rf"the camera of 'tri' cannot be used: .*{field} "):
        load_scene_from_directory("tri", folder)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_default_camera_frames_the_whole_mesh(scale):
    box = cornell_box()
    mesh = Mesh(box.vertices * np.float32(scale) + np.float32(scale), box.faces)
    camera = Camera(**default_camera_fields(mesh), width=100, height=100)
    points = camera.to_camera_space(mesh.vertices)
    on_image = points[:, :2] / points[:, 2:] / camera.pixel_pitch
    assert (points[:, 2] > 0).all()
    assert np.abs(on_image).max() < 50
    assert np.abs(on_image).max() > 25
    assert camera.axes[2][2] < 0  # looks from the +z side
    for vertices in ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(1, 0, 0), (0, 0, 1), (0, 0, 0)], [(2, 2, 2)] * 3):
        Camera(**default_camera_fields(Mesh(vertices, [(0, 1, 2)])))  # flat, and collapsed


def test_every_source_gives_a_scene_with_a_whole_camera_and_what_is_known_of_it(cache, monkeypatch):
    monkeypatch.setenv("ATRA_SCENES", str(cache))
    (cache / "cameras.json").write_text(json.dumps({"sponza": CAMERA, "mitsuba": CAMERA}))
    assert not scene_is_available(SceneSource.directory, "sponza")
    for name in ("sponza", "mitsuba"):
        (cache / f"{name}.ply").write_text(PLY)
    assert scene_is_available(SceneSource.directory, "sponza")
    sponza = load_scene(SceneSource.directory, "sponza", None)
    assert (sponza.name, sponza.mesh.name, sponza.stands_for) == ("sponza", "sponza", None)
    assert sponza.picture_restriction is None
    assert sponza.camera == {"eye": (0, 0, 5), "target": (0, 0, 0), "up": (0.0, 1.0, 0.0), "fov_y_degrees": 60.0}
    assert "Mitsuba Knob" in load_scene(SceneSource.directory, "mitsuba", None).picture_restriction
    own = load_scene(SceneSource.file, None, str(cache / "mitsuba.ply"))  # the user's, who is to judge it
    assert (own.mesh.triangle_count, set(own.camera), own.picture_restriction) == (1, set(sponza.camera), None)
    assert own.mesh_sha256 == sponza.mesh_sha256
    box = load_scene(SceneSource.procedural, "cornell_box", None)
    assert (box.name, set(box.camera), box.stands_for) == ("cornell_box", set(sponza.camera), None)
    assert box.mesh_sha256 != sponza.mesh_sha256


def test_the_hash_of_a_scene_changes_with_its_vertices_and_with_its_faces():
    corners, faces = np.eye(3), [(0, 1, 2), (0, 2, 1)]
    meshes = [Mesh(corners, faces), Mesh(corners, faces[::-1]), Mesh(2 * corners, faces), Mesh(corners, faces)]
    one, turned, larger, again = (Scene("one", mesh, {}).mesh_sha256 for mesh in meshes)
    assert len({one, turned, larger}) == 3
    assert again == one


def test_built_in_scenes_are_available_and_each_stand_in_is_found_by_the_scene_it_stands_for():
    assert all(scene_is_available(SceneSource.procedural, name) for name in BUILT_IN)
    assert not scene_is_available(SceneSource.procedural, "sponza")
    assert not scene_is_available(SceneSource.directory, None)
    assert scene_is_available(SceneSource.file, None)
    names = {"mitsuba": "material_ball", "fireplace_room": "living_room", "sponza": "atrium"}
    assert {name: stand_in_for(name) for name in names} == names
    assert {stand_in_for(name) for name in ("cornell_box", "atrium", None)} == {None}
    assert make_scene("material_ball").stands_for == "mitsuba"


def test_only_pictures_of_mitsuba_are_withheld_and_the_reason_is_one_sentence():
    withheld = {name for name in (*read_manifest().scenes, *BUILT_IN, "my_model") if picture_restriction(name)}
    assert withheld == {"mitsuba"}
    reason = picture_restriction("mitsuba")
    assert "Mitsuba Knob" in reason
    assert reason.index(".") == len(reason) - 1
