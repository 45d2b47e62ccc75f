"""`atra render`: the hits of every view of a mesh, written to files."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from atra.command.cameras import read_cameras
from atra.errors import InputError, StorageError, printable
from atra.files.cameras.entries import Broken
from atra.files.meshes.loading import load_mesh
from atra.files.reading import MEMORY_PER_BYTE, VARIABLE
from atra.files.saving import check_package
from atra.views.render_views import render_views

FORMATS = ("npz", "exr", "png", "ply")


def add_render(parser: ArgumentParser) -> None:
    """Add the arguments of `run_render`."""
    parser.add_argument("mesh", type=Path, help="a file of any format that trimesh reads: model.glb, .obj, .ply, …")
    parser.add_argument(
        "--camera", type=Path, required=True, metavar="CAMERAS",
        help="a COLMAP model's folder; a transforms.json; or a JSON file of cameras by name, each with eye and target "
        "(and up, fov_y_degrees) or OpenCV's K, R and t, and with width and height",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, required=True, metavar="FOLDER", help="where the files go, made if missing")
    parser.add_argument(
        "--format", nargs="+", choices=FORMATS, default=["npz"],
        help="npz (the default): depth, prim_id, u, v, points, normals; exr: depth, prim_id, normals; png: depth to "
        "look at; ply: points and normals",
    )  # fmt: skip
    parser.add_argument("--size", nargs=2, type=int, metavar=("WIDTH", "HEIGHT"), help="size of cameras without one")
    parser.add_argument("--threads", type=int, help="number of threads (default: every core)")
    parser.add_argument(
        "--memory-per-byte", type=float, metavar="NUMBER",
        help="bound on the memory that reading mesh and cameras may take, in bytes for each byte of a file (default: "
        f"{VARIABLE} or {MEMORY_PER_BYTE:g})",
    )  # fmt: skip


def run_render(given: Namespace) -> int:
    """Trace and write all views, printing a line for each; returns 0 if all went well.

    Otherwise it prints at the end which views could not be read, traced or written, and why, and returns 1. Raises
    InputError, before anything is traced, for inputs that cannot be used, and StorageError.
    """
    for suffix in given.format:
        check_package(f".{suffix}")
    left_out: Broken = {}
    cameras = read_cameras(
        given.camera, None if given.size is None else tuple(given.size), left_out, given.memory_per_byte
    )
    stems = file_stems(cameras)
    mesh = load_mesh(given.mesh, memory_per_byte=given.memory_per_byte)
    _make_folder(given.out)
    views = f"{len(cameras)} view{'s' * (len(cameras) > 1)}"
    print(f"{printable(str(given.mesh))}: {mesh.triangle_count:,} triangles; {views}", file=sys.stderr)
    done, failures = 0, list[Exception]()
    try:
        for name, hits in render_views(mesh, cameras, threads=given.threads):
            paths = [given.out / f"{stems[name]}.{suffix}" for suffix in given.format]
            try:
                for path in paths:
                    hits.save(path)
            except InputError as error:  # for example a .ply of a view without hits
                error.add_note(f"in view {name!r}")
                failures.append(error)
                continue
            done += 1
            written = ", ".join(printable(str(path)) for path in paths)
            print(f"[{done:>{len(str(len(cameras)))}}/{len(cameras)}] {written}: {hits.hit.mean():.1%} hit", flush=True)
    except ExceptionGroup as untraced:
        failures += untraced.exceptions
    reasons = [f"{name!r} is left out: {error}" for name, error in left_out.items()]
    reasons += [f"{failure} ({'; '.join(getattr(failure, '__notes__', ()))})" for failure in failures]
    for reason in reasons:
        print(f"atra: {printable(reason)}", file=sys.stderr)
    if reasons:
        print(f"atra: {done} of {len(cameras) + len(left_out)} views are written", file=sys.stderr)
    return 1 if reasons else 0


def file_stems(names: Iterable[str]) -> dict[str, str]:
    """File names, without folder and suffix, by the names of views; characters special to file systems become "_".

    Raises InputError if two views would share a file.
    """
    stems: dict[str, str] = {}
    for name in names:
        stem = re.sub(r"[^\w.-]+", "_", str(PurePosixPath(name).with_suffix("")) if name else "").strip("._") or "view"
        if stem in stems.values():
            other = next(one for one, taken in stems.items() if taken == stem)
            raise InputError(f"the views {other!r} and {name!r} would both be written to {stem}; rename one of them")
        stems[name] = stem
    return stems


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder} cannot be made: {error.strerror}; choose another --out") from None
