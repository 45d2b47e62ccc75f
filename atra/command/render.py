"""`atra render`: the hits of every view of a mesh, written to files."""

from __future__ import annotations

import re
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

import numpy as np

from atra.command.cameras import DIRECTIONS, chosen_cameras, is_file_name
from atra.command.picture import add_limits, add_picture, load_with_cameras, run_picture, wants_picture
from atra.errors import InputError, StorageError, printable
from atra.files.cameras.entries import Broken
from atra.files.meshes.loading import FaceSources, load_face_sources, load_mesh
from atra.files.saving import PLANE_FORMATS, PLANES, SOURCES, check_package, plane_names
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.views.render_views import render_views

FORMATS = ("npz", "exr", "png", "ply")
"""Formats of a whole image, beside those of single planes."""

EXAMPLES = """\
atra render model.glb -o picture.png          a picture in full light
       atra render model.ply --planes depth,normals  arrays of what is seen
       atra render room.glb --camera sparse/0        arrays by COLMAP's cameras
       atra render bop DATASET --split test          labels of a BOP dataset"""
"""What the help of `atra render` starts with."""


def add_render(parser: ArgumentParser) -> None:
    """Add the arguments of `run_render`."""
    parser.usage = EXAMPLES
    parser.add_argument("mesh", type=Path, help="a file of a mesh: model.glb, .obj, .ply, …")
    parser.add_argument(
        "--camera", metavar="CAMERAS",
        help="front, back, left, right, top or bottom; a camera's name in the file; a COLMAP folder; or a file: "
        "transforms.json, a BOP scene's, a calibration, or JSON of cameras by name with eye, target, width and height, "
        "or K, R and t (default: a picture's is the file's first; else one that frames the mesh)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where arrays go (default: MESH_views)")
    parser.add_argument(
        "--planes", nargs="+", metavar="P",
        help=f"only these of {', '.join(PLANES)}",
    )  # fmt: skip
    parser.add_argument(
        "--depth-along", choices=("axis", "ray"), help="how depths are measured (default: axis; ray for fisheyes)"
    )
    parser.add_argument(
        "--depth-scale", type=float, default=1000.0, metavar="N",
        help="steps of a depth PNG in a unit (default: 1000)",
    )  # fmt: skip
    parser.add_argument("--saturate", action="store_true", help="clamp depths that do not fit 16 bits")
    parser.add_argument(
        "--format", nargs="+", choices=dict.fromkeys((*FORMATS, *PLANE_FORMATS)), default=["npz"], metavar="F",
        help=f"{', '.join(FORMATS)}; with --planes {', '.join(PLANE_FORMATS)} (default: npz)",
    )  # fmt: skip
    parser.add_argument("--size", nargs=2, type=int, metavar=("W", "H"), help="size of cameras without one")
    add_picture(parser)
    add_limits(parser)


def run_render(given: Namespace) -> int:
    """Trace and write all views, printing a line for each; returns 0 if all went well.

    Otherwise it prints at the end which views could not be read, traced or written, and why, and returns 1. Raises
    InputError, before anything is traced, for inputs that cannot be used, and StorageError.
    """
    left_out: Broken = {}
    if wants_picture(given):
        return run_picture(given, lambda mesh, own: chosen_cameras(given, mesh, own, left_out))
    _check_formats(given)
    own: dict[str, View] = {}
    if given.camera is None or given.camera in DIRECTIONS or is_file_name(given.camera):
        mesh = load_mesh(given.mesh, memory_per_byte=given.memory_per_byte)
    else:
        mesh, own = load_with_cameras(given)
    cameras = chosen_cameras(given, mesh, own, left_out)
    sources = None
    if SOURCES.keys() & set(given.planes or ()):
        sources = load_face_sources(given.mesh, memory_per_byte=given.memory_per_byte)
    stems, out = file_stems(cameras), given.out or Path(f"{given.mesh.stem}_views")
    _make_folder(out)
    views = f"{len(cameras)} view{'s' * (len(cameras) > 1)}"
    print(f"{printable(str(given.mesh))}: {mesh.triangle_count:,} triangles; {views}", file=sys.stderr)
    done, failures = 0, list[Exception]()
    try:
        for name, hits in render_views(mesh, cameras, threads=given.threads):
            if not hits.hit.any():
                print(f"atra: {printable(repr(name))} sees nothing: {where_is(mesh, hits.camera)}", file=sys.stderr)
            try:
                paths = _written(given, hits, out / stems[name], sources)
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


def _check_formats(given: Namespace) -> None:
    """Raise InputError for a format that the planes, or an image without them, are not written in."""
    if given.planes is not None:
        given.planes = plane_names([name for names in given.planes for name in names.split(",")])
    known = FORMATS if given.planes is None else PLANE_FORMATS
    for suffix in given.format:
        if suffix not in known:
            without = "without" if given.planes is None else "with"
            raise InputError(f"the format is {suffix}, expected one of {', '.join(known)} {without} --planes")
        if suffix == "exr":
            check_package(".exr")


def _written(given: Namespace, hits: Hits, stem: Path, sources: FaceSources | None) -> list[Path]:
    """Write the files of a view; returns them."""
    paths = []
    for suffix in given.format:
        if given.planes is None:
            paths.append(stem.with_name(f"{stem.name}.{suffix}"))
            hits.save(paths[-1])
        else:
            depth = {name: getattr(given, name) for name in ("depth_along", "depth_scale", "saturate")}
            paths += hits.save_planes(stem, given.planes, suffix, **depth, sources=sources)
    return paths


def where_is(mesh: Mesh, camera: View) -> str:
    """Where a mesh lies that a camera does not see."""
    low, high = (tuple(round(value, 6) for value in corner) for corner in mesh.bounds.tolist())
    centre = mesh.bounds.mean(axis=0, keepdims=True)
    (x, y), depth = camera.project(centre)[0], float(camera.to_camera_space(centre)[0, 2])
    if not np.isfinite(x):
        place = "its centre lies behind the camera" if depth <= 0.0 else "the lens does not see its centre"
    elif 0.0 <= x <= camera.width and 0.0 <= y <= camera.height and depth > 0.0:
        place = f"its centre is in the image, at pixel ({x:.0f}, {y:.0f}), {depth:g} away: it may be too small"
    else:
        place = f"its centre would be at pixel ({x:.0f}, {y:.0f}) of {camera.width} x {camera.height}"
    return f"the mesh reaches from {low} to {high}, the camera is at {camera.eye}; {place}"


def file_stems(names: Iterable[str]) -> dict[str, str]:
    """File names, without folder and suffix, by the names of views; characters special to file systems become "_".

    Raises InputError if two views would share a file.
    """
    stems: dict[str, str] = {}
    for name in names:
        stem = re.sub(r"[^\w.-]+", "_", str(PurePosixPath(name).with_suffix("")) if name else "").strip("._") or "view"
        if stem in stems.values():
            other = next(path for path, taken in stems.items() if taken == stem)
            raise InputError(f"the views {other!r} and {name!r} would both be written to {stem}; rename one of them")
        stems[name] = stem
    return stems


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"{folder} cannot be made: {error.strerror}; choose another --out") from None
