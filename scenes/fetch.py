"""The paper's scenes from their public home into a folder, the cache, where `scenes.directory` finds them.

The folder holds `<name>.ply` and cameras.json as `scenes.directory` reads them, and the downloaded zips in `archives/`,
which may be deleted.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import trimesh

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.files.paths import write_atomically
from atra.geometry.mesh import Mesh
from scenes.directory import CAMERAS_FILE, default_cache, read_cameras
from scenes.manifest import FetchableScene, read_manifest

ARCHIVES_FOLDER = "archives"

_TIMEOUT_S = 60.0
_BLOCK_BYTES = 1 << 16
_USER_AGENT = "atra scene fetch (research; one file at a time)"  # the archive refuses some clients' default names


def fetch_scene(name: str, cache: str | Path | None = None, base_url: str | None = None) -> Path:
    """Download a scene of the manifest, unless the cache has it, and print its author and licence.

    name: one of the manifest's. cache: the folder to keep it in; None = `default_cache()`, `~` is expanded.
    base_url: another home with the same paths below it; None = the manifest's.
    Returns the path of `<cache>/<name>.ply`; its camera is in cameras.json beside it, where one of that name that is
    already there is kept. A scene that is in the cache needs neither network nor pooch.
    Raises InputError for an unknown name, missing pooch, a download that fails (saying what to do by hand), is larger
    than promised or has a wrong hash, a wrong triangle count, or a cache that cannot be written.
    """
    manifest = read_manifest()
    source = manifest.scene(name)
    folder = default_cache() if cache is None else Path(cache).expanduser().absolute()
    ply = folder / f"{name}.ply"
    try:
        (folder / ARCHIVES_FOLDER).mkdir(parents=True, exist_ok=True)
        print(_credits(source, manifest.home), flush=True)
        if ply.exists():
            _load_checked(ply, source, f"delete {ply} and fetch it again")
        else:
            url = (base_url or manifest.base_url).rstrip("/") + "/" + source.archive
            mesh = _download(url, folder / ARCHIVES_FOLDER, source)
            # Not Trimesh(process=True), which merges vertices.
            made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
            write_atomically(ply, made.export(file_type="ply", vertex_normal=False))
        _add_camera(folder / CAMERAS_FILE, source)
    except OSError as error:
        raise InputError(f"the scene cache {folder} cannot be used: {error}") from None
    return ply


def _credits(source: FetchableScene, home: str) -> str:
    lines = [f"{source.title} by {source.author}", f"licence: {source.licence}; from {home}"]
    return "\n".join([*lines, f"NOTICE: {source.notice}"] if source.notice else lines)


def _download(url: str, archives: Path, source: FetchableScene) -> Mesh:
    """The archive into `archives`, unless it is there, with its hash checked either way; returns the mesh inside."""
    try:
        import pooch
        import requests  # comes with pooch
    except ImportError:
        raise InputError("fetching scenes needs the package pooch; run: pip install 'atra[fetch]'") from None

    def receive(url: str, path: str, _: Any) -> None:
        headers = {"User-Agent": _USER_AGENT, "Accept-Encoding": "identity"}
        come = 0
        with requests.get(url, headers=headers, timeout=_TIMEOUT_S, stream=True) as response, open(path, "wb") as file:
            response.raise_for_status()
            for block in response.iter_content(_BLOCK_BYTES):
                come += len(block)
                if come > source.archive_bytes:
                    raise ValueError(f"more came than the {source.archive_bytes} bytes that the manifest states")
                file.write(block)

    # What of the folder Windows does not let go of at the end is left.
    with tempfile.TemporaryDirectory(dir=archives, ignore_cleanup_errors=True) as scratch:
        archive = f"{source.name}.zip"
        try:
            files = pooch.retrieve(
                url, f"sha256:{source.sha256}", archive, archives, pooch.Unzip(extract_dir=scratch), receive
            )
        except (OSError, ValueError) as error:  # every error of requests is an OSError
            raise InputError(
                f"{url} cannot be downloaded ({error}). By hand: download that address with a browser, put the file "
                f"at {archives / archive} and run this again"
            ) from None
        found = [path for path in map(Path, files) if path.name == source.member]
        if len(found) != 1:
            raise InputError(f"{archives / archive} holds {len(found)} files called {source.member}, expected one")
        return _load_checked(found[0], source, f"{archives / archive} is not the scene the paper used; delete it")


def _load_checked(path: Path, source: FetchableScene, advice: str) -> Mesh:
    mesh = load_mesh(path)
    if mesh.triangle_count != source.triangles:
        raise InputError(
            f"scene {source.name!r} has {mesh.triangle_count} triangles, expected {source.triangles}: {advice}"
        )
    return mesh


def _add_camera(path: Path, source: FetchableScene) -> None:
    cameras = read_cameras(path) if path.exists() else {}
    if source.name not in cameras:
        cameras[source.name] = source.camera
        write_atomically(path, (json.dumps(cameras, indent=2) + "\n").encode())
