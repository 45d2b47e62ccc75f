"""The paper's scenes from their public home into a folder, the cache, where `scenes.directory` finds them.

The folder holds `<name>.ply` and cameras.json as `scenes.directory` reads them, and the downloaded zips in `archives/`,
which may be deleted.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from pathlib import Path

import numpy as np

from atra.errors import InputError
from atra.files import write_atomically
from atra.geometry.mesh import Mesh
from atra.geometry.mesh_file import load_mesh
from scenes.archive import LARGEST_UNPACKED_BYTES, extract_member
from scenes.directory import CAMERAS_FILE, default_cache
from scenes.manifest import SceneSource, read_manifest

ARCHIVES_FOLDER = "archives"

_TIMEOUT_S = 60.0
_BLOCK_BYTES = 1 << 16
_USER_AGENT = "atra scene fetch (research; one file at a time)"  # the archive refuses some clients' default names


def fetch_scene(name: str, cache: str | Path | None = None, base_url: str | None = None) -> Path:
    """Download a scene of the manifest, unless the cache has it, and print its author and licence.

    name: one of the manifest's. cache: the folder to keep it in; None = `default_cache()`, `~` is expanded.
    base_url: another home with the same paths below it; None = the manifest's.
    Returns the path of `<cache>/<name>.ply`; its camera is in cameras.json beside it, where one of that name that is
    already there is kept. A scene that is in the cache needs neither network nor requests.
    Raises InputError for an unknown name, missing requests, a download that fails (saying what to do by hand) or is
    larger than promised, a wrong hash, an archive that cannot be trusted, a wrong triangle count, or a cache that
    cannot be written.
    """
    manifest = read_manifest()
    source = manifest.scene(name)
    folder = default_cache() if cache is None else Path(cache).expanduser()
    ply = folder / f"{name}.ply"
    try:
        (folder / ARCHIVES_FOLDER).mkdir(parents=True, exist_ok=True)
        print(_credits(source, manifest.home), flush=True)
        if ply.exists():
            _load_checked(ply, source, f"delete {ply} and fetch it again")
        else:
            url = (base_url or manifest.base_url).rstrip("/") + "/" + source.archive
            archive = folder / ARCHIVES_FOLDER / f"{name}.zip"
            if not archive.exists():
                _download(url, archive, source)
            _check_hash(archive, source, f"delete {archive} and fetch it again")
            with _scratch(folder / ARCHIVES_FOLDER) as scratch:
                unpacked = extract_member(archive, source.member, Path(scratch))
                mesh = _load_checked(unpacked, source, f"{archive} is not the scene the paper used; delete it")
            _write_ply(ply, mesh)
        _add_camera(folder / CAMERAS_FILE, source)
    except OSError as error:
        raise InputError(f"the scene cache {folder} cannot be used: {error}") from None
    return ply


def _scratch(folder: Path) -> tempfile.TemporaryDirectory[str]:
    """A folder of its own for unfinished work; what of it Windows does not let go of at the end is left."""
    return tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True)


def _credits(source: SceneSource, home: str) -> str:
    lines = [f"{source.title} by {source.author}", f"licence: {source.licence}; from {home}"]
    return "\n".join([*lines, f"NOTICE: {source.notice}"] if source.notice else lines)


def _download(url: str, archive: Path, source: SceneSource) -> None:
    size = "" if source.archive_bytes is None else f" ({source.archive_bytes / 1e6:.1f} MB)"
    print(f"fetching {url}{size}", flush=True)
    # A folder of its own, so that a broken download, or another process's, never passes for the archive.
    with _scratch(archive.parent) as scratch:
        got = Path(scratch) / archive.name
        try:
            _receive(url, got, LARGEST_UNPACKED_BYTES if source.archive_bytes is None else source.archive_bytes)
        except InputError:
            raise
        except (OSError, ValueError) as error:  # every error of requests is an OSError
            raise InputError(
                f"{url} cannot be downloaded ({error}). By hand: download that address with a browser, put the file "
                f"at {archive} and run this again"
            ) from None
        _check_hash(got, source, f"try again; if it stays so, {url} has changed since the manifest was written")
        os.replace(got, archive)


def _receive(url: str, target: Path, most_bytes: int) -> None:
    """Raises InputError as soon as more than `most_bytes` are announced or have come."""
    try:
        import requests
    except ImportError:
        raise InputError("fetching scenes needs the package requests; run: pip install 'atra[fetch]'") from None

    def check(sends: str, count: int) -> None:
        if count > most_bytes:
            raise InputError(
                f"{url} {sends}, expected at most {most_bytes} bytes by the manifest; it has changed since that was "
                "written, or is not what it should be"
            )

    come = 0
    headers = {"User-Agent": _USER_AGENT, "Accept-Encoding": "identity"}
    with requests.get(url, headers=headers, timeout=_TIMEOUT_S, stream=True) as response, target.open("wb") as file:
        response.raise_for_status()
        announced = int(response.headers.get("Content-Length", 0))
        check(f"sends {announced} bytes", announced)
        for block in response.iter_content(_BLOCK_BYTES):
            come += len(block)
            check(f"sends more than the {most_bytes} bytes", come)
            file.write(block)


def _check_hash(archive: Path, source: SceneSource, advice: str) -> None:
    if source.sha256 is None:
        return
    with archive.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != source.sha256:
        raise InputError(f"the archive of scene {source.name!r} has sha256 {found}, expected {source.sha256}: {advice}")


def _load_checked(path: Path, source: SceneSource, advice: str) -> Mesh:
    mesh = load_mesh(path)
    if mesh.triangle_count != source.triangles:
        raise InputError(
            f"scene {source.name!r} has {mesh.triangle_count} triangles, expected {source.triangles}: {advice}"
        )
    return mesh


def _write_ply(path: Path, mesh: Mesh) -> None:
    """Binary PLY, complete or not there at all."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {mesh.triangle_count}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(mesh.triangle_count, dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"] = mesh.faces
    write_atomically(path, header.encode("ascii") + mesh.vertices.astype("<f4").tobytes() + faces.tobytes())


def _add_camera(path: Path, source: SceneSource) -> None:
    try:
        cameras = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        cameras = {}
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as JSON: {error}; mend or delete it") from None
    if not isinstance(cameras, dict):
        raise InputError(f"{path} holds a {type(cameras).__name__}, expected an object: scene name -> camera fields")
    if source.name not in cameras:
        cameras[source.name] = source.camera
        write_atomically(path, (json.dumps(cameras, indent=2) + "\n").encode())
