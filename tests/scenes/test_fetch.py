"""Fetching the paper's scenes: from a server on this machine, with archives made here."""

import errno
import hashlib
import io
import json
import os
import re
import sys
import threading
import zipfile
from contextlib import suppress
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from unittest.mock import Mock

import numpy as np
import pytest

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.geometry.camera import Camera
from experiments.commands import fetching
from experiments.commands.fetching import run_fetch
from experiments.harness.configuration import Configuration, SceneConfiguration
from scenes import fetch, manifest
from scenes.directory import default_cache, load_scene_from_directory
from scenes.fetch import fetch_scene
from scenes.loading import SceneSource
from tests.folders import empty_cache

OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"


def zipped(*members):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members:
            file.writestr(name, content)
    return packed.getvalue()


@pytest.fixture
def server(monkeypatch):
    """Serves `files` (path -> bytes) on 127.0.0.1, counts requests, and has no other network."""
    pytest.importorskip("pooch", reason="fetching needs pooch: pip install 'atra[fetch]'")

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            self.server.asked.append((self.path, self.headers["User-Agent"]))
            content = self.server.files.get(self.path)
            self.send_response(404 if content is None else 200)
            self.end_headers()
            with suppress(ConnectionError):
                self.wfile.write(content or b"")
                self.server.sent += len(content or b"")

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        running.files, running.asked, running.sent = {}, [], 0
        running.url = f"http://127.0.0.1:{running.server_port}/g3d/"
        thread = threading.Thread(target=running.serve_forever, kwargs={"poll_interval": 0.02})
        thread.start()
        yield running
        running.shutdown()
        thread.join()


@pytest.fixture
def describe(monkeypatch):
    """Makes the manifest hold one tiny scene called sponza: this archive, with the fields given."""
    real = manifest.read_manifest()

    def describe_scene(content, **fields):
        fields = {"archive_bytes": len(content), "sha256": hashlib.sha256(content).hexdigest(), "triangles": 2} | fields
        tiny = replace(real.scene("sponza"), archive="a/tiny.zip", **fields)
        monkeypatch.setattr(fetch, "read_manifest", lambda: replace(real, scenes={"sponza": tiny}))

    return describe_scene


@pytest.fixture
def by_hand(tmp_path, describe):
    """Puts an archive where a download would have put it, so that no network is needed."""
    pytest.importorskip("pooch", reason="fetching needs pooch: pip install 'atra[fetch]'")

    def put(content, cache=tmp_path, **fields):
        describe(content, **fields)
        folder = cache / fetch.ARCHIVES_FOLDER
        folder.mkdir(parents=True)
        (folder / "sponza.zip").write_bytes(content)
        return cache

    return put


TINY = zipped(("copyright.txt", "mine"), ("crytek/sponza.obj", OBJ))


def test_a_fetched_scene_can_be_read_as_one_of_the_scene_folder(server, describe, tmp_path):
    describe(TINY)
    server.files["/g3d/a/tiny.zip"] = TINY
    path = fetch_scene("sponza", tmp_path / "new" / "cache", server.url)
    assert path == tmp_path / "new" / "cache" / "sponza.ply"
    scene = load_scene_from_directory("sponza", path.parent)
    assert np.array_equal(scene.mesh.vertices, [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    assert np.array_equal(scene.mesh.faces, [(0, 1, 2), (0, 2, 3)])
    assert scene.camera["eye"] == (-1150.0, 250.0, -40.0)
    assert [agent for _, agent in server.asked] == [fetch._USER_AGENT]
    files = sorted(path.name for path in path.parent.rglob("*") if path.is_file())
    assert files == ["cameras.json", "sponza.ply", "sponza.zip"]


def test_the_ply_keeps_every_vertex_to_the_last_bit_in_its_order(by_hand):
    random = np.random.default_rng(7).normal(size=(50, 3)).astype(np.float32)
    vertices = np.concatenate([random, random[:10]])  # some places twice
    faces = np.arange(60).reshape(20, 3)
    lines = ["v {!r} {!r} {!r}".format(*map(float, vertex)) for vertex in vertices]
    lines += ["f {} {} {}".format(*face) for face in faces + 1]
    folder = by_hand(zipped(("sponza.obj", "\n".join(lines))), triangles=20)
    mesh = load_mesh(fetch_scene("sponza", folder))
    assert np.array_equal(mesh.vertices, vertices)
    assert np.array_equal(mesh.faces, faces)


def test_fetching_mitsuba_shows_its_restriction_before_anything_is_downloaded_and_what_installs_pooch(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(InputError, match=r"pip install 'atra\[fetch\]'"):
        fetch_scene("mitsuba", tmp_path)
    assert "direct comparisons between the Mitsuba renderer and others" in capsys.readouterr().out


@pytest.mark.parametrize(("content", "fields", "said"), [
    (None, {}, "a/tiny.zip cannot be downloaded"),  # nothing is there
    (TINY[:-30], {}, "a/tiny.zip cannot be downloaded"),  # it breaks off
    (bytes(len(TINY)), {}, f"expected sha256:{hashlib.sha256(TINY).hexdigest()}"),
    (bytes(100_000_000), {"archive_bytes": 224_880}, "more came than the 224880 bytes"),
], ids=["none", "part", "another", "too much"])  # fmt: skip
def test_a_download_that_is_not_the_one_stated_is_refused_and_nothing_of_it_is_kept(
    content, fields, said, server, describe, tmp_path
):
    describe(TINY, **fields)
    server.files["/g3d/a/tiny.zip"] = content
    with pytest.raises(InputError, match=said) as refused:
        fetch_scene("sponza", tmp_path, server.url)
    assert str(tmp_path / "archives" / "sponza.zip") in str(refused.value)  # where to put it by hand
    assert [path.name for path in tmp_path.rglob("*")] == ["archives"]
    assert server.sent < 100_000_000  # it ends as soon as too much has come
    describe(TINY)
    server.files["/g3d/a/tiny.zip"] = TINY
    assert fetch_scene("sponza", tmp_path, server.url).is_file()


def test_an_archive_put_there_by_hand_is_used_if_its_hash_is_right_and_fetched_again_if_not(by_hand, server):
    folder = by_hand(TINY)
    (folder / "archives" / "sponza.zip").write_bytes(b"half of it")
    server.files["/g3d/a/tiny.zip"] = TINY
    assert fetch_scene("sponza", folder, server.url).is_file()
    (folder / "sponza.ply").unlink()
    assert fetch_scene("sponza", folder, "http://127.0.0.1:9/").is_file()
    assert len(server.asked) == 1


def test_a_wrong_triangle_count_is_refused_with_both_numbers_whether_fetched_or_in_the_cache(by_hand, describe):
    folder = by_hand(zipped(("sponza.obj", OBJ + "f 1 2 4\n")))
    with pytest.raises(InputError, match="has 3 triangles, expected 2"):
        fetch_scene("sponza", folder)
    assert [path.name for path in sorted(folder.rglob("*"))] == ["archives", "sponza.zip"]
    describe((folder / "archives" / "sponza.zip").read_bytes(), triangles=3)
    path = fetch_scene("sponza", folder)
    describe(TINY)
    with pytest.raises(InputError, match=f"has 3 triangles, expected 2: delete {re.escape(str(path))}"):
        fetch_scene("sponza", folder)


def test_a_scratch_folder_that_cannot_be_removed_does_not_lose_the_scene(by_hand, monkeypatch):
    cache = by_hand(TINY)
    in_use = Mock(side_effect=OSError(errno.ENOTEMPTY, "being used by another process"))  # as Windows says
    monkeypatch.setattr(os, "rmdir", in_use)
    assert fetch_scene("sponza", cache).is_file()


def test_nothing_is_unpacked_outside_the_cache_and_what_is_there_needs_neither_network_nor_pooch(by_hand, monkeypatch):
    names = ("../evil.txt", "a/../../evil.txt", "/tmp/evil.txt", "C:\\evil.txt")
    folder = by_hand(zipped(("sponza.obj", OBJ), *((name, "evil") for name in names)))
    first = fetch_scene("sponza", folder).read_bytes()
    monkeypatch.setitem(sys.modules, "pooch", None)
    assert fetch_scene("sponza", folder).read_bytes() == first
    assert sorted(path.name for path in folder.rglob("*")) == ["archives", "cameras.json", "sponza.ply", "sponza.zip"]
    assert not list(folder.parent.glob("evil*"))


@pytest.mark.parametrize(("names", "count"), [(["sponza.txt"], 0), (["a/sponza.obj", "b/sponza.obj"], 2)])
def test_an_archive_with_no_mesh_or_several_and_a_cache_that_is_a_file_are_refused(names, count, by_hand, tmp_path):
    with pytest.raises(InputError, match=f"holds {count} files called sponza.obj, expected one"):
        fetch_scene("sponza", by_hand(zipped(*((name, OBJ) for name in names))))
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"cache .*file cannot be used"):
        fetch_scene("sponza", tmp_path / "file")


def test_a_camera_of_the_users_own_is_kept_and_other_scenes_stay(by_hand):
    folder = by_hand(TINY)
    mine = {"sponza": {"eye": [1, 2, 3], "target": [0, 0, 0]}, "other": {"eye": [0, 0, 1], "target": [0, 0, 0]}}
    (folder / "cameras.json").write_text(json.dumps(mine))
    fetch_scene("sponza", folder)
    assert json.loads((folder / "cameras.json").read_text()) == mine
    (folder / "cameras.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read as JSON"):
        fetch_scene("sponza", folder)


def test_the_manifest_names_the_papers_counts_and_usable_cameras_and_one_restriction():
    scenes = manifest.read_manifest().scenes
    counts = {"cornell_box": 1112, "mitsuba": 61600, "fireplace_room": 143173, "sponza": 262267}
    assert {name: scene.triangles for name, scene in scenes.items()} == counts
    for scene in scenes.values():
        Camera(**scene.camera, width=8, height=8)
        assert scene.author
        assert scene.licence
        assert scene.archive_bytes > 0
        assert re.fullmatch(r"[0-9a-f]{64}", scene.sha256)
    assert [name for name, scene in scenes.items() if scene.notice] == ["mitsuba"]
    assert [name for name, scene in scenes.items() if scene.pictures_may_be_passed_on is not True] == ["mitsuba"]


@pytest.fixture
def home(tmp_path, monkeypatch):
    """No ATRA_SCENES, and an empty cache wherever this system keeps caches."""
    empty_cache(tmp_path / "home", monkeypatch)
    return tmp_path


def asked_for(name, source=SceneSource.directory):
    return Configuration(scene=SceneConfiguration(name=name, source=source))


def test_the_fetch_command_leaves_a_scene_every_run_finds_and_says_what_to_run(home, by_hand, capsys):
    by_hand(TINY, default_cache())
    path = run_fetch(asked_for("sponza"))
    assert path == default_cache() / "sponza.ply"
    assert load_scene_from_directory("sponza").mesh.triangle_count == 2
    told = capsys.readouterr().out
    for said in ("Frank Meinl", "CC BY 3.0", str(path), "python run.py scene=sponza"):
        assert said in told
    assert run_fetch(asked_for("sponza")) == path  # again: the archive is not asked for


def test_what_the_users_folder_holds_or_the_program_makes_is_not_fetched(home, monkeypatch, capsys):
    monkeypatch.setenv("ATRA_SCENES", str(home))
    (home / "sponza.ply").write_text("mine")
    monkeypatch.setattr(fetching, "fetch_scene", lambda name: pytest.fail("fetched"))
    assert run_fetch(asked_for("sponza")) == home / "sponza.ply"
    assert "nothing was fetched" in capsys.readouterr().out
    for name in ("cornell_box", "atrium"):  # built in
        assert run_fetch(asked_for(name, SceneSource.procedural)) is None
        told = capsys.readouterr().out
        assert "nothing needs fetching" in told
        assert ("fetch scene=sponza" in told) == (name == "atrium")
    assert not default_cache().exists()


@pytest.mark.parametrize(("name", "source", "reason"), [
    (None, SceneSource.file, "scene=file needs scene.path, for example scene.path=model.ply"),
    (None, SceneSource.directory, "needs scene.name"),
    ("dragon", SceneSource.directory, "no scene 'dragon' can be fetched, expected one of cornell_box"),
    ("dragon", SceneSource.procedural, "unknown procedural scene 'dragon'"),
])  # fmt: skip
def test_what_cannot_be_fetched_is_refused_and_leaves_nothing(name, source, reason, home):
    with pytest.raises(InputError, match=reason):
        run_fetch(asked_for(name, source))
    assert not default_cache().exists()
